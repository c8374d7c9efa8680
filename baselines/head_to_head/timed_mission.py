"""What is kept of a mission of a head-to-head."""

from __future__ import annotations

import time

import numpy as np

from baselines.experiments.mission import run_mission
from baselines.experiments.outcome import Record
from baselines.strategies import make_strategy
from baselines.strategies.protocol import Stopwatch
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.reports.metrics import mission_figures


def timed_record(env: EntropyExploreEnv, strategy: str, seed: int) -> Record:
    """Run a mission and keep its figures, and what it cost on the clock.

    Returns:
        `mission_figures` with `scans_over_floor`, without those of single robots; and `clock`: `decision_ms`,
        the time that the strategy took for one robot (median over decisions), and `mission_s`.
    """
    timed, started = Stopwatch(make_strategy(strategy), time.perf_counter), time.perf_counter()
    run_mission(env, timed, seed)
    mission_s = time.perf_counter() - started
    figures = mission_figures(env.missions, 0, floor=True)
    del figures["per_robot"]
    decision_ms = float(np.median(timed.decisions_ms))
    return {**figures, "clock": {"decision_ms": round(decision_ms, 4), "mission_s": round(mission_s, 4)}}
