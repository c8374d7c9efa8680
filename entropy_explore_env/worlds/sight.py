"""What a team can see from places that its bodies reach: beams pass gaps that bodies do not."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from scipy import ndimage

from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.settings.robot_kind import RobotKind
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.worlds.components import connected_components
from entropy_explore_env.worlds.shafts import (
    SINGLE,
    box_order,
    free_counts,
    narrow_blocks,
    new_blocks,
    places_in_blocks,
)
from entropy_explore_env.worlds.world import Collision, World

_BESIDE = 1.5
"""Voxel edges from what a body touches to the centre of the voxel beside it, diagonals included."""
_NEAR = 8.0
"""Distance, in voxel edges, up to which places are tried one by one; farther ones are ruled out in blocks."""
_AT_ONCE = 256
"""Number of voxels that are looked at in one compiled call: signals are handled between calls."""
_Starts = tuple[tuple[int, int, int], ...]
"""Voxels in which robots start."""


def visible_from(world: World, scenario: Scenario, poses: np.ndarray) -> np.ndarray:
    """Return which voxels of `World.visible` some robot can see from a place that it can reach.

    A free voxel is seen from a place if the line between their centres crosses free space only and is no
    longer than the sensor's range; a solid one if free ones beside it are seen. Where every free voxel is
    seen, that is `World.visible` itself.

    Args:
        world: The true world.
        scenario: The task.
        poses: (A, 5) poses where the robots start.

    Returns:
        (X, Y, Z) bool.
    """
    kinds = _starts_of_kinds(world, scenario, poses)
    return np.logical_or.reduce([_visible_to(world, scenario, *kind) for kind in kinds])


def driven_up_to(world: World, scenario: Scenario, poses: np.ndarray) -> np.ndarray:
    """Return which columns of voxels some robot can drive up to: what its body could touch, and one more.

    Args:
        world: The true world.
        scenario: The task.
        poses: (A, 5) poses where the robots start.

    Returns:
        (X, Y) bool.
    """
    columns = np.zeros(world.grid.shape[:2], np.bool_)
    for kind, starts in _starts_of_kinds(world, scenario, poses):
        passed = _reached_by(world, scenario, kind, starts).any(axis=2)
        body = kind.robot.body_radius_m / world.grid.voxel_size_m
        columns |= np.asarray(ndimage.distance_transform_edt(~passed)) <= body + _BESIDE
    return columns


def _starts_of_kinds(world: World, scenario: Scenario, poses: np.ndarray) -> list[tuple[RobotKind, _Starts]]:
    """Return each kind of robot of the team, with the voxels where its robots start."""
    voxels = np.floor((poses[:, :3] - world.grid.origin_m) / world.grid.voxel_size_m).astype(np.int64)
    voxels = np.clip(voxels, 0, np.array(world.grid.shape) - 1)
    kinds = scenario.kinds
    return [
        (kind, tuple((int(x), int(y), int(z)) for x, y, z in voxels[first :: len(kinds)]))
        for first, kind in enumerate(kinds)
    ]


@lru_cache(maxsize=8)
def _reached_by(world: World, scenario: Scenario, kind: RobotKind, starts: _Starts) -> np.ndarray:
    """Return (X, Y, Z) bool, where robots of a kind can be that start in some voxels; not to be changed."""
    fits = world.layout(scenario, kind).collision_mask == Collision.NONE
    layer = scenario.layer_of(kind.robot)
    if layer is not None:
        fits[:, :, :layer] = fits[:, :, layer + 1 :] = False
    labels, _ = connected_components(fits)
    own = {int(labels[x, y, z if layer is None else layer]) for x, y, z in starts} - {0}
    return np.isin(labels, list(own))


@lru_cache(maxsize=8)
def _visible_to(world: World, scenario: Scenario, kind: RobotKind, starts: _Starts) -> np.ndarray:
    """Return (X, Y, Z) bool, what robots of a kind can see that start in some voxels; not to be changed."""
    layout, reached = world.layout(scenario, kind), _reached_by(world, scenario, kind, starts)
    free = np.logical_not(world.occupied)
    seen = layout.visible & free
    left = np.argwhere(seen & ~reached)
    places = reached & ~np.asarray(ndimage.binary_erosion(reached), np.bool_)
    range_m = min(kind.sensor.max_range_m, float(np.linalg.norm(world.grid.size_m)))
    found = _are_visible(left, places, free, range_m / world.grid.voxel_size_m)
    if found.all():
        return layout.visible
    seen[tuple(left[~found].T)] = False
    if not kind.sensor.voxels_behind:
        return seen
    within = None if world.unreadable is None else ~world.unreadable
    behind = ndimage.binary_dilation(seen, iterations=kind.sensor.voxels_behind, mask=within)
    return layout.visible & (seen | (np.asarray(behind, np.bool_) & world.occupied))


def _are_visible(voxels: np.ndarray, places: np.ndarray, free: np.ndarray, range_: float) -> np.ndarray:
    """Return (N,) bool, which voxels (N, 3) are visible from some place, up to a range in voxel edges."""
    found, steps = np.zeros(len(voxels), np.bool_), _steps(min(range_, _NEAR), free.shape)
    for first in range(0, len(voxels), _AT_ONCE):
        _look(voxels[first : first + _AT_ONCE], places, free, steps, found[first : first + _AT_ONCE])
    hidden = np.flatnonzero(~found)
    if range_ <= _NEAR or not len(hidden) or not places.any():
        return found
    hidden = hidden[box_order(voxels[hidden])]
    far, from_places, counts = voxels[hidden], places_in_blocks(places), free_counts(free)
    blocks, seen = new_blocks(from_places), np.zeros(len(hidden), np.bool_)
    for first in range(0, len(hidden), _AT_ONCE):
        last = min(first + _AT_ONCE, len(hidden))
        _look_far(far, first, last, from_places, free, counts, range_**2 + 1e-9, blocks, seen)
    found[hidden] = seen
    return found


@lru_cache(maxsize=8)
def _steps(range_: float, shape: tuple[int, int, int]) -> np.ndarray:
    """Return (N, 3) int16, all steps in a grid that are at most so long, in voxels, the shortest first."""
    farthest = [min(math.floor(range_ + 1e-9), edge - 1) for edge in shape]
    along = [np.arange(-far, far + 1) for far in farthest]
    steps = np.stack(np.meshgrid(*along, indexing="ij"), axis=-1).reshape(-1, 3)
    squared = (steps.astype(np.int64) ** 2).sum(axis=1)
    order = np.argsort(squared, kind="stable")
    return steps[order[squared[order] <= range_**2 + 1e-9]].astype(np.int16)


@lean_kernel
def _look(left, places, free, steps, found):
    """Note which voxels can be seen from some place.

    Args:
        left: (N, 3) int64, the voxels.
        places: (X, Y, Z) bool, where sensors can be.
        free: (X, Y, Z) bool.
        steps: (M, 3) int16, from a voxel to places within range, the nearest first.
        found: (N,) bool; filled.
    """
    for n in range(len(left)):
        voxel = left[n, 0], left[n, 1], left[n, 2]
        for m in range(len(steps)):
            step = np.int64(steps[m, 0]), np.int64(steps[m, 1]), np.int64(steps[m, 2])
            x, y, z = voxel[0] + step[0], voxel[1] + step[1], voxel[2] + step[2]
            if not (0 <= x < free.shape[0] and 0 <= y < free.shape[1] and 0 <= z < free.shape[2]):
                continue
            if places[x, y, z] and _is_open(free, voxel, step):
                found[n] = True
                break


@lean_kernel
def _look_far(voxels, first, last, places, free, counts, squared_range, blocks, found):
    """Note which voxels can be seen from some of `Places`, however far away.

    Args:
        voxels: (N, 3) int64, in the order of `box_order`.
        first: Number of the first one that is looked at; those before it have been.
        last: One past the last one.
        places: Places.
        free: (X, Y, Z) bool.
        counts: Of them: see `free_counts`.
        squared_range: Square of the range, in voxel edges.
        blocks: Blocks.
        found: (N,) bool; filled.
    """
    latest = 0  # a place from which one voxel is visible often shows the next one, too
    for n in range(first, last):
        if _is_seen(voxels[n], places.voxels[latest], free, squared_range):
            found[n] = True
            continue
        narrow_blocks(counts, places, squared_range, voxels, n, blocks)
        for number in range(blocks.count[SINGLE]):
            block = blocks.left[SINGLE, number]
            for m in range(places.first[block], places.first[block + 1]):
                if _is_seen(voxels[n], places.voxels[m], free, squared_range):
                    found[n], latest = True, m
                    break
            if found[n]:
                break


@lean_kernel
def _is_seen(voxel, place, free, squared_range):
    """Return whether a voxel (3,) is visible from a place (3,) and within range."""
    step = place[0] - voxel[0], place[1] - voxel[1], place[2] - voxel[2]
    squared = step[0] * step[0] + step[1] * step[1] + step[2] * step[2]
    return squared <= squared_range and _is_open(free, (voxel[0], voxel[1], voxel[2]), step)


@lean_kernel
def _is_open(free, start, step):
    """Return whether the line from a voxel's centre to that of one a step away crosses free voxels only.

    Crossing times of the faces along axis i are (2 k + 1)/(2 |step_i|), k = 0, 1, …; they are compared as
    whole numbers, and faces that are crossed together are crossed at once.
    """
    a, b, c = abs(step[0]), abs(step[1]), abs(step[2])
    i = j = k = np.int64(0)
    while i < a or j < b or k < c:
        tx = (2 * i + 1) * max(b, 1) * max(c, 1) if i < a else np.int64(1 << 62)
        ty = (2 * j + 1) * max(a, 1) * max(c, 1) if j < b else np.int64(1 << 62)
        tz = (2 * k + 1) * max(a, 1) * max(b, 1) if k < c else np.int64(1 << 62)
        first = min(tx, ty, tz)
        i += np.int64(tx == first)
        j += np.int64(ty == first)
        k += np.int64(tz == first)
        x = start[0] + (i if step[0] > 0 else -i)
        y = start[1] + (j if step[1] > 0 else -j)
        z = start[2] + (k if step[2] > 0 else -k)
        if not free[x, y, z]:
            return False
    return True
