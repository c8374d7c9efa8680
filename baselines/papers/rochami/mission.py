"""A mission of RochaMI: with a coordination of its own, and with what the team covers (eqs. 7-10)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from baselines.experiments.mission import record_mission
from baselines.experiments.rows import Record
from baselines.strategies import make_strategy
from baselines.strategies.mutual_information.neighbourhood import MutualInformationConfig
from baselines.strategies.rules.mutual_information import MutualInformation
from entropy_explore_env.belief.visibility import CONE, cone_of, mark_cone, marked_bits, visible_bits
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv

_POINTS = 100


class TeamCoverage:
    """Notes, by the best map, what the cones of the chosen viewpoints cover together, and twice.

    The cones are those of announcements, V(Yˢ, r̂, α̂), also where nothing is announced.
    """

    def __init__(self, missions: Any) -> None:  # noqa: ANN401 - for figures only, see reports/recording.py
        """Follow the first of some missions."""
        self._missions = missions
        self._times: list[float] = []
        self._team: list[float] = []
        self._shared: list[float] = []

    def note(self, env: EntropyExploreEnv) -> None:
        """Note this moment."""
        del env
        missions, grid = self._missions, self._missions.grid
        robots = missions.state.robots[0]
        best = int(robots["entropy_bits"].argmin())
        precision = missions.state.precision[0, best]
        known = missions.scenario.ending.sigma_end**-2
        cones = np.zeros(len(robots), CONE)
        for place, robot in enumerate(robots):
            viewpoint = grid.in_grid_units(robot["target"])
            depth = float(robot["depth_m"]) / grid.voxel_size_m
            cones[place] = cone_of(viewpoint, depth, float(robot["half_angle_rad"]))
        marks, shared = np.zeros(grid.voxels, np.uint8), 0.0
        for cone in cones:  # I of each with those before it: what is covered more than once
            _, twice = visible_bits(cone, grid.shape, precision, known, None, marks)
            shared += twice
            mark_cone(cone, grid.shape, None, marks, 1)
        self._times.append(float(missions.state.missions[0]["time_s"]))
        self._team.append(float(marked_bits(precision, known, marks)))
        self._shared.append(shared)

    def series(self) -> dict[str, list[float]]:
        """Return `time_s`, `team_bits` and `shared_bits` at up to 100 moments, evenly in time."""
        time_s = np.asarray(self._times)
        grid = np.linspace(0.0, time_s[-1], _POINTS)
        rows = np.searchsorted(time_s, grid, side="right") - 1
        return {
            "time_s": grid.round(2).tolist(),
            "team_bits": np.asarray(self._team)[rows].round(1).tolist(),
            "shared_bits": np.asarray(self._shared)[rows].round(1).tolist(),
        }


@dataclass(frozen=True)
class Run:
    """Runs a mission of a cell: with a coordination of its own, and with the team's coverage if wanted."""

    coordination: MutualInformationConfig | None = None
    covered: bool = False

    def __call__(self, env: EntropyExploreEnv, strategy: str, seed: int) -> Record:
        """Run the mission; its record has the `decisions` and, if wanted, H(T) and I in `coverage`."""
        coverage = TeamCoverage(env.missions) if self.covered else None
        made = make_strategy(strategy) if self.coordination is None else MutualInformation(self.coordination)
        record = record_mission(env, made, seed, None if coverage is None else coverage.note)
        if isinstance(made, MutualInformation):
            record["decisions"] = made.decisions
        return record if coverage is None else {**record, "coverage": coverage.series()}
