"""Fields of ROS's messages as arrays and poses; any class that has the fields will do.

A pose here is (x, y, z, yaw, pitch): metres, radians, pitch downwards, as everywhere in the library.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from entropy_explore_env.errors import SettingError
from entropy_explore_env.robots.rotations import gaze_of, quaternion_matrix
from entropy_explore_env.worlds.files.octomap_tree import leaves_of, own_labels, without_colours
from entropy_explore_env.worlds.files.voxels import FREE, SOLID, RefusedError

ARROW_M = (0.6, 0.12, 0.12)
"""Length, width and height of the arrow at a robot's goal."""
_MOST_VOXELS = 1 << 27
"""A tree may say that a few bytes fill the world."""
_LEVEL = 1.0 - 1e-6
"""Least cosine between the vertical axes of a map that lies level and of its frame."""


class GridMessage(NamedTuple):
    """An OccupancyGrid."""

    grid: np.ndarray
    """(X, Y) int8 percent; -1 = unknown."""
    origin: tuple[float, float, float]
    """Its corner: x, y, yaw."""
    resolution_m: float
    bottom_m: float
    """Height z of its corner."""


def grid_of_message(message: Any) -> GridMessage:  # noqa: ANN401 - any class with the fields
    """Return the content of an OccupancyGrid, whose rows run along x.

    Raises:
        SettingError: It lacks a field, its data do not fit its size, or it does not lie level.
    """
    try:
        about, rows = message.info, np.asarray(message.data)
        width, height, at = int(about.width), int(about.height), about.origin
        turn = (at.orientation.x, at.orientation.y, at.orientation.z, at.orientation.w)
        corner = (float(at.position.x), float(at.position.y), float(at.position.z))
        resolution_m = float(about.resolution)
    except (AttributeError, TypeError, ValueError):
        raise SettingError("message", type(message).__name__, "a nav_msgs/OccupancyGrid") from None
    if width * height < 1 or rows.shape != (width * height,):
        raise SettingError("message.data", rows.shape, f"{width} × {height} numbers, as info says")
    if not lies_level(quaternion_matrix(*map(float, turn))):
        raise SettingError("message.info.origin", turn, "an orientation about z alone")
    grid = np.ascontiguousarray(rows.astype(np.int8, copy=False).reshape(height, width).T)
    yaw = 2.0 * math.atan2(float(turn[2]), float(turn[3]))
    return GridMessage(grid, (corner[0], corner[1], yaw), resolution_m, corner[2])


def lies_level(rotation: np.ndarray) -> bool:
    """Return whether a rotation (3, 3) turns about the vertical axis alone."""
    return bool(rotation[2, 2] >= _LEVEL)


def voxels_of_tree(data: bytes, binary: bool, kind: str = "OcTree") -> tuple[np.ndarray, np.ndarray]:
    """Return the labels (X, Y, Z) int8 of an Octomap's box, and its lower corner (3,) in voxels.

    Args:
        data: The nodes.
        binary: Whether each of them is two bits.
        kind: The tree's id.

    Raises:
        SettingError: Trees of this kind are not read, the bytes end too early, the tree is too deep, or its
            box has too many voxels.
    """
    try:
        leaves, _ = leaves_of(data if binary else without_colours(data, kind.encode()), binary)
    except RefusedError as error:
        raise SettingError("octomap.data", f"{len(data)} bytes", str(error)) from None
    low, high = leaves.box
    x, y, z = (high - low).tolist()
    if x * y * z > _MOST_VOXELS:
        raise SettingError("octomap.data", [x, y, z], f"a box of at most {_MOST_VOXELS} voxels")
    return own_labels(leaves._replace(corner=leaves.corner - low), (x, y, z)), low


def percent_of(labels: np.ndarray) -> np.ndarray:
    """Return what an OccupancyGrid holds for labels of voxels (...): int8 percent, -1 = unknown."""
    return np.select([labels == FREE, labels == SOLID], [0, 100], -1).astype(np.int8)


def pose_of(position: Any, orientation: Any) -> np.ndarray:  # noqa: ANN401
    """Return the pose (5,) of a position and a quaternion; roll is left out."""
    return pose_of_matrix(matrix_of(position, orientation))


def matrix_of(position: Any, orientation: Any) -> np.ndarray:  # noqa: ANN401
    """Return the matrix (4, 4) from a frame to its parent, in which it has a position and a quaternion."""
    matrix = np.eye(4)
    matrix[:3, :3] = quaternion_matrix(*(float(getattr(orientation, axis)) for axis in "xyzw"))
    matrix[:3, 3] = float(position.x), float(position.y), float(position.z)
    return matrix


def pose_of_matrix(matrix: np.ndarray) -> np.ndarray:
    """Return the pose (5,) of a frame, from its matrix (4, 4) to the map frame; roll is left out."""
    return np.array([*matrix[:3, 3], *gaze_of(matrix)])
