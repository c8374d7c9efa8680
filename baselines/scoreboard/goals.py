"""Goals of the strategy that is recommended, beside what the committed missions of the suites come to.

    python -m baselines.scoreboard.goals

Reads `missions.csv` of each suite in the folder of results, and writes `goals.md` there. A ratio is that of
the scoreboard: the geometric mean of paired missions' ratios, over several tasks the geometric mean of the
tasks', with a 95 % interval; a mission that was not finished counts with the time limit, and with the path
that could be driven in it.
"""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from baselines.cli.arguments import parse, run_command
from baselines.experiments.statistics import Interval, geometric_ratio_interval
from baselines.experiments.tables import markdown_table
from baselines.scoreboard.results import PATH, TIME, TIME_99, Measure, limit_of
from baselines.scoreboard.suites import Task, find_suite
from baselines.strategies import resolved
from entropy_explore_env.errors import SettingError
from entropy_explore_env.writing import write_atomically

_BEST = resolved("best")
_ENDS = {"SEEN", "MAPPED"}
_LOST = ", half of the messages lost"
_TEAMS_WORLDS = ("cave", "office", "warehouse")


class Goal(NamedTuple):
    """A ratio that was asked for."""

    suite: str
    tasks: tuple[str, ...]
    """Names; none = all of the suite that both strategies have run."""
    measure: Measure
    ours: str
    other: str
    most: float
    """The ratio at most; its interval has to end below 1 where this is less than 1."""
    beside: str = ""
    """The same strategy with another channel: what tells the tasks apart, after the task's name."""

    @property
    def words(self) -> str:
        """What is compared."""
        if self.beside:
            return f"`{self.ours}`, half of the messages lost over none"
        return f"`{self.ours}` over `{self.other}`"


GOALS = (
    Goal("plans", (), PATH, "distance-advantage", "nearest-frontier", 0.86),
    Goal("plans", (), PATH, _BEST, "distance-advantage", 0.95),
    Goal("plans", (), TIME_99, _BEST, "per-time-visibility", 0.80),
    *(
        Goal("teams", (f"{world}, 4 robots",), TIME, _BEST, _BEST, 1.25, beside=_LOST)
        for world in _TEAMS_WORLDS
    ),
)
"""What the recommended strategy, and the rule that it is compared with, were to reach."""


@dataclass
class Args:
    """Say which goals the committed missions reach."""

    results: Path = Path("docs/results")
    """Folder with scoreboard/SUITE/missions.csv; goals.md is written there."""


class Found(NamedTuple):
    """What missions came to."""

    tasks: int
    missions: int
    ratio: Interval

    def holds(self, most: float) -> bool:
        """Whether a goal is reached."""
        return self.ratio.value <= most and (most >= 1.0 or self.ratio.high < 1.0)


def main(words: Sequence[str]) -> int:
    """Run the command."""
    args = parse(Args, words, description=__doc__)
    page = args.results / "goals.md"
    text = page_of({suite: Missions(args.results, suite) for suite in {goal.suite for goal in GOALS}})
    write_atomically(page, text)
    print(f"written: {page}")
    return 0


class Missions:
    """The missions of a suite, as its table holds them."""

    def __init__(self, results: Path, suite: str) -> None:
        """Read the table.

        Raises:
            SettingError: There is none.
        """
        file = results / "scoreboard" / suite / "missions.csv"
        try:
            with file.open(encoding="utf-8", newline="") as lines:
                rows = list(csv.DictReader(lines))
        except OSError:
            raise SettingError("results", str(results), f"a folder with {file}") from None
        self.tasks = {task.name: task for task in find_suite(suite, False, ("nearest-frontier",)).tasks}
        self._rows: dict[tuple[str, str], dict[int, dict[str, str]]] = {}
        for row in rows:
            if row["end_reason"] != "FAILED":
                self._rows.setdefault((row["task"], row["strategy"]), {})[int(row["mission"])] = row

    def values(self, task: str, strategy: str, measure: Measure) -> dict[int, float]:
        """Number of each mission that was run → its measure, or the limit."""
        return {
            number: _value(self.tasks[task], row, measure)
            for number, row in self._rows.get((task, strategy), {}).items()
        }

    def compare(self, goal: Goal) -> Found | None:
        """The ratio of a goal; None = no mission was run by both."""
        ours, theirs = [], []
        for task in goal.tasks or self.tasks:
            own = self.values(task + goal.beside, goal.ours, goal.measure)
            other = self.values(task, goal.other, goal.measure)
            both = sorted(own.keys() & other.keys())
            if both:
                ours.append(np.array([own[number] for number in both]))
                theirs.append(np.array([other[number] for number in both]))
        if not ours:
            return None
        return Found(len(ours), sum(map(len, ours)), geometric_ratio_interval(ours, theirs))


def _value(task: Task, row: dict[str, str], measure: Measure) -> float:
    """A measure of a mission in a table."""
    if measure.share is not None:
        told = row[measure.name]
    else:
        told = row["t_mission_s" if measure.figure == "time_s" else "distance_m"]
        told = told if row["end_reason"] in _ENDS else ""
    return float(told) if told else limit_of(task, measure)


def page_of(missions: dict[str, Missions]) -> str:
    """The page."""
    rows = []
    for goal in GOALS:
        found = missions[goal.suite].compare(goal)
        if found is None:
            continue
        tasks = ", ".join(goal.tasks) if goal.tasks else f"{found.tasks} tasks"
        cells = [goal.suite, tasks, goal.measure.words, goal.words, str(found.missions)]
        holds = "yes" if found.holds(goal.most) else "**no**"
        rows.append([*cells, f"≤ {goal.most:.2f}", found.ratio.text(), holds])
    head = ["suite", "tasks", "measure", "what", "missions", "goal", "reached", "holds"]
    return _HEAD + "\n" + markdown_table(head, rows)


_HEAD = """# Goals of the recommended strategy

Written by `python -m baselines.scoreboard.goals`, from the missions of [the scoreboard](scoreboard.md). A
ratio is the geometric mean of paired missions' ratios, over several tasks the geometric mean of the tasks',
with a 95 % interval of a bootstrap over pairs; missions that were not finished count with the time limit. A
goal below 1 also asks that the interval ends below 1. Intervals over few missions are too narrow. Why goals
are missed: [rules of exploration](../explorers.md).

Thirteen more goals were ratios over `information-rate-v0`, whose code commit `aefa487` holds: `planned-rate`
took 0.76 (0.68 … 0.84) of its time in plans, 0.71 to 0.99 in volumes, and 0.43 to 0.74 with four and eight
robots. Nine of them were reached.
"""


if __name__ == "__main__":
    raise SystemExit(run_command(main))
