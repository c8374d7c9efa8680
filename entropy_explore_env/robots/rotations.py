"""Rotations: yaw and pitch as unit vectors, quaternions and matrices, and frames that are turned about z.

Angles are in radians, pitch downwards (REP-103); quaternions are (x, y, z, w).
"""

from __future__ import annotations

import math

import numpy as np


def directions_of(yaw: float | np.ndarray, pitch: float | np.ndarray) -> np.ndarray:
    """Return the unit vectors (..., 3) of gazes, whose yaws and pitches are broadcast."""
    level = np.cos(pitch)
    axes = np.broadcast_arrays(np.cos(yaw) * level, np.sin(yaw) * level, -np.sin(pitch))
    return np.stack(axes, axis=-1)


def ray_directions(
    yaw_offsets: np.ndarray, pitch_offsets: np.ndarray, yaw: float, pitch: float
) -> np.ndarray:
    """Return the unit vectors (R, 3) of a sensor's rays around a gaze, column by column, top row first."""
    yaws = np.repeat(yaw + yaw_offsets, len(pitch_offsets))
    pitches = np.tile(pitch + pitch_offsets, len(yaw_offsets))
    return directions_of(yaws, pitches)


def quaternion_of(yaw: float, pitch: float = 0.0) -> tuple[float, float, float, float]:
    """Return the quaternion of a gaze: pitch about y, then yaw about z."""
    sin_yaw, cos_yaw = math.sin(0.5 * yaw), math.cos(0.5 * yaw)
    sin_pitch, cos_pitch = math.sin(0.5 * pitch), math.cos(0.5 * pitch)
    return -sin_yaw * sin_pitch, cos_yaw * sin_pitch, sin_yaw * cos_pitch, cos_yaw * cos_pitch


def gaze_matrix(yaw: float, pitch: float) -> np.ndarray:
    """Return the matrix (3, 3) that turns vectors of a gaze's frame into the map frame."""
    about_z = np.array([[math.cos(yaw), -math.sin(yaw), 0.0], [math.sin(yaw), math.cos(yaw), 0.0], [0, 0, 1]])
    about_y = np.array(
        [[math.cos(pitch), 0.0, math.sin(pitch)], [0, 1, 0], [-math.sin(pitch), 0.0, math.cos(pitch)]]
    )
    return np.asarray(about_z @ about_y)


def quaternion_matrix(x: float, y: float, z: float, w: float) -> np.ndarray:
    """Return the matrix (3, 3) of a unit quaternion."""
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def gaze_of(matrix: np.ndarray) -> tuple[float, float]:
    """Return yaw and pitch of a frame, from the matrix that leads out of it; roll is left out."""
    yaw = math.atan2(matrix[1, 0], matrix[0, 0])
    return yaw, math.asin(min(max(-float(matrix[2, 0]), -1.0), 1.0))


def turned_by(poses: np.ndarray, yaw_rad: float) -> np.ndarray:
    """Return places (..., 3), or poses (..., 5), turned by `yaw_rad` about the origin."""
    turned = np.array(poses, np.float64)
    if yaw_rad == 0.0:
        return turned
    along, across = math.cos(yaw_rad), math.sin(yaw_rad)
    turned[..., 0] = along * poses[..., 0] - across * poses[..., 1]
    turned[..., 1] = across * poses[..., 0] + along * poses[..., 1]
    if turned.shape[-1] == 5:
        turned[..., 3] = (poses[..., 3] + yaw_rad + math.pi) % (2.0 * math.pi) - math.pi
    return turned
