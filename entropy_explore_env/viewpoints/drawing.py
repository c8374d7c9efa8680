"""Random viewpoints: anywhere within reach, in grid units or in the map frame."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from entropy_explore_env.settings import Grid, Robot

_DRAWS = 64
"""Places that are drawn until one lies within reach."""


class Surroundings(NamedTuple):
    """Where places near a robot are drawn, in grid units."""

    axes: int
    """2 for planar robots, else 3."""
    reach: float
    """Largest distance, voxel edges."""
    last: np.ndarray
    """(axes,) the last place along each axis; the first is ½."""


def surroundings(grid: Grid, robot: Robot, planar: bool) -> Surroundings:
    """Places within a robot's reach, or within a quarter of the workspace if that is less."""
    axes = 2 if planar else 3
    reach = min(robot.reach_m / grid.voxel_size_m, 0.25 * float(max(grid.shape)))
    return Surroundings(axes, reach, np.asarray(grid.shape[:axes]) - 0.5)


def draw_gazes(here: np.ndarray, count: int, level: bool, rng: np.random.Generator) -> np.ndarray:
    """(K, 5) viewpoints at one place (5,) with random gazes, on the level or anywhere."""
    drawn = np.tile(here, (count, 1))
    drawn[:, 3] = rng.uniform(-math.pi, math.pi, count)
    drawn[:, 4] = 0.0 if level else np.arcsin(rng.uniform(-1.0, 1.0, count))
    return drawn


def draw_places(here: np.ndarray, count: int, within: Surroundings, rng: np.random.Generator) -> np.ndarray:
    """(K, axes) places, uniform in the ball within reach, clipped to the workspace."""
    axes = within.axes
    step = rng.normal(size=(count, axes))
    length = within.reach * rng.uniform(size=count) ** (1 / axes)
    step *= (length / np.linalg.norm(step, axis=1))[:, None]
    return np.clip(here[:axes] + step, 0.5, within.last)


def vary_gazes(viewpoints: np.ndarray, spread: float, level: bool, rng: np.random.Generator) -> None:
    """Turn (K, 5) viewpoints by normal errors of this many radians, in place."""
    viewpoints[:, 3] += spread * rng.normal(size=len(viewpoints))
    viewpoints[:, 3] = (viewpoints[:, 3] + math.pi) % (2.0 * math.pi) - math.pi
    if not level:
        tilted = viewpoints[:, 4] + spread * rng.normal(size=len(viewpoints))
        viewpoints[:, 4] = np.clip(tilted, -0.5 * math.pi, 0.5 * math.pi)


def vary_places(
    viewpoints: np.ndarray, here: np.ndarray, within: Surroundings, rng: np.random.Generator
) -> None:
    """Shift (K, 5) viewpoints by normal errors of a quarter of the reach, in place; none leaves the reach.

    Those at the robot's own place stay there.
    """
    axes = within.axes
    step = viewpoints[:, :axes] - here[:axes]
    moved = np.linalg.norm(step, axis=1) > 0.0
    step[moved] += 0.25 * within.reach * rng.normal(size=(int(moved.sum()), axes))
    length = np.maximum(np.linalg.norm(step, axis=1) / within.reach, 1.0)
    viewpoints[:, :axes] = np.clip(here[:axes] + step / length[:, None], 0.5, within.last)


def uniform_viewpoint(
    grid: Grid, reach_m: float, pose: np.ndarray, planar: bool, level: bool, rng: np.random.Generator
) -> np.ndarray:
    """A viewpoint drawn uniformly within reach, inside the workspace; the gaze in any direction.

    Args:
        grid: The workspace.
        reach_m: Largest distance of the viewpoint; inf allowed.
        pose: (5,) of the robot, map frame.
        planar: Whether the robot stays in its plane.
        level: Whether it looks level.
        rng: To draw from.

    Returns:
        (5,) viewpoint, map frame.
    """
    low = np.asarray(grid.origin_m)
    high = low + grid.size_m
    axes = 2 if planar else 3
    viewpoint = pose.copy()
    here = pose[:axes]
    if math.isinf(reach_m):  # actions reach from the centre of the first voxel to that of the last
        low, high = low + 0.5 * grid.voxel_size_m, high - 0.5 * grid.voxel_size_m
    lowest, highest = np.maximum(low[:axes], here - reach_m), np.minimum(high[:axes], here + reach_m)
    for _ in range(_DRAWS):
        place = rng.uniform(lowest, highest)
        if ((place - here) ** 2).sum() <= reach_m**2:
            viewpoint[:axes] = place
            break
    viewpoint[3] = rng.uniform(-math.pi, math.pi)
    viewpoint[4] = 0.0 if level else math.asin(rng.uniform(-1.0, 1.0))
    return viewpoint
