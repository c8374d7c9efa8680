"""Time series of a mission, recorded step by step, and the paths that its robots drive."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from entropy_explore_env.missions.localization import believed_pose
from entropy_explore_env.missions.poses import place_at, pose_at
from entropy_explore_env.missions.simulation import Missions
from entropy_explore_env.robots.motion import MoveEnd

_FAILED = MoveEnd.FAILED.code


def poses_now(missions: Missions, mission: int) -> np.ndarray:
    """Return (A, 5) float64 current poses of a mission's robots, driving or not: x, y, z, yaw, pitch."""
    time_s = float(missions.state.missions[mission]["time_s"])
    numbers, robots = missions.rules.params, missions.state.robots[mission]
    return np.stack([np.array(pose_at(numbers[a], robot, time_s)) for a, robot in enumerate(robots)])


def believed_poses_now(missions: Missions, mission: int) -> np.ndarray:
    """Return (A, 5) float64 where a mission's robots believe they are: `poses_now` where no robot drifts."""
    poses = poses_now(missions, mission)
    if missions.estimates is None:
        return poses
    params, estimates = missions.rules.params, missions.estimates[mission]
    believed = [believed_pose(estimates[a], params[a], pose) for a, pose in enumerate(poses)]
    return np.array(believed)


class DrivenPaths:
    """The paths that the robots of a mission drive, corner by corner; to be updated after every step.

    Attributes:
        passed_m: For each robot the points (3,) that it has passed: where drives began, and their corners.
    """

    def __init__(self, robots: int, mission: int = 0) -> None:
        """Follow the robots of a mission, from its reset on."""
        self._mission = mission
        self.passed_m: list[list[np.ndarray]] = [[] for _ in range(robots)]
        self._departed_s = [-math.inf] * robots
        self._corners_passed = [0] * robots
        self._ahead: list[np.ndarray] = [np.zeros((0, 3))] * robots

    def update(self, missions: Missions) -> None:
        """Add the points that were passed since the last update."""
        time_s = float(missions.state.missions[self._mission]["time_s"])
        numbers, robots = missions.rules.params, missions.state.robots[self._mission]
        for number, robot in enumerate(robots):
            points = self.passed_m[number]
            if robot["depart_s"] != self._departed_s[number]:
                halted = robot["move_end"] == _FAILED  # it has not passed all corners that were ahead
                points += [*([] if halted else self._ahead[number]), robot["origin"][:3].copy()]
                self._departed_s[number], self._corners_passed[number] = float(robot["depart_s"]), 0
            passed = int(place_at(numbers[number], robot, time_s)[3])
            points += list(robot["path"][self._corners_passed[number] : passed].copy())
            ahead = 0 if robot["under_way"] else robot["corners"]  # else it may leave its path here
            self._ahead[number] = robot["path"][passed:ahead].copy()
            self._corners_passed[number] = passed

    def to_now(self, missions: Missions) -> list[np.ndarray]:
        """Return for each robot the path (N, 3) float64 from its start to its current position."""
        here = poses_now(missions, self._mission)[:, :3]
        return [np.stack([*points, place]) for points, place in zip(self.passed_m, here, strict=True)]


class Series(NamedTuple):
    """What is recorded of a mission at T moments."""

    time_s: np.ndarray
    """(T,) float64."""
    entropy_bits: np.ndarray
    """(T, A) float64 entropy of each robot's map."""
    scans: np.ndarray
    """(T, A) int64 scans of each robot since the reset."""
    shared: np.ndarray
    """(T,) int64 measurements that the team has sent since the reset."""
    bits_sent: np.ndarray
    """(T,) int64 bits that the team has sent since the reset."""
    scan_positions_m: np.ndarray
    """(T, A, 3) float64 where each robot took its latest scan."""
    poses: np.ndarray
    """(T, A, 5) float64 of each robot: x, y, z, yaw, pitch."""

    def sampled(self, most: int) -> np.ndarray:
        """Return (≤ most,) int64 numbers of evenly spaced moments, the first and the last among them."""
        return np.unique(np.linspace(0, len(self.time_s) - 1, most).round().astype(np.int64))


class Recorder:
    """Records the first of some missions, moment by moment.

    Attributes:
        missions: Those missions; their state is that of the latest moment.
    """

    def __init__(self, missions: Missions) -> None:
        """Follow these missions; nothing is recorded yet."""
        self.missions = missions
        self._moments: list[Series] = []
        """Each of a single moment, without the axis of T."""

    def note(self) -> None:
        """Record this moment, after a reset or a step."""
        robots = self.missions.state.robots[0]
        moment = Series(
            time_s=self.missions.state.missions[0]["time_s"].copy(),
            entropy_bits=robots["entropy_bits"].copy(),
            scans=robots["scans"].copy(),
            shared=robots["measurements_sent"].sum(),
            bits_sent=robots["bits_sent"].sum(),
            scan_positions_m=robots["scan_pose"][:, :3].copy(),
            poses=poses_now(self.missions, 0),
        )
        self._moments.append(moment)

    def series(self) -> Series:
        """Return what was recorded so far."""
        return Series(*(np.array(moments) for moments in zip(*self._moments, strict=True)))
