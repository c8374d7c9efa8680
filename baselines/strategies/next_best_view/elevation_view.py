"""What a camera over an elevation map is expected to show, and what it is worth (Sujan, eqs. 3 and 5).

Eq. 5 as printed, sgn(x)·∫₀ˣ + ½ with x = ray_z - Ob_z, is above ½ for rays below an obstacle, too: its
integral ends at |x|. So the factor is Φ(x/σ), the probability that the obstacle is lower than the ray. Of
eq. 3's braces the entropy of P_V/2 is meant: -(p log2 p + (1 - p) log2(1 - p)). Lengths are in voxel edges.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from entropy_explore_env.compilation.kernels import inlined_kernel, lean_kernel

_CLEAR = 4.0
"""Standard deviations above an obstacle from which on a ray passes it for sure."""
_HIDDEN = 1e-3
"""Columns that are less likely to be seen than this count as hidden."""


class Ground(NamedTuple):
    """A robot's elevation map for compiled code."""

    height: np.ndarray
    """(X, Y) float64 above the workspace's floor, completed."""
    sigma: np.ndarray
    """(X, Y) float64 > 0."""
    measurements: np.ndarray
    """(X, Y) float64, n_grid of eq. 3; 0 = not known."""
    interest: np.ndarray
    """(X, Y) float64, eq. 9."""


class Camera(NamedTuple):
    """The view of a range sensor for compiled code."""

    half_yaw: float
    half_pitch: float
    reach: float
    """Voxel edges; inf allowed."""


@inlined_kernel
def normal_share(x):
    """Return Φ(x) to 1e-7, by Abramowitz & Stegun 1964, eq. 26.2.17: faster than by `erfc`."""
    t = 1.0 / (1.0 + 0.2316419 * abs(x))
    tail = t * (0.319381530 + t * (-0.356563782 + t * (1.781477937 + t * (-1.821255978 + t * 1.330274429))))
    tail *= math.exp(-0.5 * x * x) * 0.3989422804014327
    return 1.0 - tail if x > 0.0 else tail


@lean_kernel
def visibility(ground, camera, x, y):
    """Return P_V of eq. 5: the probability that no column on the line to a camera hides the top of a column.

    The ray's height above a column is that in the middle of its way over it. The column itself, and the
    camera's, hide nothing.

    Args:
        ground: Ground.
        camera: (x, y, z) of the camera.
        x: The column.
        y: The column.
    """
    columns_x, columns_y = ground.height.shape
    at_x, at_y, at_z = x + 0.5, y + 0.5, ground.height[x, y]
    along_x, along_y, rise = camera[0] - at_x, camera[1] - at_y, camera[2] - at_z
    step_x, step_y = 1 if along_x > 0.0 else -1, 1 if along_y > 0.0 else -1
    share_x = 1.0 / abs(along_x) if along_x != 0.0 else math.inf  # of the line, for each column crossed
    share_y = 1.0 / abs(along_y) if along_y != 0.0 else math.inf
    next_x, next_y = 0.5 * share_x, 0.5 * share_y
    entered = min(next_x, next_y)
    seen, i, j = 1.0, x, y
    while entered < 1.0:
        if next_x <= next_y:
            i += step_x
            next_x += share_x
        else:
            j += step_y
            next_y += share_y
        left = min(next_x, next_y)
        if left >= 1.0 or not (0 <= i < columns_x and 0 <= j < columns_y):
            break
        above = at_z + 0.5 * (entered + left) * rise - ground.height[i, j]
        entered = left
        if above < _CLEAR * ground.sigma[i, j]:
            seen *= normal_share(above / ground.sigma[i, j])
            if seen < _HIDDEN:
                return 0.0
    return seen


class View(NamedTuple):
    """What a camera sees from one pose, without occlusions; slopes are those of lines downwards."""

    gaze_x: float
    gaze_y: float
    cos_half_yaw: float
    low_slope: float
    high_slope: float
    square_reach: float


@inlined_kernel
def view_from(camera, pose):
    """Return the View of a camera from a pose (5,)."""
    low, high = pose[4] - camera.half_pitch, pose[4] + camera.half_pitch
    return View(
        math.cos(pose[3]),
        math.sin(pose[3]),
        math.cos(min(camera.half_yaw, math.pi)),
        math.tan(low) if low > -0.5 * math.pi else -math.inf,
        math.tan(high) if high < 0.5 * math.pi else math.inf,
        camera.reach * camera.reach,
    )


@inlined_kernel
def in_view(view, pose, x, y, z):
    """Return whether a point lies in a View from a pose: in its yaw, pitch and reach, not straight below."""
    along_x, along_y, below = x - pose[0], y - pose[1], pose[2] - z
    square = along_x * along_x + along_y * along_y
    if square + below * below > view.square_reach or square == 0.0:
        return False
    level = math.sqrt(square)
    if along_x * view.gaze_x + along_y * view.gaze_y < view.cos_half_yaw * level:
        return False
    return view.low_slope * level <= below <= view.high_slope * level


@inlined_kernel
def column_bits(seen):
    """Return the entropy of P_V/2 in bits, 0 for P_V = 0 and 1 for P_V = 1."""
    p = 0.5 * seen
    return 0.0 if p <= 0.0 else -(p * math.log2(p) + (1.0 - p) * math.log2(1.0 - p))


@lean_kernel
def fill_new_information(ground, camera, most, poses, bits):
    """Fill in NI of eq. 3 for each of K poses, each column weighed by the interest in it.

    Args:
        ground: Ground.
        camera: Camera.
        most: n_max, measurements of a column from which on nothing more is learned.
        poses: (K, 5) float64: x, y, z in voxel edges, yaw, pitch.
        bits: (K,) float64, filled in.
    """
    columns_x, columns_y = ground.height.shape
    for k in range(len(poses)):
        pose, total = poses[k], 0.0
        view = view_from(camera, pose)
        low_x, high_x = _span(pose[0], camera.reach, columns_x)
        low_y, high_y = _span(pose[1], camera.reach, columns_y)
        for x in range(low_x, high_x):
            for y in range(low_y, high_y):
                missing = (most - ground.measurements[x, y]) * ground.interest[x, y] / most
                if missing > 0.0 and in_view(view, pose, x + 0.5, y + 0.5, ground.height[x, y]):
                    total += missing * column_bits(visibility(ground, (pose[0], pose[1], pose[2]), x, y))
        bits[k] = total


@lean_kernel
def fill_visibility(ground, camera, pose, seen):
    """Fill (X, Y) float64 `seen` with P_V of every column from one pose (5,), 0 outside the view."""
    view = view_from(camera, pose)
    seen[:] = 0.0
    low_x, high_x = _span(pose[0], camera.reach, seen.shape[0])
    low_y, high_y = _span(pose[1], camera.reach, seen.shape[1])
    for x in range(low_x, high_x):
        for y in range(low_y, high_y):
            if in_view(view, pose, x + 0.5, y + 0.5, ground.height[x, y]):
                seen[x, y] = visibility(ground, (pose[0], pose[1], pose[2]), x, y)


@inlined_kernel
def _span(middle, reach, most):
    """Return the first, and one past the last, of the columns along an axis that can be in reach."""
    if math.isinf(reach):
        return 0, most
    return max(math.floor(middle - reach), 0), min(math.floor(middle + reach) + 1, most)
