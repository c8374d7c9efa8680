"""Random viewpoints anywhere within reach, in the map frame."""

from __future__ import annotations

import math

import numpy as np

from entropy_explore_env.settings import Grid

_DRAWS = 64
"""Places that are drawn until one lies within reach."""


def uniform_viewpoint(
    grid: Grid, reach_m: float, pose: np.ndarray, planar: bool, level: bool, rng: np.random.Generator
) -> np.ndarray:
    """Return a viewpoint drawn uniformly within reach, inside the workspace; the gaze in any direction.

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
