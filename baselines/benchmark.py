"""Strategies compared: `python -m baselines.benchmark --suite plans`, or `--scenarios room,office`.

A suite is a set of worlds, starts and seeds that is pinned (scoreboard/suites.py). Every strategy runs the
same missions. Written are a page with tables and figures. Missions are kept, a file each: an interrupted run
resumes and ends with the same page, byte for byte. `missions.jsonl.xz` beside a suite's tables holds them
all: with `--archive FILE` another run begins with them, to go on or to add a strategy. Mission k of all tasks
and strategies is run before any mission k + 1, so that a page of a part is fair. A mission that raises an
error or runs past its limit is a row with the reason. In suites, a strategy that finishes none of its first
three missions of a task is not run further there.
"""

from __future__ import annotations

import dataclasses
import math
import shlex
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from baselines.cli.arguments import INLINE, make_folder, parse, print_json, run_command
from baselines.cli.task_options import (
    TaskOptions,
    base_task,
    files_told_apart,
    first_change,
    is_whole_scenario,
    parsed_for,
    words_of,
)
from baselines.cli.worker_options import WorkerOptions
from baselines.experiments.archive import read_archive, write_archive
from baselines.experiments.cells import missions_of, run_cells
from baselines.scoreboard.chosen import (
    Entry,
    Mission,
    chosen_entries,
    chosen_strategies,
    entry_mission,
    own_tasks,
)
from baselines.scoreboard.suites import Suite, find_suite
from entropy_explore_env.errors import SettingError, one_of
from entropy_explore_env.scenarios import SCENARIOS
from entropy_explore_env.validation import check_whole

_SCENARIOS = "room,room-furnished,lab,office,cave"
_MOST_ROBOTS = 1000
_TRIES = 3
"""Missions of a suite's task after which a strategy that finished none is not run further there."""


@dataclass
class Args(WorkerOptions):
    """Compare strategies."""

    suite: str | None = None
    """plans, volumes, teams or others: worlds and starts that are pinned."""
    scenarios: str | None = None
    """In place of a suite: names and world files, commas between, each changed by the options of the task;
    default: room,room-furnished,lab,office,cave, or the scenario that --settings holds as a whole."""
    strategies: str | None = None
    """Names as in baselines.run, commas between, or all; nearest-frontier is added in suites, random else.
    Default: those that the suite's table compares; without a suite all."""
    robots: str | None = None
    """Team sizes of scenarios, commas between; default: 1,2,4, or that of the scenario in --settings."""
    seeds: int | None = None
    """Missions of every strategy in every scenario and team size; default: 30."""
    quick: bool = False
    """A suite of few worlds and starts; without a suite room,office, team sizes 1,2, 5 seeds, where they are
    not given."""
    world_scenario: str | None = None
    """Scenario that gives robots and sensors for world files; default: office for plans, else room."""
    task: Annotated[TaskOptions, INLINE] = dataclasses.field(default_factory=TaskOptions)
    wall_limit_s: float = 600.0
    """Time on the clock after which a mission is ended, and counts as failed."""
    stop_after_s: float | None = None
    """Time on the clock after which no mission is begun any more; the page then holds what was run, and the
    same command goes on."""
    confirm: bool = False
    """Keep missions that other code ran, of each strategy and task whose first mission comes out the same
    when it is run again; else a change of the code runs all again."""
    archive: Path | None = None
    """missions.jsonl.xz of an earlier run: its missions of the same settings are not run again; what other
    code ran counts with --confirm."""
    out: Path = Path("results/scoreboard")
    """Folder for scoreboard.md and, in scoreboard, its tables and figures."""
    runs: Path | None = None
    """Folder that keeps the missions; default: runs in --out."""
    json: bool = False
    """Print one JSON object and nothing else."""


def main(words: Sequence[str]) -> int:
    """Run the command."""
    args = parse(Args, words, description=__doc__)
    (suite, changes), workers = _suite(args, words), args.workers
    from baselines.scoreboard.page import ARCHIVE, FILES, write_page  # matplotlib: after the help
    from baselines.scoreboard.results import Results
    from baselines.scoreboard.terminal import broken, printed_results, show_results

    runs = args.runs or args.out / "runs"
    make_folder("out", args.out)
    make_folder("runs", runs)
    missions = missions_of(suite.cells)
    if args.archive is not None:
        taken = read_archive(args.archive, runs, missions)
        print(f"{taken:,} missions taken from {args.archive}", file=sys.stderr)
    started = time.perf_counter()
    records = run_cells(
        suite.cells,
        runs,
        workers,
        f"suite {suite.name}" if args.suite else "strategies",
        quiet=args.json,
        limit_s=args.wall_limit_s,
        keep_failures=True,
        stop_after_s=math.inf if args.stop_after_s is None else args.stop_after_s,
        confirm=args.confirm,
        tries=None if args.suite is None else _TRIES,
    )
    results = Results(suite, records)
    if not any(results.of(task, strategy) for task in suite.tasks for strategy in suite.strategies):
        print("nothing to write: no mission was run", file=sys.stderr)
        return 0
    page = write_page(args.out, results, _command(args, suite, changes))
    write_archive(page.parent / FILES / suite.name / ARCHIVE, runs, missions)
    if args.json:
        print_json({**printed_results(results), "wall_s": round(time.perf_counter() - started, 1)})
    else:
        show_results(results)
        print(f"written: {page}, its tables and figures beside it", file=sys.stderr)
    if names := broken(results):
        print(f"error: every mission of {', '.join(names)} raised an error", file=sys.stderr)
        return 1
    return 0


def _suite(args: Args, words: Sequence[str]) -> tuple[Suite, list[str]]:
    """What the options ask for, and those of them that change scenarios, as words.

    Raises:
        SettingError: An option has a value that is not allowed, or does not go with a suite.
        WorldError: A world file cannot be used.
    """
    seeds = args.seeds if args.seeds is not None else (5 if args.quick else 30)
    check_whole("seeds", seeds, 1)
    for name in ("wall_limit_s", "stop_after_s"):
        limit_s = getattr(args, name)
        if limit_s is not None and not 0.0 < limit_s < math.inf:
            raise SettingError(name, limit_s, "a number > 0")
    if args.suite is not None:
        pinned = [(name, getattr(args, name)) for name in ("scenarios", "robots", "seeds", "world_scenario")]
        changed = first_change(args.task)
        for name, value in [*pinned, *([] if changed is None else [changed])]:
            if value is not None:
                raise SettingError(name, value, "left out together with --suite, which pins it")
        strategies = chosen_strategies(args.strategies, args.suite)
        return find_suite(args.suite, args.quick, strategies), []
    if args.world_scenario is not None and args.world_scenario not in SCENARIOS:
        raise SettingError("world_scenario", args.world_scenario, one_of(args.world_scenario, SCENARIOS))
    strategies = chosen_strategies(args.strategies)
    missions: dict[str, list[Mission]] = {}
    changes: dict[str, list[str]] = {}
    for name, entry in _entries(args).items():
        task = base_task(entry.scenario, args.task.settings)
        options = parsed_for(task, args, words, __doc__).task
        changes |= words_of(options, task)
        missions[name] = [entry_mission(entry, task, options, team) for team in _team_sizes(args)]
        if (limit_s := missions[name][0].scenario.ending.time_limit_s) == math.inf:
            raise SettingError("time_limit_s", limit_s, "finite, so that every mission ends")
    tasks = own_tasks(missions, seeds)
    return Suite("own", tasks, strategies), [word for option in changes.values() for word in option]


def _entries(args: Args) -> dict[str, Entry]:
    """The scenarios that are asked for."""
    settings = args.task.settings
    if is_whole_scenario(settings):
        if args.scenarios is not None:
            allowed = "left out: --settings holds a scenario of its own"
            raise SettingError("scenarios", args.scenarios, allowed)
        scenario = base_task("room", settings).scenario
        return {scenario.name: Entry(scenario)}
    wanted = args.scenarios if args.scenarios is not None else ("room,office" if args.quick else _SCENARIOS)
    return chosen_entries(wanted, args.world_scenario)


def _team_sizes(args: Args) -> tuple[int, ...]:
    """The team sizes that are asked for."""
    if args.robots is None and is_whole_scenario(args.task.settings):
        return (base_task("room", args.task.settings).scenario.robots,)
    words = args.robots if args.robots is not None else ("1,2" if args.quick else "1,2,4")
    sizes = tuple(int(word) for word in words.split(",") if word.isascii() and word.isdigit())
    distinct = len(set(sizes)) == len(sizes) == len(words.split(","))
    if not distinct or not all(1 <= size <= _MOST_ROBOTS for size in sizes):
        raise SettingError(
            "robots", words, f"different whole numbers from 1 to {_MOST_ROBOTS}, commas between"
        )
    return sizes


def _command(args: Args, suite: Suite, changes: Sequence[str]) -> str:
    """What makes the same page again, wherever the world files lie: no more of a path than tells it apart."""
    given: dict[str, str | None] = {"strategies": args.strategies}
    if args.suite is not None:
        given = {"suite": args.suite, **given}
    else:
        scenarios = args.scenarios or ",".join(dict.fromkeys(task.scenario.name for task in suite.tasks))
        asked = scenarios.split(",")
        files = [word for word in asked if word not in SCENARIOS]
        told = dict(zip(files, files_told_apart(files), strict=True))
        alone = is_whole_scenario(args.task.settings)
        given |= {
            "scenarios": None if alone else ",".join(told.get(word, word) for word in asked),
            "robots": ",".join(map(str, dict.fromkeys(task.scenario.robots for task in suite.tasks))),
            "seeds": str(suite.tasks[0].missions),
            "world-scenario": args.world_scenario,
        }
    options = [f"--{name} {shlex.quote(value)}" for name, value in given.items() if value is not None]
    changed = [shlex.join(changes)] if changes else []
    flags = ["--quick"] if args.quick and args.suite is not None else []
    flags += ["--confirm"] if args.confirm else []
    return " ".join(["python -m baselines.benchmark", *options, *changed, *flags])


if __name__ == "__main__":
    raise SystemExit(run_command(main))
