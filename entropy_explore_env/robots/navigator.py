"""The navigator: from where a robot is to where it wants to be, through what it believes, in grid units.

The path is the cheapest one by steps between voxel centres (`planning`), shortened by string pulling. Where
no path to the goal is known, it leads to the reachable voxel nearest to the goal.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from entropy_explore_env.belief.paths.lattice import KNOWN_RATIO, Costs, Lattice, new_lattice
from entropy_explore_env.belief.paths.planning import search_paths
from entropy_explore_env.belief.paths.search import (
    Search,
    cost_to,
    extract_path,
    is_passable,
    mark_of,
    new_search,
)
from entropy_explore_env.belief.paths.string_pulling import Path, line_of_sight_cost, string_pull
from entropy_explore_env.belief.voxel_index import flat_index, grid_index
from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.robots.motion import MoveEnd
from entropy_explore_env.settings.robot import Robot
from entropy_explore_env.settings.scenario import Scenario

_ARRIVED, _NO_PATH, _CORNERS = MoveEnd.ARRIVED.code, MoveEnd.NO_PATH.code, MoveEnd.CORNERS.code
_SLACK = 1e-9
_NEAR = 6.0
"""Voxel edges: see `new_navigator`."""
_PASSABLE, _REACHED = np.int64(0), np.int64(1)
"""Which voxels `_nearest` may choose. NumPy integers, so that it compiles for one type."""


class Navigator(NamedTuple):
    """Memory of plans, for one thread; the system provides the memory of a voxel when a plan reaches it."""

    search: Search
    lattice: Lattice
    known_precision: float
    unknown_cost: float
    source: np.ndarray
    """(1,) int32, the voxel in which a path starts."""
    path: np.ndarray
    """(V,) int32, voxels of the path."""
    ends: np.ndarray
    """(2, 3) float64, start and finish of the path."""
    breaks_out: bool
    """Whether it drives straight to a near goal to which it knows no path: see `new_navigator`."""


def lattice_of(scenario: Scenario, robot: Robot) -> Lattice:
    """Return the steps of a kind of robot between voxel centres."""
    radius = robot.planning_radius_m / scenario.grid.voxel_size_m
    return new_lattice(scenario.grid.shape, radius, scenario.layer_of(robot))


def new_navigators(scenario: Scenario, search: Search | None = None) -> dict[int, Navigator]:
    """Return memory for the plans of each kind of robot that plans, by its number.

    They share all arrays of the map's size, so they may not be used at the same time; nor may a search that
    is lent to them.
    """
    planning = {n: kind.robot for n, kind in enumerate(scenario.kinds) if kind.robot.navigator == "planned"}
    navigators: dict[int, Navigator] = {}
    first: Navigator | None = None
    for number, robot in planning.items():
        if first is None:
            first = navigators[number] = new_navigator(scenario, robot, search)
        else:
            lattice, cost = lattice_of(scenario, robot), float(robot.unknown_cost)
            breaks_out = breaks_out_of(robot)
            navigators[number] = first._replace(lattice=lattice, unknown_cost=cost, breaks_out=breaks_out)
    return navigators


def footprints(navigators: Mapping[int, Navigator], kinds: int) -> np.ndarray:
    """Return (K, B, 3) int64 offsets of each kind's footprint, padded with zeros; B = 0 if no kind plans."""
    each = {kind: navigator.lattice.footprint for kind, navigator in navigators.items()}
    padded = np.zeros((kinds, max((len(footprint) for footprint in each.values()), default=0), 3), np.int64)
    for kind, footprint in each.items():
        padded[kind, : len(footprint)] = footprint
    return padded


def new_navigator(scenario: Scenario, robot: Robot, search: Search | None = None) -> Navigator:
    """Return memory for the plans of one kind of robot.

    A robot that keeps a margin may believe to stand nearer to a wall than that, or in a pocket, where no path
    leads out though it can drive. To a near goal it then drives straight; what is truly in the way stops it.
    """
    prior_precision = float(np.float32(scenario.sigma_prior**-2))
    return Navigator(
        search=search or new_search(scenario.grid.voxels),
        lattice=lattice_of(scenario, robot),
        known_precision=KNOWN_RATIO * prior_precision,
        unknown_cost=float(robot.unknown_cost),
        source=np.zeros(1, np.int32),
        path=np.empty(scenario.grid.voxels, np.int32),
        ends=np.zeros((2, 3)),
        breaks_out=breaks_out_of(robot),
    )


def breaks_out_of(robot: Robot) -> bool:
    """Return whether a kind of robot plans for a body wider than its own."""
    return robot.planning_radius_m > robot.body_radius_m


@lean_kernel
def _voxel_at(lattice, position):
    """Return the number of the voxel that holds a position, or is nearest to it; planar: in the layer."""
    voxel = 0
    for axis in range(3):
        index = min(max(math.floor(position[axis]), 0), lattice.size[axis] - 1)
        if axis == 2 and lattice.layer >= 0:
            index = lattice.layer
        voxel = voxel * lattice.size[axis] + index
    return voxel


@lean_kernel
def _nearest(search, lattice, costs, goal, start, choice):
    """Return the voxel nearest to a goal of those that the latest search reached, or of all passable ones.

    Looked for in growing shells around the goal; of equals the first. The start is one, whatever it is.
    """
    size, layer = lattice.size, lattice.layer
    x, y, z = grid_index(size, goal)
    i, j, k = grid_index(size, start)
    best, nearest = start, (i - x) ** 2 + (j - y) ** 2 + (k - z) ** 2
    shell = 1
    while shell * shell < nearest:
        for i in range(max(x - shell, 0), min(x + shell, size[0] - 1) + 1):
            for j in range(max(y - shell, 0), min(y + shell, size[1] - 1) + 1):
                side = max(abs(i - x), abs(j - y)) == shell
                for k in range(z - shell, z + shell + 1, 1 if side else 2 * shell):
                    if not 0 <= k < size[2] or (layer >= 0 and k != layer):
                        continue
                    apart = (i - x) ** 2 + (j - y) ** 2 + (k - z) ** 2
                    if apart >= nearest:
                        continue
                    voxel = flat_index(size, i, j, k)
                    if choice == _REACHED:
                        found = not math.isinf(cost_to(search, voxel))
                    else:
                        found = is_passable(mark_of(search, lattice, costs, voxel, i, j, k))
                    if found:
                        best, nearest = voxel, apart
        shell += 1
    return best


@lean_kernel
def _search_path(navigator, costs, source, goal):
    """Search a path to a voxel or, where none is known, to the nearest reachable one; returns its end."""
    search, lattice = navigator.search, navigator.lattice
    cost = search_paths(search, lattice, costs, navigator.source, goal, math.inf)
    if not math.isinf(cost):
        return goal
    x, y, z = grid_index(lattice.size, goal)
    if not is_passable(mark_of(search, lattice, costs, goal, x, y, z)):  # then nothing was searched
        near = _nearest(search, lattice, costs, goal, source, _PASSABLE)
        cost = search_paths(search, lattice, costs, navigator.source, near, math.inf)
        if not math.isinf(cost):
            return near
    return _nearest(search, lattice, costs, goal, source, _REACHED)


@lean_kernel
def plan_path(navigator, mean, precision, no_fly, start, goal, waypoints):
    """Fill in the points to which a robot has to drive straight, one after the other.

    Args:
        navigator: Memory of the plan.
        no_fly: (V,) bool, where the body would reach above the ceiling; (0,) = there is no ceiling.
        goal: (x, y, z), anywhere.
        waypoints: (W, 3) float64, filled in; the start is not among them.

    Returns:
        (count, code): how many there are, at least one, and how the drive ends if nothing stops it:
        the code of ARRIVED, NO_PATH or CORNERS (the path needs more than W).
    """
    search, lattice = navigator.search, navigator.lattice
    costs = Costs(mean, precision, navigator.known_precision, navigator.unknown_cost, mean[:0], 1.0, no_fly)
    begin, finish = navigator.ends[0], navigator.ends[1]
    inside, length = True, 0.0
    for axis in range(3):
        begin[axis], finish[axis] = start[axis], goal[axis]
        inside = inside and 0.0 <= goal[axis] <= lattice.size[axis]
        length += (goal[axis] - start[axis]) ** 2
    source, wanted = _voxel_at(lattice, begin), _voxel_at(lattice, finish)
    navigator.source[0] = source
    if inside:  # straight through known free space there is nothing to search
        search_paths(search, lattice, costs, navigator.source, source, 0.0)
        sight = line_of_sight_cost(
            search,
            lattice,
            costs,
            (begin[0], begin[1], begin[2]),  # tuples, for which it is compiled anyway
            (finish[0], finish[1], finish[2]),
        )
        if sight <= math.sqrt(length) * (1.0 + _SLACK):
            for axis in range(3):
                waypoints[0, axis] = finish[axis]
            return 1, _ARRIVED
    code = _ARRIVED
    found = _search_path(navigator, costs, source, wanted)
    if found != wanted and inside and navigator.breaks_out and length <= _NEAR * _NEAR:
        for axis in range(3):
            waypoints[0, axis] = finish[axis]
        return 1, _ARRIVED
    if found != wanted or not inside:
        code = _NO_PATH
        x, y, z = grid_index(lattice.size, found)
        for axis, index in enumerate((x, y, z)):
            if found == source or (axis == 2 and lattice.layer >= 0):
                finish[axis] = begin[axis]
            else:
                finish[axis] = index + 0.5
    voxels = extract_path(search, lattice, found, navigator.path)
    path = Path(navigator.path, voxels, begin, finish)
    count = string_pull(search, lattice, costs, path, waypoints)
    if count == 0:
        count = 1
        for axis in range(3):
            waypoints[0, axis] = finish[axis]
    last = waypoints[count - 1]
    if last[0] != finish[0] or last[1] != finish[1] or last[2] != finish[2]:
        code = _CORNERS
    return count, code
