"""The tasks that the policies over candidates are tested in, and a policy beside another strategy there."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from baselines.experiments.cells import Cell
from baselines.experiments.outcome import Record
from baselines.experiments.runner import NOT_RUN
from baselines.scoreboard.results import Measure, limit_of, value
from baselines.scoreboard.suites import Suite, Task, plans, task_in, team_name
from baselines.strategies import resolved
from entropy_explore_env.scenario import with_settings
from entropy_explore_env.scenarios import SCENARIOS
from training.policy_improvement.comparison import Paired, paired

BEST, _DUNGEONS = resolved("best"), "dungeons"
_LOST: Mapping[str, Any] = {"channel": {"loss_probability": 0.5}}
_NARROW: Mapping[str, Any] = {"channel": {"burst": 16}}
"""A quarter of what the scenarios let pass."""
_STARTS_OF_LONG = 30
"""Where missions are long, no more starts are run."""


@dataclass(frozen=True)
class Test:
    """A task that a policy is tested in.

    Attributes:
        name: Of the scenario.
        robots: Team size.
        changes: Settings that differ, and what they are called.
        learned: Whether the policy learned in this task, in other worlds.
        short: Whether missions are short.
        goal: The ratio to the recommended strategy that was asked for.
    """

    __test__ = False

    name: str
    robots: int
    changes: Mapping[str, Any] = field(default_factory=dict)
    words: str = ""
    learned: bool = False
    short: bool = False
    goal: float | None = None

    @property
    def title(self) -> str:
        """As the table says it."""
        return team_name(self.name, self.robots) + (f", {self.words}" if self.words else "")

    @property
    def measure(self) -> Measure:
        """What is compared: time, or in the dungeons, as their authors do, the path."""
        return Measure("path_m" if self.name == _DUNGEONS else "time_s")

    def measured(self, record: Record) -> float:
        """The measure of a mission; of one that was not finished what it could have come to at most."""
        reached = value(record, self.measure)
        return limit_of(self.task, self.measure) if reached is None else reached

    def cells(self, strategy: str, seeds: int) -> list[Cell]:
        """Missions of a strategy, from so many starts at most."""
        places, starts = self.task.places, seeds if self.short else min(seeds, _STARTS_OF_LONG)
        if self.name == _DUNGEONS:
            some = places[:starts]
        else:
            some = tuple(replace(place, missions=starts) for place in places)
        return Suite("own", (replace(self.task, places=some),), (strategy,)).cells

    @cached_property
    def task(self) -> Task:
        """As the suites have it: the dungeons, or worlds of a scenario's test split."""
        if self.name == _DUNGEONS:
            return plans()[0]
        settings = {"robots": self.robots, **self.changes}
        return task_in(self.title, with_settings(SCENARIOS[self.name], settings), 1)


TESTS: dict[str, tuple[Test, ...]] = {
    "plans": (
        Test("office", 1, learned=True, goal=0.92),
        Test("office", 3, learned=True, goal=0.92),
        Test("hybrid", 1, learned=True),
        Test(_DUNGEONS, 1, goal=0.95),
        Test("corridor", 1, goal=1.0),
        Test("cluttered", 1, goal=1.0),
        Test("office", 2, goal=1.0),
        Test("office", 4, goal=1.0),
        Test("office", 3, _LOST, "half of the messages lost", goal=1.0),
        Test("office", 3, _NARROW, "burst 16", goal=1.0),
        Test("office", 1, {"sensor": {"max_range_m": 5.0}}, "lidar of 5 m", goal=1.0),
    ),
    "volumes": (
        Test("room-furnished", 3, learned=True, short=True, goal=0.95),
        Test("cave", 3, learned=True, goal=0.93),
        Test("office-3d", 3, learned=True, goal=0.95),
        Test("room", 3, short=True, goal=1.01),
        Test("room-furnished", 1, goal=1.0),
        Test("room-furnished", 2, short=True, goal=1.0),
        Test("room-furnished", 4, short=True, goal=1.0),
        Test("cave", 1, goal=1.0),
        Test("office-3d", 1, goal=1.0),
        Test("room-furnished", 3, _LOST, "half of the messages lost", short=True, goal=1.0),
        Test("room-furnished", 3, _NARROW, "burst 16", short=True, goal=1.0),
        Test("cave", 3, {"sensor": {"max_range_m": 6.0}}, "sensor of 6 m", goal=1.0),
    ),
}


class Compared(NamedTuple):
    """A policy beside another strategy, on the same starts."""

    starts: int
    finished: tuple[int, int]
    """Missions of the policy, and of the other, that came to their end."""
    measured: Paired
    decision_ms: tuple[float, float]
    """Median time on the clock that a decision of one robot took."""

    def holds(self, goal: float) -> bool:
        """Whether a goal is reached: see the head of the page."""
        ratio = self.measured.ratio
        clear = goal >= 1.0 or ratio.high < 1.0
        worst = round(self.measured.worst_tenth, 2) <= 1.0
        return ratio.value <= goal and clear and worst and self.finished[0] >= self.finished[1]


def compared(test: Test, ours: Sequence[Record], theirs: Sequence[Record]) -> Compared | None:
    """Both on the starts that both ran; None = on none."""
    pairs = [pair for pair in zip(ours, theirs, strict=True) if NOT_RUN not in pair]
    if not pairs:
        return None
    own, other = (np.array([test.measured(pair[side]) for pair in pairs]) for side in (0, 1))
    own_finished, other_finished = (sum(_finished(pair[side]) for pair in pairs) for side in (0, 1))
    return Compared(
        len(pairs),
        (own_finished, other_finished),
        paired(own, other),
        (_decision_ms([pair[0] for pair in pairs]), _decision_ms([pair[1] for pair in pairs])),
    )


def _decision_ms(records: Sequence[Record]) -> float:
    """The median over missions of their median decision; 0 where all failed."""
    clocks = [record["clock"]["decision_ms"] for record in records if "failed" not in record]
    return float(np.median(clocks)) if clocks else 0.0


def _finished(record: Record) -> bool:
    return "failed" not in record and bool(record["finished"])


def strategies_of(name: str) -> tuple[str, ...]:
    """Return the strategies that run in the tasks of a policy."""
    return (f"pretrained:{name}", BEST)
