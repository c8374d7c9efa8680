"""What is kept of a mission of a suite."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from baselines.experiments.mission import run_mission
from baselines.experiments.outcome import Record
from baselines.strategies import make_strategy
from baselines.strategies.protocol import Stopwatch
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.reports.metrics import mission_figures


@dataclass(frozen=True)
class SuiteMission:
    """Runs a mission and says what is kept of it.

    Attributes:
        start: x, y, z, yaw, pitch of the one robot, metres and radians, map frame; None = drawn.
    """

    start: tuple[float, float, float, float, float] | None = None

    def __repr__(self) -> str:
        """Return the text that settings digests of published missions were made from."""
        return f"SuiteMission(start={self.start!r}, settings='')"

    def __call__(self, env: EntropyExploreEnv, strategy: str, seed: int) -> Record:
        """Run a mission and keep its figures, and what it cost on the clock.

        Returns:
            `mission_figures` with `scans_over_floor`, without those of single robots; and `clock`:
            `decision_ms` and `worst_decision_ms`, the time that the strategy took for one robot (median and
            largest, the first decision left out, since it may compile), and `mission_s`.
        """
        timed, started = Stopwatch(make_strategy(strategy), time.perf_counter), time.perf_counter()
        options = None if self.start is None else {"starts": [self.start]}
        run_mission(env, timed, seed, options=options)
        mission_s = time.perf_counter() - started
        figures = mission_figures(env.missions, 0, floor=True)
        del figures["per_robot"]
        spent_ms = timed.decisions_ms[1:] or timed.decisions_ms
        clock = {
            "decision_ms": round(float(np.median(spent_ms)), 4),
            "worst_decision_ms": round(max(spent_ms), 4),
            "mission_s": round(mission_s, 4),
        }
        return {**figures, "clock": clock}
