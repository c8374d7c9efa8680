"""Strategies compared: `python -m baselines.benchmark --suite plans`, or `--scenarios room,office`.

A suite is a set of worlds, starts and seeds that is pinned (scoreboard/suites.py). Every strategy runs the
same missions; written are a page with tables and figures. Missions are kept, a file each: an interrupted run
resumes and ends with the same page, byte for byte. Mission k of all tasks and strategies is run before any
mission k + 1, so that a page of a part is fair. A mission that raises an error or runs past its limit is a
row with the reason.
"""

from __future__ import annotations

import math
import os
import shlex
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from baselines.cli.arguments import make_folder, parse, print_json, run_command
from baselines.experiments.cells import run_cells
from baselines.scoreboard.chosen import chosen_scenarios, chosen_strategies, own_tasks
from baselines.scoreboard.suites import Suite, find_suite
from entropy_explore_env.command import allow_read_memory
from entropy_explore_env.errors import SettingError
from entropy_explore_env.scenarios import SCENARIOS
from entropy_explore_env.validation import check_whole

_SCENARIOS = "room,room-furnished,lab,office,cave"
_MOST_ROBOTS = 1000


@dataclass
class Args:
    """Compare strategies."""

    suite: str | None = None
    """plans, volumes or teams: worlds and starts that are pinned."""
    scenarios: str | None = None
    """In place of a suite: names and world files, commas between; default:
    room,room-furnished,lab,office,cave."""
    strategies: str = "all"
    """Names as in baselines.run, commas between; what ratios are relative to is always added."""
    robots: str | None = None
    """Team sizes of scenarios, commas between; default: 1,2,4."""
    seeds: int | None = None
    """Missions of every strategy in every scenario and team size; default: 30."""
    quick: bool = False
    """A suite of few worlds and starts; without a suite room,office, team sizes 1,2, 5 seeds, where they are
    not given."""
    world_scenario: str | None = None
    """Scenario that gives robots and sensors for world files; default: office for plans, else room."""
    read_memory_mib: float | None = None
    """MiB of memory that reading a world file may take; default: by the file's size."""
    time_limit_s: float | None = None
    """Simulated time after which missions in scenarios are cut off; default: each scenario's own."""
    wall_limit_s: float = 600.0
    """Time on the clock after which a mission is ended, and counts as failed."""
    stop_after_s: float | None = None
    """Time on the clock after which no mission is begun any more; the page then holds what was run, and the
    same command goes on."""
    confirm: bool = False
    """Keep missions that other code ran, of each strategy and task whose first mission comes out the same
    when it is run again; else a change of the code runs all again."""
    jobs: int | None = None
    """Processes; default: one a processor."""
    out: Path = Path("results/scoreboard")
    """Folder for scoreboard.md and, in scoreboard, its tables and figures."""
    runs: Path | None = None
    """Folder that keeps the missions; default: runs in --out."""
    json: bool = False
    """Print one JSON object and nothing else."""


def main(words: Sequence[str]) -> int:
    """Run the command."""
    args = parse(Args, words, description=__doc__)
    allow_read_memory(args.read_memory_mib)
    suite = _suite(args)
    from baselines.scoreboard.page import write_page  # matplotlib: after the help
    from baselines.scoreboard.results import Results
    from baselines.scoreboard.terminal import printed_results, show_results

    runs = args.runs or args.out / "runs"
    make_folder("out", args.out)
    make_folder("runs", runs)
    started = time.perf_counter()
    records = run_cells(
        suite.cells,
        runs,
        args.jobs or os.cpu_count() or 1,
        f"suite {suite.name}" if args.suite else "strategies",
        quiet=args.json,
        limit_s=args.wall_limit_s,
        keep_failures=True,
        stop_after_s=math.inf if args.stop_after_s is None else args.stop_after_s,
        confirm=args.confirm,
    )
    results = Results(suite, records)
    if not any(results.of(task, strategy) for task in suite.tasks for strategy in suite.strategies):
        print("nothing to write: no mission was run", file=sys.stderr)
        return 0
    page = write_page(args.out, results, _command(args, suite))
    if args.json:
        print_json({**printed_results(results), "wall_s": round(time.perf_counter() - started, 1)})
    else:
        show_results(results)
        print(f"written: {page}, its tables and figures beside it", file=sys.stderr)
    return 0


def _suite(args: Args) -> Suite:
    """What the options ask for.

    Raises:
        SettingError: An option has a value that is not allowed, or does not go with a suite.
    """
    seeds = args.seeds if args.seeds is not None else (5 if args.quick else 30)
    for name, value in (("seeds", seeds), ("jobs", args.jobs)):
        if value is not None:
            check_whole(name, value, 1)
    for name in ("time_limit_s", "wall_limit_s", "stop_after_s"):
        limit_s = getattr(args, name)
        if limit_s is not None and not 0.0 < limit_s < math.inf:
            raise SettingError(name, limit_s, "a number > 0")
    if args.suite is not None:
        pinned = ("scenarios", "robots", "seeds", "world_scenario", "time_limit_s")
        for name in pinned:
            if getattr(args, name) is not None:
                raise SettingError(name, getattr(args, name), "left out together with --suite, which pins it")
        return find_suite(args.suite, args.quick, chosen_strategies(args.strategies, suite=True))
    if args.world_scenario is not None and args.world_scenario not in SCENARIOS:
        raise SettingError("world_scenario", args.world_scenario, "one of " + ", ".join(SCENARIOS))
    robots = _team_sizes(args.robots if args.robots is not None else ("1,2" if args.quick else "1,2,4"))
    wanted = args.scenarios if args.scenarios is not None else ("room,office" if args.quick else _SCENARIOS)
    scenarios = chosen_scenarios(wanted, args.world_scenario, args.time_limit_s)
    return Suite("own", own_tasks(scenarios, robots, seeds), chosen_strategies(args.strategies, suite=False))


def _team_sizes(words: str) -> tuple[int, ...]:
    sizes = tuple(int(word) for word in words.split(",") if word.isascii() and word.isdigit())
    distinct = len(set(sizes)) == len(sizes) == len(words.split(","))
    if not distinct or not all(1 <= size <= _MOST_ROBOTS for size in sizes):
        raise SettingError(
            "robots", words, f"different whole numbers from 1 to {_MOST_ROBOTS}, commas between"
        )
    return sizes


def _command(args: Args, suite: Suite) -> str:
    """What makes the same page again, wherever the world files lie."""
    given: dict[str, str | None] = {"strategies": args.strategies}
    if args.suite is not None:
        given = {"suite": args.suite, **given}
    else:
        scenarios = args.scenarios or ",".join(dict.fromkeys(task.scenario.name for task in suite.tasks))
        given |= {
            "scenarios": ",".join(Path(word).name for word in scenarios.split(",")),
            "robots": ",".join(map(str, dict.fromkeys(task.scenario.robots for task in suite.tasks))),
            "seeds": str(suite.tasks[0].missions),
            "world-scenario": args.world_scenario,
            "time-limit-s": None if args.time_limit_s is None else f"{args.time_limit_s:g}",
        }
    options = [f"--{name} {shlex.quote(value)}" for name, value in given.items() if value is not None]
    flags = ["--quick"] if args.quick and args.suite is not None else []
    flags += ["--confirm"] if args.confirm else []
    return " ".join(["python -m baselines.benchmark", *options, *flags])


if __name__ == "__main__":
    raise SystemExit(run_command(main))
