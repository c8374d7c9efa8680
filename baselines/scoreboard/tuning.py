"""Tune the rivals: `python -m baselines.scoreboard.tuning`.

Each setting of a rule is varied alone around its default, on training worlds (`suites.training_plans`) with
the same starts for every value. The table of paths over the default's is written into the page that tells of
the rules; who changes a default runs this again. Missions are kept, so that more starts run what is missing.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from baselines.cli.arguments import make_folder, parse, run_command
from baselines.experiments.cells import run_cells
from baselines.experiments.statistics import Interval
from baselines.experiments.tables import markdown_table
from baselines.scoreboard.mission import SETTINGS
from baselines.scoreboard.results import PATH, Results
from baselines.scoreboard.suites import Suite, training_plans
from baselines.strategies import make_strategy
from entropy_explore_env.errors import SettingError
from entropy_explore_env.validation import check_whole
from entropy_explore_env.writing import write_atomically

YARDSTICK = "nearest-frontier"
GRID: Mapping[str, Mapping[str, tuple[float, ...]]] = {
    "distance-advantage": {
        "radius": (30, 60, 120, 270),
        "horizon": (30, 61, 120, 270),
        "opening": (0, 0.05, 0.1, 0.2, 0.3),
        "passing": (0, 0.06, 0.125),
        "meanwhile": (0, 0.25, 0.5, 1),
    },
    "information-gain": {"weight": (0.02, 0.05, 0.15, 0.4, 1, 2), "horizon": (1, 3)},
    "receding-horizon": {"decay": (0.5, 1, 2, 4, 8, 16), "edge": (0.2, 0.4, 0.8), "places": (15, 30, 60)},
    "tour": {"near": (0.4, 0.75, 1.5, 3), "cover": (0.25, 0.5, 1, 2), "stay": (0.02, 0.1, 0.3)},
}
"""Strategy → setting → values, the default among them. With one robot the coordinated rules have none."""
BEGIN, END = "<!-- tuning: begin -->", "<!-- tuning: end -->"
"""Between these lines of the page the table stands."""


@dataclass
class Args:
    """Vary the rivals' settings on training worlds."""

    strategies: str = ",".join(GRID)
    """Which, commas between."""
    starts: int = 5
    """In each of the training plans."""
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


def variants(strategy: str) -> list[str]:
    """The default, then each other value of each setting: `name::setting=value`.

    Raises:
        SettingError: There is no grid for the strategy.
    """
    if strategy not in GRID:
        raise SettingError("strategies", strategy, "one of " + ", ".join(GRID))
    config = getattr(make_strategy(strategy), "config", None)
    found = [strategy]
    for name, values in GRID[strategy].items():
        found += [
            f"{strategy}{SETTINGS}{name}={value:g}" for value in values if value != getattr(config, name)
        ]
    return found


def tuning_table(results: Results, strategies: Sequence[str]) -> str:
    """Markdown: a row of each variant, its path over the default's and over the yardstick's."""
    tasks = results.suite.tasks
    head = ["strategy", "setting", "missions", "path over the default's", f"over `{YARDSTICK}`'s", "by plan"]
    rows = []
    for strategy in strategies:
        for variant in variants(strategy):
            to_default = results.ratio(variant, strategy, PATH, tasks)
            to_yardstick = results.ratio(variant, YARDSTICK, PATH, tasks)
            if to_default is None or to_yardstick is None:
                continue
            by_task = [(task.name, results.ratio(variant, YARDSTICK, PATH, [task])) for task in tasks]
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
    return markdown_table(head, rows)


def ranged(ratio: Interval) -> str:
    """A ratio and its interval; without one that has no width, as of one mission in each plan."""
    return ratio.text() if ratio.low < ratio.high else f"{ratio.value:.2f}"


def with_table(page: str, table: str) -> str:
    """A page with a new table between its marks.

    Raises:
        SettingError: It has no marks.
    """
    if BEGIN not in page or END not in page:
        raise SettingError("page", BEGIN, f"a page with the lines {BEGIN} and {END}")
    before, _, rest = page.partition(BEGIN)
    return f"{before}{BEGIN}\n\n{table.strip()}\n\n{END}{rest.partition(END)[2]}"


def main(words: Sequence[str]) -> int:
    """Run the command."""
    args = parse(Args, words, description=__doc__)
    check_whole("starts", args.starts, 1)
    check_whole("jobs", args.jobs, 1)
    if args.stop_after_s is not None and not 0.0 < args.stop_after_s < math.inf:
        raise SettingError("stop_after_s", args.stop_after_s, "a number > 0")
    strategies = args.strategies.split(",")
    entered = [YARDSTICK, *(variant for strategy in strategies for variant in variants(strategy))]
    page = args.page.read_text(encoding="utf-8")
    with_table(page, "")  # refused before hours of missions
    make_folder("runs", args.runs)
    suite = Suite("plans", training_plans(args.starts), tuple(entered))
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
    table = tuning_table(Results(suite, records), strategies)
    write_atomically(args.page, with_table(page, table))
    print(f"written: the table in {args.page}", file=sys.stderr)
    return 0


if __name__ == "__main__":
    raise SystemExit(run_command(main))
