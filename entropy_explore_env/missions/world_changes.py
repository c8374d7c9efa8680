"""Worlds that change under way: a door that closes, a crate that is taken away.

The truth and what is in the way of bodies change; what robots believe does not, until they look again. What
can be seen, and so what ends a mission by what was seen, stays what it was at the start.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from entropy_explore_env.errors import SettingError
from entropy_explore_env.missions.rules import Rules
from entropy_explore_env.missions.state import MissionState
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.validation import is_number
from entropy_explore_env.worlds.world import World


class WorldChange(NamedTuple):
    """A block of voxels that becomes solid or free."""

    low: tuple[int, ...]
    """Indices (x, y, z) of the first voxel."""
    high: tuple[int, ...]
    """One past those of the last."""
    solid: bool
    at_s: float
    """When, in simulated time."""

    @property
    def block(self) -> tuple[slice, ...]:
        """The block as an index of arrays (X, Y, Z)."""
        return tuple(slice(first, end) for first, end in zip(self.low, self.high, strict=True))


def checked_change(
    grid: Grid, low_m: Sequence[float], high_m: Sequence[float], solid: bool, at_s: float
) -> WorldChange:
    """Return a change of the voxels whose centres lie in a box.

    Raises:
        SettingError: A corner is not three finite numbers, `solid` is not a bool, or the box holds no centre
            of a voxel.
    """
    for name, corner in (("low_m", low_m), ("high_m", high_m)):
        given = corner if isinstance(corner, tuple | list | np.ndarray) else ()
        if len(given) != 3 or not all(is_number(v) and math.isfinite(v) for v in given):
            raise SettingError(name, corner, "three finite numbers (x, y, z), metres")
    if not isinstance(solid, bool):
        raise SettingError("solid", solid, "True or False")
    origin, edge_m = np.asarray(grid.origin_m), grid.voxel_size_m
    low = np.ceil((np.asarray(low_m) - origin) / edge_m - 0.5 - 1e-9)
    high = np.floor((np.asarray(high_m) - origin) / edge_m - 0.5 + 1e-9) + 1.0
    low, high = (np.clip(corner, 0.0, grid.shape).astype(np.int64) for corner in (low, high))
    if (low >= high).any():
        end = origin + grid.size_m
        allowed = f"a box with centres of voxels, inside {origin.tolist()} to {end.tolist()} m"
        raise SettingError("low_m, high_m", (tuple(low_m), tuple(high_m)), allowed)
    return WorldChange(tuple(low.tolist()), tuple(high.tolist()), solid, at_s)


def changed_world(world: World, change: WorldChange) -> World:
    """Return the world after a change."""
    occupied = world.occupied.copy()
    occupied[change.block] = change.solid
    masks = {}
    for name in ("unknown", "unreadable"):
        mask = getattr(world, name)
        if mask is not None:
            masks[name] = mask.copy()
            masks[name][change.block] = False
    return dataclasses.replace(world, occupied=occupied, **masks)


def robot_in_the_way(rules: Rules, state: MissionState, mission: int, change: WorldChange) -> int | None:
    """Return the first robot whose body, or the drive that it is on, touches a block; None = none does."""
    if not change.solid:
        return None
    for number, robot in enumerate(state.robots[mission]):
        params = rules.params[number]
        edge_m, origin = float(params["voxel_size_m"]), params["origin_m"]
        low, high = origin + np.array(change.low) * edge_m, origin + np.array(change.high) * edge_m
        corners = robot["path"][: robot["corners"]]
        points = np.vstack([robot["origin"][None, :3], corners, robot["goal"][None, :3]])
        if robot["deciding"] and not robot["under_way"]:
            points = np.vstack([points[-1:], points[-1:]])
        apart_m = params["body_radius_m"] + edge_m
        for begin, end in pairwise(points):
            steps = max(int(2.0 * np.linalg.norm(end - begin) / edge_m), 1)
            places = begin + np.linspace(0.0, 1.0, steps + 1)[:, None] * (end - begin)
            outside = np.maximum(np.maximum(low - places, places - high), 0.0)
            if (np.linalg.norm(outside, axis=1) < apart_m).any():
                return number
    return None


def rescore(state: MissionState, mission: int, before: np.ndarray, after: np.ndarray, prior: float) -> int:
    """Bring the figures of the joint map up to date with a truth (V,) that has changed.

    Returns:
        Change in the number of visible free voxels.
    """
    if not state.joint_mean.shape[1]:
        return 0
    voxels = np.flatnonzero(before != after)
    mean, visible = state.joint_mean[mission, voxels], state.visible[mission, voxels]
    measured, clock = state.joint_precision[mission, voxels] > np.float32(prior), state.missions[mission]
    was, now = np.minimum(before[voxels], 1.0), np.minimum(after[voxels], 1.0)
    clock["error"] += float((np.abs(mean - now) - np.abs(mean - was))[measured].sum())
    wrong = ((mean > 0.5) != (now > 0.5)).astype(int) - ((mean > 0.5) != (was > 0.5))
    clock["wrong"] += int(wrong[measured].sum())
    freed = (now <= 0.5).astype(int) - (was <= 0.5)
    more = int(freed[visible].sum())
    clock["visible_free"] += more
    clock["explored_free"] += int(freed[visible & measured].sum())
    return more
