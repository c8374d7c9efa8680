"""Tune the rivals, and ours: `python -m baselines.scoreboard.tuning`.

Each setting of a rule is varied alone around its default, on training worlds (`suites.training_plans`,
`suites.training_volumes`, `suites.training_teams`) with the same starts for every value. The table of paths,
or of mission times, over the default's is written into the page that tells of the rules; who changes a
default runs this again. Missions are kept, so that more starts run what is missing.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from baselines.cli.arguments import make_folder, parse, run_command
from baselines.experiments.cells import run_cells
from baselines.experiments.statistics import Interval
from baselines.experiments.tables import markdown_table
from baselines.scoreboard.mission import SETTINGS
from baselines.scoreboard.results import PATH, TIME, Measure, Results
from baselines.scoreboard.suites import (
    Suite,
    Task,
    training_plans,
    training_teams,
    training_volumes,
    training_whole_plans,
)
from baselines.strategies import make_strategy
from entropy_explore_env.errors import SettingError, one_of
from entropy_explore_env.validation import check_whole
from entropy_explore_env.writing import write_atomically


class Tuning(NamedTuple):
    """What is tuned where, and by what."""

    tasks: Callable[[int], tuple[Task, ...]]
    """Number of starts → tasks."""
    grid: Mapping[str, Mapping[str, tuple[float, ...]]]
    """Strategy → setting → values, the default among them, unless it depends on the kind of robot."""
    yardstick: str
    """Strategy."""
    measure: Measure
    words: str
    """What the measure is."""


TUNINGS: Mapping[str, Tuning] = {
    "plans": Tuning(
        training_plans,
        {
            "distance-advantage": {"radius": (30, 60, 120, 270), "horizon": (30, 61, 120, 270)},
            "information-gain": {"weight": (0.02, 0.05, 0.15, 0.4, 1, 2), "horizon": (1, 3)},
            "receding-horizon": {
                "decay": (0.5, 1, 2, 4, 8, 16),
                "edge": (0.2, 0.4, 0.8),
                "places": (15, 30, 60),
            },
            "tour": {
                "near": (0.25, 0.4, 0.75),
                "cover": (0.2, 0.4, 1),
                "most_far": (4, 8, 20),
                "stay": (0.02, 0.1),
            },
        },
        "nearest-frontier",
        PATH,
        "path",
    ),
    "tours": Tuning(
        training_whole_plans,
        {"planned-rate": {"pocket": (0, 0.06, 0.25), "sight": (0.25, 0.8)}},
        "nearest-frontier",
        PATH,
        "path",
    ),
    "volumes": Tuning(
        training_volumes,
        {
            "planned-rate": {
                "behind": (1, 4, 16, 64),
                "far_places": (6, 12, 24, 48),
                "leave_below": (0, 0.05, 0.1, 0.2),
            },
            "information-gain": {"weight": (0.02, 0.05, 0.15, 0.4, 1), "horizon": (1, 3)},
            "receding-horizon": {"decay": (2, 4, 8, 16), "edge": (0.2, 0.4, 0.8), "places": (15, 30, 60)},
            "tour": {"near": (0.25, 0.4, 0.75), "cover": (0.2, 0.4, 1), "most_far": (4, 8, 20)},
        },
        "information-rate-v0",
        TIME,
        "mission time",
    ),
    "teams": Tuning(
        training_teams,
        {
            "coordinated-frontier": {"beta": (0.1, 0.3, 1, 3, 10)},
            "assigned-frontier": {"group": (0.125, 0.25, 0.5, 1)},
        },
        "nearest-frontier",
        TIME,
        "mission time",
    ),
}
"""Suite → what is tuned on worlds like those of it. With one robot the coordinated rules have no setting."""


@dataclass
class Args:
    """Vary settings on training worlds."""

    suite: str = "plans"
    """plans: the rivals for one robot; tours: ours where all is to be seen; volumes: the rivals and ours;
    teams: the coordinated rivals."""
    strategies: str | None = None
    """Which, commas between; default: all that the suite tunes."""
    starts: int = 5
    """In each of the training worlds."""
    stop_after_s: float | None = None
    """Time on the clock after which no mission is begun any more; the same command goes on."""
    confirm: bool = False
    """Keep missions of other code where samples come out the same; as in baselines.benchmark."""
    jobs: int = 1
    """Processes."""
    runs: Path = Path("results/tuning")
    """Folder that keeps the missions."""
    page: Path = Path("docs/explorers.md")
    """Page that holds the table."""


def marks(suite: str) -> tuple[str, str]:
    """The lines of the page between which the table of a suite stands."""
    return f"<!-- tuning of {suite}: begin -->", f"<!-- tuning of {suite}: end -->"


def find_tuning(suite: str) -> Tuning:
    """What is tuned on worlds like those of a suite.

    Raises:
        SettingError: Nothing is.
    """
    if suite not in TUNINGS:
        raise SettingError("suite", suite, one_of(suite, TUNINGS))
    return TUNINGS[suite]


def variants(tuning: Tuning, strategy: str) -> list[str]:
    """The default, then each other value of each setting: `name::setting=value`.

    Of a setting whose default depends on the kind of robot each value is another one.

    Raises:
        SettingError: There is no grid for the strategy.
    """
    if strategy not in tuning.grid:
        raise SettingError("strategies", strategy, one_of(strategy, tuning.grid))
    config = getattr(make_strategy(strategy), "config", None)
    found = [strategy]
    for name, values in tuning.grid[strategy].items():
        found += [
            f"{strategy}{SETTINGS}{name}={value:g}" for value in values if value != getattr(config, name)
        ]
    return found


def tuning_table(results: Results, tuning: Tuning, strategies: Sequence[str]) -> str:
    """Markdown: a row of each variant, its measure over the default's and over the yardstick's."""
    tasks, yardstick, measure = results.suite.tasks, tuning.yardstick, tuning.measure
    over = [f"{tuning.words} over the default's", f"over `{yardstick}`'s"]
    rows = []
    for strategy in strategies:
        for variant in variants(tuning, strategy):
            to_default = results.ratio(variant, strategy, measure, tasks)
            to_yardstick = results.ratio(variant, yardstick, measure, tasks)
            if to_default is None or to_yardstick is None:
                continue
            by_task = [(task.name, results.ratio(variant, yardstick, measure, [task])) for task in tasks]
            rows.append(
                [
                    f"`{strategy}`",
                    variant.partition(SETTINGS)[2] or "default",
                    sum(len(results.of(task, variant)) for task in tasks),
                    "1" if variant == strategy else ranged(to_default),
                    ranged(to_yardstick),
                    ", ".join(f"{name} {ratio.value:.2f}" for name, ratio in by_task if ratio is not None),
                ]
            )
    return markdown_table(["strategy", "setting", "missions", *over, "by world"], rows)


def ranged(ratio: Interval) -> str:
    """A ratio and its interval; without one that has no width, as of one mission in each plan."""
    return ratio.text() if ratio.low < ratio.high else f"{ratio.value:.2f}"


def with_table(page: str, suite: str, table: str) -> str:
    """A page with new rows between the marks of a suite; rows of strategies that are not among them stay.

    Args:
        page: Its text.
        suite: Which marks.
        table: Markdown, with the strategy in the first column.

    Raises:
        SettingError: It has no marks.
    """
    begin, end = marks(suite)
    if begin not in page or end not in page:
        raise SettingError("page", begin, f"a page with the lines {begin} and {end}")
    before, _, rest = page.partition(begin)
    there, _, after = rest.partition(end)
    head, rows = _head_and_rows(table)
    head_there, rows_there = _head_and_rows(there)
    if head_there == head:
        made = {_strategy_of(row) for row in rows}
        rows += [row for row in rows_there if _strategy_of(row) not in made]
        rows.sort(key=_strategy_of)
    return "\n".join([f"{before}{begin}", "", *head, *rows, "", f"{end}{after}"])


def _head_and_rows(table: str) -> tuple[list[str], list[str]]:
    """The first two lines of a Markdown table, and the others."""
    lines = table.strip().splitlines()
    return lines[:2], lines[2:]


def _strategy_of(row: str) -> str:
    return row.split("|")[1].strip()


def main(words: Sequence[str]) -> int:
    """Run the command."""
    args = parse(Args, words, description=__doc__)
    check_whole("starts", args.starts, 1)
    check_whole("jobs", args.jobs, 1)
    if args.stop_after_s is not None and not 0.0 < args.stop_after_s < math.inf:
        raise SettingError("stop_after_s", args.stop_after_s, "a number > 0")
    tuning = find_tuning(args.suite)
    strategies = list(tuning.grid) if args.strategies is None else args.strategies.split(",")
    entered = [variant for strategy in strategies for variant in variants(tuning, strategy)]
    with_table(args.page.read_text(encoding="utf-8"), args.suite, "")  # refused before hours of missions
    make_folder("runs", args.runs)
    suite = Suite(args.suite, tuning.tasks(args.starts), (tuning.yardstick, *entered))
    records = run_cells(
        suite.cells,
        args.runs,
        args.jobs,
        "tuning",
        quiet=False,
        limit_s=600.0,
        keep_failures=True,
        stop_after_s=math.inf if args.stop_after_s is None else args.stop_after_s,
        confirm=args.confirm,
    )
    table = tuning_table(Results(suite, records), tuning, strategies)
    page = args.page.read_text(encoding="utf-8")  # as it is now: it may have been edited meanwhile
    write_atomically(args.page, with_table(page, args.suite, table))
    print(f"written: the table in {args.page}", file=sys.stderr)
    return 0


if __name__ == "__main__":
    raise SystemExit(run_command(main))
