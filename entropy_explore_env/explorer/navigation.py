"""What a node does with messages: maps and poses in, goals for Nav2 and markers out.

All of it works on the fields of messages of any class, so that it runs and is tested without ROS. The
node itself is `docs/ros2/entropy_explore_ros`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from entropy_explore_env.errors import SettingError
from entropy_explore_env.explorer.explorer import Explorer
from entropy_explore_env.explorer.goals import Goal
from entropy_explore_env.interop.messages import ARROW_M, pose_of
from entropy_explore_env.reports.colours import robot_colour
from entropy_explore_env.robots.motion import MoveEnd
from entropy_explore_env.robots.rotations import quaternion_of
from entropy_explore_env.settings.robot import Robot
from entropy_explore_env.settings.sensor import RangeSensor

SUCCEEDED, CANCELED, ABORTED = 4, 5, 6
"""Statuses of action_msgs/GoalStatus at an action's end."""
_ARROW, _ADD, _DELETE = 0, 0, 2
"""Type and actions of a visualization_msgs/Marker."""


def move_end_of(status: int) -> MoveEnd:
    """Return how a drive ended, by the status of Nav2's action."""
    if status == SUCCEEDED:
        return MoveEnd.ARRIVED
    return MoveEnd.FAILED if status == CANCELED else MoveEnd.OBSTACLE


def fill_pose(message: Any, pose: np.ndarray) -> Any:  # noqa: ANN401
    """Fill in a geometry_msgs/Pose with a place and a yaw: ground robots do not pitch; return it."""
    message.position.x, message.position.y, message.position.z = (float(v) for v in pose[:3])
    turn = message.orientation
    turn.x, turn.y, turn.z, turn.w = quaternion_of(float(pose[3]))
    return message


def fill_marker(message: Any, goal: Goal | None, robot: int) -> Any:  # noqa: ANN401
    """Fill in a visualization_msgs/Marker: an arrow at a goal, or none where there is none; return it."""
    message.ns, message.id, message.type = "goals", robot, _ARROW
    message.action = _DELETE if goal is None else _ADD
    if goal is not None:
        fill_pose(message.pose, goal.viewpoint)
    message.scale.x, message.scale.y, message.scale.z = ARROW_M
    red, green, blue = (channel / 255.0 for channel in robot_colour(robot))
    message.color.r, message.color.g, message.color.b, message.color.a = red, green, blue, 1.0
    return message


class Navigation:
    """Decides for the robots of a node.

    Attributes:
        driving: Whether each robot has a goal that has not ended.
        left: For each robot, why there was no goal at its latest decision; None = there was one.
        trouble: Why the latest decision of a robot failed, for the log; empty = it did not.
    """

    def __init__(
        self, robots: int, robot: Robot | None = None, sensor: RangeSensor | None = None, seed: int = 0
    ) -> None:
        """Take the settings; the size of voxels comes with the first map."""
        self._settings = {"robots": robots, "robot": robot, "sensor": sensor, "seed": seed}
        self._explorer: Explorer | None = None
        self._poses: dict[int, np.ndarray] = {}
        self._ended: dict[int, MoveEnd] = {}
        self.driving = [False] * robots
        self.left: list[str | None] = [None] * robots
        self.trouble = ""

    def hear_map(self, message: Any) -> bool:  # noqa: ANN401
        """Take a nav_msgs/OccupancyGrid; return whether it could be used."""
        try:
            explorer = self._explorer
            if explorer is None:
                size_m = float(f"{float(message.info.resolution):.6g}")  # a float32 in the message
                explorer = Explorer(voxel_size_m=size_m, **self._settings)
            explorer.set_map_message(message)
        except SettingError as error:
            self.trouble = str(error)
            return False
        self._explorer = explorer
        return True

    def hear_pose(self, robot: int, position: Any, orientation: Any) -> None:  # noqa: ANN401
        """Take where a robot is in the map frame: translation and rotation of a transform, or of a pose."""
        self._poses[robot] = pose_of(position, orientation)

    def forget_pose(self, robot: int) -> None:
        """Count a robot as silent whose pose is not known any more."""
        self._poses.pop(robot, None)

    def end(self, robot: int, status: int) -> None:
        """Note that a robot's drive has ended, by the status of its action."""
        self.driving[robot], self._ended[robot] = False, move_end_of(status)

    def refuse(self, robot: int) -> None:
        """Note that a goal was not accepted: as if a drive to it had been blocked."""
        self.end(robot, ABORTED)

    def idle(self) -> Sequence[int]:
        """Return the robots that wait for a goal; none before the first map."""
        if self._explorer is None:
            return []
        return [robot for robot, drives in enumerate(self.driving) if not drives and robot in self._poses]

    def decide(self, robot: int, time_s: float) -> Goal | None:
        """Return where a robot goes; None = nowhere now: see `left` and `trouble`."""
        self.trouble, ended = "", self._ended.pop(robot, None)
        if self._explorer is None or robot not in self._poses:
            return None
        try:
            goal = self._explorer.goal(self._poses, robot, ended=ended, time_s=time_s)
        except SettingError as error:
            self.trouble = str(error)
            if ended is not None:
                self._ended[robot] = ended
            return None
        reason = self._explorer.no_goal
        self.left[robot] = None if reason is None else reason.value
        self.driving[robot] = goal is not None
        return goal

    @property
    def finished(self) -> bool:
        """Whether no robot drives, and none found a goal."""
        return not any(self.driving) and all(reason is not None for reason in self.left)
