"""What a suite consists of: tasks with their places, the measures of a mission, and cells to run.

Worlds of recipes are those of the test split, on which nothing was tuned; mission k of a task has the same
world, start and seed for every strategy.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

from baselines.experiments.mission import SuiteMission, Surroundings
from baselines.experiments.rows import Record
from baselines.experiments.trials import Cell, CellTrial
from entropy_explore_env.errors import counted
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.scenario import Scenario

STARTS, QUICK_STARTS = 30, 2
"""Missions of a task; quick suites take two processors less than ten minutes each."""
REFERENCE, BASELINE = "nearest-frontier", "random"
"""The strategy to which most ratios are relative; without it, as in scenarios of one's own, the walk."""


class Measure(NamedTuple):
    """What a mission is judged by; smaller is better.

    Attributes:
        figure: `time_s` or `path_m`.
        share: Per cent of what can be seen that was seen, or of the asked bits that the best map lost; None
            = at the mission's end.
        of: `seen` or `bits`.
    """

    figure: str
    share: int | None = None
    of: str = "seen"

    @property
    def name(self) -> str:
        """Name of its column in rows."""
        return f"{self.figure}_end" if self.share is None else f"{self.figure}_{self.share}_{self.of}"

    @property
    def words(self) -> str:
        """Words in heads of tables."""
        what = "path (m)" if self.figure == "path_m" else "time (s)"
        return f"{what} to the end" if self.share is None else f"{what} to {self.share} % {self.of}"

    def value(self, record: Record) -> float | None:
        """Return the measure of a mission; None if the mission failed or never came that far."""
        if "failed" in record:
            return None
        if self.share is None:
            if not record.get("finished", False):
                return None
            return record["joint"]["driven_m"] if self.figure == "path_m" else record["t_mission_s"]
        if self.of == "bits":
            return record.get(f"t{self.share}_s")
        mark = f"path{self.share}_seen_m" if self.figure == "path_m" else f"t{self.share}_seen_s"
        return record.get("joint", {}).get(mark)

    def limit(self, scenario: Scenario) -> float:
        """Return what a mission counts with that never came that far: the time limit, or the path in it."""
        limit_s = scenario.ending.time_limit_s
        if self.figure == "time_s":
            return limit_s
        speeds_m_s = (scenario.kind_of(robot).robot.max_speed_m_s for robot in range(scenario.robots))
        return sum(speeds_m_s) * limit_s


Records = Mapping[str, Mapping[int, Record]]
"""Cell → seed → record, of the missions that were run."""
PATH, TIME = Measure("path_m"), Measure("time_s")
TIME_95, TIME_99, TIME_90 = Measure("time_s", 95), Measure("time_s", 99), Measure("time_s", 90, "bits")


@dataclass(frozen=True)
class Place:
    """A scenario, and the missions that are run in it.

    Attributes:
        name: Name of the place within its task.
        scenario: Tracks the truth.
        missions: Their number; their seeds are 0, 1, ….
        start: x, y, z, yaw, pitch of one robot; None = drawn from the seed.
        surroundings: World files, starts and length of a step; None = those that the scenario says.
        strategy: The only strategy that runs here; None = all.
    """

    name: str
    scenario: Scenario
    missions: int
    start: tuple[float, float, float, float, float] | None = None
    surroundings: Surroundings | None = None
    strategy: str | None = None


@dataclass(frozen=True)
class Task:
    """A row of the table of tasks for each strategy.

    Attributes:
        name: As tables say it.
        places: The missions of one after the other are those of the task.
    """

    name: str
    places: tuple[Place, ...]

    @property
    def scenario(self) -> Scenario:
        """The scenario of the first place; all have the same settings but for the world."""
        return self.places[0].scenario

    @property
    def folder(self) -> str:
        """The first part of names of its cells."""
        return "-".join(self.name.replace(",", "").replace("%", "").split())

    @property
    def missions(self) -> int:
        """Number of missions of one strategy."""
        return sum(
            place.missions for place in self.places if place.strategy in (None, self.places[0].strategy)
        )


@dataclass(frozen=True)
class Suite:
    """Tasks and the strategies that run them.

    Attributes:
        name: One of SUITES, or `own` for scenarios of one's own.
        title: Heading of its part of a page.
        tasks: What each strategy runs.
        strategies: Names.
        measures: Two or more, the more important ones first.
        reference: The strategy to which ratios are relative; where it does not run, it is the random walk.
        later: Makes tasks that depend on the records of those before: (suite, cell → records) → tasks.
    """

    name: str
    title: str
    tasks: tuple[Task, ...]
    strategies: tuple[str, ...]
    measures: tuple[Measure, ...] = (TIME, TIME_90)
    later: Later | None = None
    reference: str = REFERENCE

    def cell_id(self, task: Task, place: Place, strategy: str) -> str:
        """Return the name of a cell of missions."""
        one = len(task.places) == 1 or place.strategy is not None
        return f"{task.folder}/{strategy}" if one else f"{task.folder}/{place.name}/{strategy}"

    def places(self, task: Task, strategy: str) -> list[Place]:
        """Return the places of a task in which a strategy runs."""
        return [place for place in task.places if place.strategy in (None, strategy)]

    def completed(self, records: Records) -> Suite:
        """Return the suite with the tasks that depend on records."""
        return self if self.later is None else replace(self, tasks=(*self.tasks, *self.later(self, records)))

    @cached_property
    def cells(self) -> list[Cell]:
        """All cells, strategies of one place beside each other."""
        return [
            Cell(
                self.cell_id(task, place, strategy),
                place.scenario,
                strategy,
                place.missions,
                SuiteMission(place.start),
                place.surroundings,
            )
            for task in self.tasks
            for place in task.places
            for strategy in self.strategies
            if place.strategy in (None, strategy)
        ]

    @property
    def trials(self) -> list[CellTrial]:
        """All missions; mission k of every task comes before any mission k + 1."""
        first = {
            self.cell_id(task, place, strategy): sum(each.missions for each in task.places[:number])
            for task in self.tasks
            for number, place in enumerate(task.places)
            for strategy in self.strategies
            if place.strategy is None
        }
        trials = [CellTrial(cell, seed) for cell in self.cells for seed in range(cell.seeds)]
        return sorted(trials, key=lambda trial: first.get(trial.cell, 0) + trial.seed)


Later = Callable[[Suite, Records], tuple[Task, ...]]
"""Makes tasks that depend on records."""


def task_in(name: str, scenario: Scenario, missions: int, **settings: Any) -> Task:  # noqa: ANN401 - settings
    """Return a task of some missions in one scenario, in worlds of the test split, with further settings."""
    tested = with_settings(scenario, {"split": "test", "track_truth": True, **settings})
    return Task(name, (Place(name, tested, missions),))


def team_name(name: str, robots: int) -> str:
    """Return a task's name: the scenario and the team size."""
    return f"{name}, {counted(robots, 'robot')}"
