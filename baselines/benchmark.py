"""Compare strategies, in a suite of pinned worlds and starts or in tasks of your own.

    python -m baselines.benchmark --suite plans --strategies best,mine.py:Mine
    python -m baselines.benchmark --scenarios room,office --robots 1,3 --seeds 10
    python -m baselines.benchmark --world maps/*.yaml --quick --out results/mine
    python -m baselines.benchmark --suite plans --strategies mine.py:Mine --author "A. Name" --entry mine
    python -m baselines.benchmark --check mine

Every strategy runs the same missions; mission k of all tasks and strategies comes before any mission k + 1.
The folder gets a page with a table over all tasks, a figure, and an archive of all missions. An interrupted
run continues where it was. A mission that raises an error or exceeds its limit is a row with the reason.
An entry is a folder with the record of every mission, which --check plays again without the strategy.
"""

from __future__ import annotations

import dataclasses
import math
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar

from baselines.cli.arguments import given_values, make_folder, parse, print_json, run_command, told_command
from baselines.cli.options import Mark
from baselines.cli.task_options import TaskOptions, is_whole_scenario
from baselines.cli.worker_options import TrialOptions
from baselines.experiments.rows import read_table
from baselines.experiments.trials import How
from baselines.strategies import STRATEGIES, make_strategy, resolved, shown_names
from baselines.suites import find_suite
from baselines.suites.own import (
    DEFAULT_SCENARIOS,
    QUICK_SCENARIOS,
    default_sizes,
    scenario_tasks,
    world_tasks,
)
from baselines.suites.results import results_of, run_suite
from baselines.suites.suite import BASELINE, Suite
from entropy_explore_env.errors import SettingError, one_of
from entropy_explore_env.settings.scenarios import SCENARIOS
from entropy_explore_env.settings.validation import check_whole

_SEEDS, _QUICK_SEEDS = 30, 5
_PINNED = ("scenarios", "robots", "seeds", "world_scenario")
"""Options that a suite pins, as it does all of a task's."""
_WHERE = (
    "--out",
    "--runs",
    "--archive",
    "--jobs",
    "--cluster",
    "--json",
    "--tables",
    "--stop-after-s",
    "--cite",
)
_NOT_TOLD = (*_WHERE, "--rerun", "--since")
"""Options that a page does not tell."""
_OF_CHECK = ("check", "json", "jobs", "cluster")
_OF_PAGE = ("out", "runs", "archive", "cite", "tables")
"""Options of a run's page, which an entry does not have."""


@dataclass
class Args(TrialOptions):
    """Compare strategies."""

    usual: ClassVar = (
        *("suite", "scenarios", "world", "strategies", "robots", "seeds", "quick", "settings"),
        *("wall_limit_s", "jobs", "out", "tables", "json"),
        *("entry", "author", "check", "cite"),
    )

    suite: str | None = None
    """Pinned worlds and starts: plans, volumes, teams, others, c2, faults or prediction."""
    scenarios: str | None = None
    """Named scenarios, separated by commas, in place of a suite; options of the task change each of them.
    Default: room,room-furnished,lab,office,cave, or the scenario in --settings. With --world alone every
    file, or every file of a folder, is a task."""
    strategies: str | None = None
    """Names as in baselines.run, separated by commas, or all. A suite adds nearest-frontier, other tasks add
    random. Default: those in the suite's table; without a suite all."""
    robots: str | None = None
    """Team sizes, separated by commas; default: 1,2,4, or that of the scenario in --settings."""
    seeds: int | None = None
    """Missions of every strategy in every scenario and team size; default: 30."""
    quick: bool = False
    """Fewer worlds and starts of a suite; without one room,office, team sizes 1,2 and 5 seeds by default."""
    world_scenario: str | None = None
    """Scenario that gives robots and sensors for world files; default: office for plans, else room."""
    task: Annotated[TaskOptions, Mark.INLINE] = dataclasses.field(default_factory=TaskOptions)
    wall_limit_s: float = 600.0
    """Wall-clock limit of a mission, which then counts as failed."""
    stop_after_s: float | None = None
    """Wall-clock time after which no further mission starts; the same command continues. 0: only write the
    page again."""
    archive: Path | None = None
    """Archive of an earlier run, NAME.jsonl.xz, whose missions are not run again; neither are those in
    --out."""
    tables: bool = False
    """Print the table of every task, too."""
    out: Path = Path("results/scoreboard")
    """Folder for the page and, in scoreboard, archives and figures."""
    runs: Path | None = None
    """Folder for the tables that grow while missions run; default: runs in --out."""
    json: bool = False
    """Print one JSON object and nothing else."""
    entry: Path | None = None
    """Folder for an entry in the suite: rows and mission records of --strategies, and of no others."""
    author: str = ""
    """Who enters."""
    check: Path | None = None
    """Folder of an entry, all missions of which are played again and compared with its rows."""
    cite: Path | None = None
    """Folder for the table over all tasks as LaTeX and CSV, and the figure as PDF."""


def main(words: Sequence[str]) -> int:
    """Run the command."""
    args = parse(Args, words, description=__doc__)
    if args.check is not None:
        _refuse_beside("check", words, lambda name: name not in _OF_CHECK)
        return _check(args.check, args)
    if args.entry is not None:
        if not (args.suite and args.strategies and args.author.strip()):
            raise SettingError("entry", str(args.entry), "--suite, --strategies and --author beside it")
        _refuse_beside("entry", words, lambda name: name in _OF_PAGE)
    suite, refused = _suite(args, words)
    stop_after_s = math.inf if args.stop_after_s is None else args.stop_after_s
    title = "strategies" if args.suite is None else f"suite {suite.name}"
    how = args.how(title, args.json, args.wall_limit_s, keep_failures=True, stop_after_s=stop_after_s)
    if args.entry is not None:
        return _enter(args.entry, suite, how, args)
    from baselines.suites.page import archive_of, cite, write_page  # matplotlib: after the help
    from baselines.suites.terminal import printed_results, show_results

    if args.archive is not None and not args.archive.is_file():
        raise SettingError("archive", str(args.archive), "a file that is there")
    archives = [archive_of(args.out, suite.name), *([] if args.archive is None else [args.archive])]
    known = [row for archive in archives for row in read_table(archive)]
    runs = args.runs or args.out / "runs"
    make_folder("out", args.out)
    make_folder("runs", runs)
    started = time.monotonic()
    table = runs / f"{suite.name}.jsonl"
    if stop_after_s > 0.0:
        run_suite(suite, table, how, known)
    quick_part = args.quick and args.suite is not None
    whole = find_suite(suite.name, strategies=suite.strategies) if quick_part else suite
    results, rows = results_of(whole, [*known, *read_table(table)])
    if not rows:
        print("nothing to write: no mission was run", file=sys.stderr)
        return 0
    command = told_command("python -m baselines.benchmark", words, _NOT_TOLD)
    page = write_page(args.out, results, rows, command, refused)
    if args.cite is not None:
        make_folder("cite", args.cite)
        cite(args.cite, results)
    if args.json:
        wall_s = round(time.monotonic() - started, 1)
        print_json({**printed_results(results), "refused": refused, "wall_s": wall_s})
    else:
        show_results(results, refused, tables=args.tables)
        print(f"written: {page}, its figure and archive beside it", file=sys.stderr)
    if names := results.broken:
        print(f"error: every mission of {', '.join(names)} raised an error", file=sys.stderr)
        return 1
    return 0


def _enter(folder: Path, suite: Suite, how: How, args: Args) -> int:
    """Write an entry."""
    from baselines.suites.entries import write_entry

    make_folder("entry", folder)
    whole = write_entry(folder, suite, args.quick, args.author, how)
    if args.json:
        print_json({"entry": str(folder), "whole": whole})
    elif whole:
        print(f"written: {folder}")
    else:
        print(f"stopped; the same command goes on with what is in {folder}")
    return 0


def _refuse_beside(option: str, words: Sequence[str], refused: Callable[[str], bool]) -> None:
    """Raise a SettingError that names an option which does not go with another one."""
    for name, value in given_values(Args, words).items():
        if name != option and refused(name):
            raise SettingError(name, value, f"no value beside --{option}")


def _check(folder: Path, args: Args) -> int:
    """Check an entry; print which of its rows hold."""
    from baselines.suites.entries import check_entry

    about, verdicts = check_entry(folder, args.workers)
    faults = [verdict for verdict in verdicts if verdict.fault]
    if args.json:
        print_json({"entry": str(folder), "rows": len(verdicts), "faults": faults})
    else:
        entered = ", ".join(shown_names(about.strategies).values())
        print(f"{entered} in suite {about.suite}, by {about.author}")
        for cell, seed, fault in faults:
            print(f"{cell}, seed {seed}: {fault}")
        print(f"{len(verdicts) - len(faults)} of {len(verdicts)} rows hold")
    return int(bool(faults))


def _suite(args: Args, words: Sequence[str]) -> tuple[Suite, list[str]]:
    """Return what the options ask for, and why world files are refused.

    Raises:
        SettingError: An option has a value that is not allowed, or does not go with a suite.
        WorldError: No world file can be used.
    """
    missions = args.seeds if args.seeds is not None else (_QUICK_SEEDS if args.quick else _SEEDS)
    check_whole("seeds", missions, 1)
    for name, least in (("wall_limit_s", math.ulp(0.0)), ("stop_after_s", 0.0)):
        limit_s = getattr(args, name)
        if limit_s is not None and not least <= limit_s < math.inf:
            raise SettingError(name, limit_s, "a number > 0" if least else "a number ≥ 0")
    given_all = given_values(Args, words)
    given = given_all.get("task", {})
    if args.suite is not None:
        suite = find_suite(args.suite, args.quick)
        pinned = {**given, **{name: given_all[name] for name in _PINNED if name in given_all}}
        for name, value in pinned.items():
            while isinstance(value, dict):
                inner, value = next(iter(value.items()))
                name = inner if name == "world_file" else f"{name}.{inner}"
            raise SettingError(name, value, "no value beside --suite, which pins it")
        chosen = chosen_strategies(args.strategies, suite, alone=args.entry is not None)
        return dataclasses.replace(suite, strategies=chosen), []
    if args.world_scenario is not None and (args.scenarios is not None or not args.task.world):
        allowed = "no value without --world, or with --scenarios"
        raise SettingError("world_scenario", args.world_scenario, allowed)
    if args.world_scenario is not None and args.world_scenario not in SCENARIOS:
        raise SettingError("world_scenario", args.world_scenario, one_of(args.world_scenario, SCENARIOS))
    strategies = chosen_strategies(args.strategies)
    robots, names, refused = args.robots or default_sizes(args.task, args.quick), args.scenarios, []
    if is_whole_scenario(args.task.settings):
        if names is not None:
            raise SettingError("scenarios", names, "no value: --settings holds a scenario of its own")
        tasks = scenario_tasks(None, given, robots, missions)
    elif args.task.world and names is None:
        tasks, refused = world_tasks(args.world_scenario, given, robots, missions)
    else:
        names = (QUICK_SCENARIOS if args.quick else DEFAULT_SCENARIOS) if names is None else names
        tasks = scenario_tasks(names, given, robots, missions)
    return Suite("own", "Scenarios of one's own", tasks, strategies), refused


def chosen_strategies(words: str | None, suite: Suite | None = None, alone: bool = False) -> tuple[str, ...]:
    """Return strategies from names with commas between them.

    Args:
        words: Names; `all` = every one; None = those of the suite's table, without a suite every one.
        suite: The strategy that ratios are relative to is added, without a suite the random walk.
        alone: Add none.

    Raises:
        SettingError: No strategy has such a name.
    """
    if words is None and suite is not None:
        names = list(suite.strategies)
    else:
        names = list(STRATEGIES) if words in (None, "all") else words.split(",")
    for name in names:
        make_strategy(name)
    if suite is None:
        added = [BASELINE]
    else:
        added = [] if alone or suite.name == "faults" else [suite.reference]
    return tuple(dict.fromkeys([*added, *map(resolved, names)]))


if __name__ == "__main__":
    raise SystemExit(run_command(main))
