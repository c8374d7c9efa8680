"""Missions that end when all is seen and the team is back where it started: `Ending.return_to_start`.

Kernels are told of a threshold that no mission reaches; whether it is over is asked after each step.
"""

from __future__ import annotations

import math

import numpy as np

from entropy_explore_env.missions.records import MissionEnd
from entropy_explore_env.missions.rules import Rules
from entropy_explore_env.missions.state import MissionState


class Returning:
    """What E missions ask for, and where their robots started.

    Attributes:
        homes: (E, A, 3) where robots started, map frame, metres.
        seen: (E,) explored visible voxels that are asked for.
        free: (E,) explored free ones.
    """

    def __init__(self, missions: int, robots: int) -> None:
        """Make room; missions begin later."""
        self.homes = np.zeros((missions, robots, 3))
        self.seen, self.free = np.zeros(missions, np.int64), np.zeros(missions, np.int64)

    def begin(self, state: MissionState, mission: int, voxels: int) -> None:
        """Take what a mission asks for out of its arrays, and where its robots are."""
        clock = state.missions[mission]
        self.homes[mission] = state.robots[mission]["origin"][:, :3]
        self.seen[mission], self.free[mission] = clock["explored_end"], clock["explored_free_end"]
        clock["explored_end"] = voxels + 1

    def end(self, rules: Rules, state: MissionState) -> None:
        """End the missions that have seen enough and whose robots stand where they started.

        A robot stands there if its body would touch the one of its start, and its latest drive ended there,
        or did not lead away. Robots that stopped for good are not waited for.
        """
        clocks, robots, params = state.missions, state.robots, rules.params
        enough = (clocks["explored_visible"] >= self.seen) & (clocks["explored_free"] >= self.free)
        near_m = np.maximum(2.0 * params["body_radius_m"], params["voxel_size_m"])
        begins, ends = (
            np.linalg.norm(robots[name][..., :3] - self.homes, axis=-1) <= near_m
            for name in ("origin", "goal")
        )
        home = ends & (begins | (robots["deciding"] & ~robots["under_way"]))
        if state.faults.size:
            home |= state.faults["stopped"] & (state.faults["stop_until_s"] == math.inf)
        over = (clocks["end"] == MissionEnd.RUNNING.code) & enough & home.all(axis=1)
        clocks["end"][over] = MissionEnd.SEEN.code
