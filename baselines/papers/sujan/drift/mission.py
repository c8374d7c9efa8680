"""A mission of a robot that may drift, and how often it was blocked and stood still."""

from __future__ import annotations

from dataclasses import dataclass

from baselines.experiments.mission import run_mission
from baselines.experiments.outcome import Record
from baselines.strategies import make_strategy
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.reports.metrics import mission_figures


@dataclass(frozen=True)
class Run:
    """Runs a mission of a cell.

    Attributes:
        guarded: Whether a robot that drifts backs off from what blocks it: see `planner.back_off`.
    """

    guarded: bool = True

    def __call__(self, env: EntropyExploreEnv, strategy: str, seed: int) -> Record:
        """Run the mission.

        Returns:
            The mission's figures, and `most_blocked`, the most drives in a row that something ended early.
        """
        blocked_before = in_a_row = most = scans_before = 0

        def note(env: EntropyExploreEnv) -> None:
            nonlocal blocked_before, in_a_row, most, scans_before
            robots = env.missions.state.robots[0]
            blocked, scans = int(robots["blocked_moves"].sum()), int(robots["scans"].sum())
            if blocked > blocked_before:
                in_a_row += blocked - blocked_before
            elif scans > scans_before:
                in_a_row = 0
            most, blocked_before, scans_before = max(most, in_a_row), blocked, scans

        run_mission(env, make_strategy(strategy), seed, note, backs_off=self.guarded)
        return {**mission_figures(env.missions, 0, floor=False), "most_blocked": most}
