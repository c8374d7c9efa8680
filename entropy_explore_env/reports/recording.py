"""A mission as it went: time series noted step by step."""

from __future__ import annotations

import math

import numpy as np

from entropy_explore_env.missions.poses import place_at, pose_at
from entropy_explore_env.missions.simulation import Missions


def poses_now(missions: Missions, mission: int) -> np.ndarray:
    """(A, 5) float64 where the robots of a mission are, under way or not: x, y, z, yaw, pitch."""
    time_s = float(missions.state.missions[mission]["time_s"])
    numbers, robots = missions.rules.numbers, missions.state.robots[mission]
    return np.stack([np.array(pose_at(numbers[a], robot, time_s)) for a, robot in enumerate(robots)])


class Ways:
    """The ways that the robots of a mission drive, corner by corner; to be noted after every step.

    Attributes:
        passed_m: For each robot the points (3,) that it has passed: where drives began, and their corners.
    """

    def __init__(self, robots: int, mission: int = 0) -> None:
        """Follow so many robots of a mission; nothing is noted yet."""
        self._mission = mission
        self.passed_m: list[list[np.ndarray]] = [[] for _ in range(robots)]
        self._departed_s = [-math.inf] * robots
        self._behind = [0] * robots
        self._ahead: list[np.ndarray] = [np.zeros((0, 3))] * robots

    def note(self, missions: Missions) -> None:
        """Note what was passed up to this moment."""
        time_s = float(missions.state.missions[self._mission]["time_s"])
        numbers, robots = missions.rules.numbers, missions.state.robots[self._mission]
        for number, robot in enumerate(robots):
            points = self.passed_m[number]
            if robot["depart_s"] != self._departed_s[number]:
                points += [*self._ahead[number], robot["origin"][:3].copy()]
                self._departed_s[number], self._behind[number] = float(robot["depart_s"]), 0
            passed = int(place_at(numbers[number], robot, time_s)[3])
            points += list(robot["way"][self._behind[number] : passed].copy())
            self._ahead[number] = robot["way"][passed : robot["corners"]].copy()
            self._behind[number] = passed

    def so_far(self, missions: Missions) -> list[np.ndarray]:
        """For each robot (N, 3) float64: the way to where it is now."""
        here = poses_now(missions, self._mission)[:, :3]
        return [np.stack([*points, place]) for points, place in zip(self.passed_m, here, strict=True)]


class Recorder:
    """Notes the first of some missions after every step.

    Attributes:
        missions: Those missions; their state is what was noted last.
    """

    def __init__(self, missions: Missions) -> None:
        """Follow these missions; nothing is noted yet."""
        self.missions = missions
        self._times: list[float] = []
        self._entropies: list[np.ndarray] = []
        self._scans: list[int] = []
        self._robot_scans: list[np.ndarray] = []
        self._sent: list[int] = []
        self._places: list[np.ndarray] = []
        self._poses: list[np.ndarray] = []
        self._depths: list[np.ndarray] = []
        self._ways = Ways(missions.scenario.robots)

    def note(self) -> None:
        """Note this moment."""
        robots = self.missions.state.robots[0]
        self._times.append(float(self.missions.state.missions[0]["time_s"]))
        self._entropies.append(robots["entropy_bits"].copy())
        self._scans.append(int(robots["scans"].sum()))
        self._robot_scans.append(robots["scans"].copy())
        self._sent.append(int(robots["measurements_sent"].sum()))
        self._places.append(robots["scan_pose"][:, :3].copy())
        self._poses.append(poses_now(self.missions, 0))
        self._depths.append(robots["depth_m"].copy())
        self._ways.note(self.missions)

    def spread(self, points: int) -> np.ndarray:
        """(≤ points,) int64 which moments to keep of a long series: the ends, and evenly in between."""
        return np.unique(np.linspace(0, len(self._times) - 1, points).round().astype(np.int64))

    @property
    def latest_s(self) -> float:
        """The time noted last."""
        return self._times[-1]

    @property
    def time_s(self) -> np.ndarray:
        """(T,) float64 times noted."""
        return np.asarray(self._times)

    @property
    def entropy_bits(self) -> np.ndarray:
        """(T, A) float64 entropy of each robot's map."""
        return np.stack(self._entropies)

    @property
    def scans(self) -> np.ndarray:
        """(T,) int64 scans of the team so far."""
        return np.asarray(self._scans)

    @property
    def shared(self) -> np.ndarray:
        """(T,) int64 measurements that the team has sent so far."""
        return np.asarray(self._sent)

    @property
    def robot_scans(self) -> np.ndarray:
        """(T, A) int64 scans of each robot so far."""
        return np.stack(self._robot_scans)

    @property
    def depths_m(self) -> np.ndarray:
        """(T, A) float64 mean measured distance of each robot's latest scan."""
        return np.stack(self._depths)

    @property
    def places_m(self) -> np.ndarray:
        """(T, A, 3) float64 where each robot took its latest scan."""
        return np.stack(self._places)

    @property
    def ways_m(self) -> list[np.ndarray]:
        """For each robot (N, 3) float64: the way that it drove, corner by corner."""
        return self._ways.so_far(self.missions)

    @property
    def poses(self) -> np.ndarray:
        """(T, A, 5) float64 where each robot was: x, y, z, yaw, pitch."""
        return np.stack(self._poses)
