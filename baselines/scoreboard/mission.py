"""What is kept of a mission of a suite."""

from __future__ import annotations

import time
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from baselines.experiments.mission import run_mission
from baselines.experiments.outcome import Record
from baselines.strategies import make_strategy
from baselines.strategies.protocol import Stopwatch, Strategy
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.errors import SettingError
from entropy_explore_env.reports.metrics import mission_figures

SETTINGS = "::"
"""Between the name of a strategy and settings that differ from its defaults."""


@dataclass(frozen=True)
class SuiteMission:
    """Runs a mission and says what is kept of it.

    Attributes:
        start: x, y, z, yaw, pitch of the one robot, metres and radians, map frame; None = drawn.
        settings: `name=value`, commas between, of strategies that are made with a `config`; "" = defaults.
    """

    start: tuple[float, float, float, float, float] | None = None
    settings: str = ""

    def __call__(self, env: EntropyExploreEnv, strategy: str, seed: int) -> Record:
        """Run a mission and keep its figures, and what it cost on the clock.

        Returns:
            `mission_figures` with `scans_over_floor`, without those of single robots; and `clock`:
            `decision_ms` and `worst_decision_ms`, the time that the strategy took for one robot (median and
            largest, the first decision left out, since it may compile), and `mission_s`.
        """
        made = configured(make_strategy(strategy), self.settings)
        timed, started = Stopwatch(made, time.perf_counter), time.perf_counter()
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


def configured(strategy: Any, settings: str) -> Strategy:  # noqa: ANN401 - with or without a config
    """A strategy with other settings than its defaults.

    Args:
        strategy: With a `config`, a dataclass that its class takes.
        settings: See `SuiteMission`.

    Raises:
        SettingError: The strategy has no such setting, or a value is not allowed.
    """
    if not settings:
        return strategy
    changes: dict[str, float] = {}
    known = [field.name for field in fields(strategy.config)] if hasattr(strategy, "config") else []
    for pair in settings.split(","):
        name, _, value = pair.partition("=")
        if name not in known:
            raise SettingError(SETTINGS, pair, "name=value, of " + (", ".join(known) or "none at all"))
        default, number = getattr(strategy.config, name), float(value)
        whole = number.is_integer() if default is None else isinstance(default, int)
        changes[name] = int(number) if whole else number
    return type(strategy)(replace(strategy.config, **changes))
