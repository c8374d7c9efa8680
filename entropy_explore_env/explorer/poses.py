"""Poses from outside, checked."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from entropy_explore_env.errors import SettingError
from entropy_explore_env.settings.validation import is_whole


def checked_pose(name: str, pose: object) -> np.ndarray:
    """Return a pose as an array.

    Raises:
        SettingError: It is not five finite numbers.
    """
    try:
        array = np.array(pose, np.float64)
    except (TypeError, ValueError):
        array = np.zeros(0)
    if array.shape != (5,) or not np.isfinite(array).all():
        raise SettingError(name, pose, "five finite numbers (x, y, z, yaw, pitch)")
    return array


def poses_by_number(poses: object, robots: int) -> dict[int, np.ndarray]:
    """Return number → pose (5,), of poses in one of the forms that `Explorer.goal` takes.

    Raises:
        SettingError: They have none of these forms.
    """
    if isinstance(poses, Mapping):
        for number in poses:
            if not is_whole(number, 0, robots - 1):
                raise SettingError("poses", list(poses), f"numbers of robots from 0 to {robots - 1}")
        return {int(number): checked_pose(f"poses[{number}]", pose) for number, pose in poses.items()}
    try:
        rows = np.array(poses, np.float64)
    except (TypeError, ValueError):
        rows = np.zeros(0)
    rows = rows[None] if rows.shape == (5,) else rows
    if rows.shape != (robots, 5):
        raise SettingError("poses", poses, f"({robots}, 5) numbers, or a mapping from robots to five")
    return {number: checked_pose(f"poses[{number}]", row) for number, row in enumerate(rows)}
