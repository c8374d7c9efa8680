"""The navigator: from where a robot is to where it wants to be, through what it believes, in grid units.

The way is the cheapest one by steps between voxel centres (`planning`), pulled straight. Where none is
known it leads as near to the goal as one is known to lead.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from entropy_explore_env.belief.paths.lattice import KNOWN_RATIO, Costs, Lattice, new_lattice, place_of
from entropy_explore_env.belief.paths.planning import search_ways
from entropy_explore_env.belief.paths.search import (
    Search,
    cost_to,
    is_passable,
    mark_of,
    new_search,
    way_to,
)
from entropy_explore_env.belief.paths.string_pulling import cost_of_sight, pull_straight
from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.robots.motion import MoveEnd
from entropy_explore_env.scenario import Scenario
from entropy_explore_env.settings import Robot

_ARRIVED, _NO_PATH, _CORNERS = MoveEnd.ARRIVED.code, MoveEnd.NO_PATH.code, MoveEnd.CORNERS.code
_SLACK = 1e-9
_PASSABLE, _REACHED = np.int64(0), np.int64(1)
"""Which voxels `_nearest` may choose. NumPy integers, so that it compiles for one type."""


class Navigator(NamedTuple):
    """Working space of plans, for one thread. Its memory is taken where plans come to."""

    search: Search
    lattice: Lattice
    known_precision: float
    unknown_cost: float
    source: np.ndarray
    """(1,) int32, the voxel in which a way begins."""
    no_cells: np.ndarray
    """(0,) int32."""
    way: np.ndarray
    """(V,) int32, voxels on the way."""
    ends: np.ndarray
    """(2, 3) float64, start and finish of the way."""


def lattice_of(scenario: Scenario, robot: Robot) -> Lattice:
    """Steps of a kind of robot between voxel centres."""
    radius = robot.body_radius_m / scenario.grid.voxel_size_m
    return new_lattice(scenario.grid.shape, radius, scenario.layer_of(robot))


def new_navigators(scenario: Scenario) -> dict[int, Navigator]:
    """Working space for the plans of each kind of robot that plans, by its number.

    They share all that is as large as the map, so they may not be used at once.
    """
    planning = {n: kind.robot for n, kind in enumerate(scenario.kinds) if kind.robot.navigator == "planned"}
    navigators: dict[int, Navigator] = {}
    first: Navigator | None = None
    for number, robot in planning.items():
        if first is None:
            first = navigators[number] = new_navigator(scenario, robot)
        else:
            lattice, cost = lattice_of(scenario, robot), float(robot.unknown_cost)
            navigators[number] = first._replace(lattice=lattice, unknown_cost=cost)
    return navigators


def touched_voxels(navigators: Mapping[int, Navigator], kinds: int) -> np.ndarray:
    """(K, B, 3) int64, what bodies of each kind touch, by axis; their own voxel fills up."""
    touched = {kind: navigator.lattice.touched for kind, navigator in navigators.items()}
    balls = np.zeros((kinds, max(len(each) for each in touched.values()), 3), np.int64)
    for kind, each in touched.items():
        balls[kind, : len(each)] = each
    return balls


def new_navigator(scenario: Scenario, robot: Robot) -> Navigator:
    """Working space for the plans of one kind of robot."""
    prior_precision = float(np.float32(scenario.sigma_prior**-2))
    return Navigator(
        search=new_search(scenario.grid.voxels),
        lattice=lattice_of(scenario, robot),
        known_precision=KNOWN_RATIO * prior_precision,
        unknown_cost=float(robot.unknown_cost),
        source=np.zeros(1, np.int32),
        no_cells=np.zeros(0, np.int32),
        way=np.empty(scenario.grid.voxels, np.int32),
        ends=np.zeros((2, 3)),
    )


@lean_kernel
def _voxel_at(lattice, position):
    """Number of the voxel that holds a position, or that is nearest to it; planar: in the layer."""
    voxel = 0
    for axis in range(3):
        index = min(max(math.floor(position[axis]), 0), lattice.size[axis] - 1)
        if axis == 2 and lattice.layer >= 0:
            index = lattice.layer
        voxel = voxel * lattice.size[axis] + index
    return voxel


@lean_kernel
def _nearest(search, lattice, costs, goal, start, choice):
    """The voxel nearest to a goal of those that the latest search reached, or of all passable ones.

    Looked for in growing shells around the goal; of equals the first. The start is one, whatever it is.
    """
    size, layer = lattice.size, lattice.layer
    x, y, z = place_of(lattice, goal)
    i, j, k = place_of(lattice, start)
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
                    voxel = (i * size[1] + j) * size[2] + k
                    if choice == _REACHED:
                        found = not math.isinf(cost_to(search, voxel))
                    else:
                        found = is_passable(mark_of(search, lattice, costs, voxel, i, j, k))
                    if found:
                        best, nearest = voxel, apart
        shell += 1
    return best


@lean_kernel
def _search_way(navigator, costs, source, goal):
    """Search the way to a voxel or, where none is known, to the nearest one; returns where it leads."""
    search, lattice = navigator.search, navigator.lattice
    cost = search_ways(search, lattice, costs, navigator.source, goal, math.inf, navigator.no_cells)
    if not math.isinf(cost):
        return goal
    x, y, z = place_of(lattice, goal)
    if not is_passable(mark_of(search, lattice, costs, goal, x, y, z)):  # then nothing was searched
        near = _nearest(search, lattice, costs, goal, source, _PASSABLE)
        cost = search_ways(search, lattice, costs, navigator.source, near, math.inf, navigator.no_cells)
        if not math.isinf(cost):
            return near
    return _nearest(search, lattice, costs, goal, source, _REACHED)


@lean_kernel
def find_way(navigator, mean, precision, closed, start, goal, waypoints):
    """Fill in the points to which a robot has to drive straight, one after the other.

    Args:
        navigator: Working space.
        mean: (V,) float32, the robot's expected coverage.
        precision: (V,) float32, 1/σ² of it.
        closed: (V,) bool, where the body would reach above the ceiling; (0,) = there is none.
        start: (x, y, z), inside the workspace.
        goal: (x, y, z), anywhere.
        waypoints: (W, 3) float64, filled in; the start is none of them.

    Returns:
        (count, code): how many there are, at least one, and how the drive ends if nothing stops it:
        the code of ARRIVED, NO_PATH or CORNERS (the way needs more than W).
    """
    search, lattice = navigator.search, navigator.lattice
    costs = Costs(mean, precision, navigator.known_precision, navigator.unknown_cost, mean[:0], 1.0, closed)
    begin, finish = navigator.ends[0], navigator.ends[1]
    inside, length = True, 0.0
    for axis in range(3):
        begin[axis], finish[axis] = start[axis], goal[axis]
        inside = inside and 0.0 <= goal[axis] <= lattice.size[axis]
        length += (goal[axis] - start[axis]) ** 2
    source, wanted = _voxel_at(lattice, begin), _voxel_at(lattice, finish)
    navigator.source[0] = source
    if inside:  # straight through known free space there is nothing to search
        search_ways(search, lattice, costs, navigator.source, source, 0.0, navigator.no_cells)
        sight = cost_of_sight(
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
    found = _search_way(navigator, costs, source, wanted)
    if found != wanted or not inside:
        code = _NO_PATH
        x, y, z = place_of(lattice, found)
        for axis, index in enumerate((x, y, z)):
            if found == source or (axis == 2 and lattice.layer >= 0):
                finish[axis] = begin[axis]
            else:
                finish[axis] = index + 0.5
    voxels = way_to(search, lattice, found, navigator.way)
    count = pull_straight(search, lattice, costs, navigator.way, voxels, begin, finish, waypoints)
    if count == 0:
        count = 1
        for axis in range(3):
            waypoints[0, axis] = finish[axis]
    last = waypoints[count - 1]
    if last[0] != finish[0] or last[1] != finish[1] or last[2] != finish[2]:
        code = _CORNERS
    return count, code
