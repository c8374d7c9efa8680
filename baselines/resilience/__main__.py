"""Teams whose robots and messages fail: `python -m baselines.resilience [--quick] [--out DIR] [--json]`.

Runs every team strategy with 0-90 % of messages lost, without shared measurements, with a short range, with
line of sight only, with one robot lost at half time, and in isolation, by the same seeds. Writes degradation
curves with intervals, and what teams are held to. Missions are kept under `--runs`: a stopped experiment goes
on where it was. A mission that raises an error or runs past `--wall-limit-s` is kept as failed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from baselines.cli.arguments import parse, run_command
from baselines.experiments.cells import Cell, run_cells
from baselines.experiments.reproduction import PaperArgs, Reproduced, check_counts, reproduce
from baselines.resilience.sweep import STRATEGIES, Experiment, Records, checked
from baselines.strategies import make_strategy, resolved
from entropy_explore_env.errors import SettingError

_SEEDS, _QUICK_SEEDS = 5, 2


@dataclass
class Args(PaperArgs):
    """Measure what faults cost teams."""

    quick: bool = False
    """Two strategies in the room, one team size, two seeds."""
    out: Path = Path("results/resilience")
    runs: Path = Path("results/resilience-runs")
    scenarios: str = "room,office"
    """Names, commas between."""
    strategies: str = ",".join(STRATEGIES)
    """Names as in baselines.run, commas between."""
    robots: str = "2,4"
    """Team sizes, commas between."""
    seeds: int | None = None
    """Missions a cell, the same seeds in every cell; default: 5, with --quick 2."""
    time_limit_s: float = 300.0
    """Simulated time after which missions are cut off."""
    wall_limit_s: float = 300.0
    """Time on the clock after which a mission is ended, and counts as failed."""
    confirm: bool = False
    """Keep missions that other code ran, of each strategy and team whose first mission comes out the same
    when it is run again; else a change of the code runs all again."""


def main(words: Sequence[str]) -> int:
    """Run the command."""
    args = parse(Args, words, description=__doc__)
    check_counts(args, seeds=2)
    for name in ("time_limit_s", "wall_limit_s"):
        if not 0.0 < getattr(args, name) < math.inf:
            raise SettingError(name, getattr(args, name), "a number > 0")
    experiment = _experiment(args)
    return reproduce("resilience", args, lambda: _measured(args, experiment))


def _experiment(args: Args) -> Experiment:
    """What the options ask for.

    Raises:
        SettingError: An option has a value that is not allowed.
    """
    sizes = args.robots.split(",")
    if not all(size.isascii() and size.isdigit() for size in sizes):
        raise SettingError("robots", args.robots, "whole numbers from 2 to 1000, commas between")
    strategies = tuple(dict.fromkeys(resolved(name) for name in args.strategies.split(",")))
    for name in strategies:
        make_strategy(name)
    scenarios, robots = tuple(args.scenarios.split(",")), tuple(dict.fromkeys(map(int, sizes)))
    if args.quick:
        scenarios, strategies, robots = scenarios[:1], strategies[:2], robots[-1:]
    seeds = args.seeds or (_QUICK_SEEDS if args.quick else _SEEDS)
    return checked(Experiment(scenarios, strategies, robots, seeds, args.time_limit_s))


def _measured(args: Args, experiment: Experiment) -> Reproduced:
    from baselines.resilience.claims import all_claims  # matplotlib: after the help
    from baselines.resilience.report import write_report

    def run(cells: Sequence[Cell], title: str) -> Records:
        limit_s = args.wall_limit_s
        return run_cells(
            cells,
            args.runs,
            args.workers,
            title,
            args.json,
            limit_s,
            keep_failures=True,
            confirm=args.confirm,
        )

    records = run(experiment.first_cells(), "resilience: channels")
    records |= run(experiment.lost_cells(records), "resilience: a robot lost")
    claims = all_claims(experiment, records)
    return Reproduced(write_report(args.out, experiment, records, claims, _command(args, experiment)), claims)


def _command(args: Args, experiment: Experiment) -> str:
    """What makes the same page again."""
    words = ["python -m baselines.resilience"]
    if args.quick:
        words.append("--quick")
    if args.confirm:
        words.append("--confirm")
    for name, values in (("scenarios", experiment.scenarios), ("robots", experiment.robots)):
        words.append(f"--{name} {','.join(map(str, values))}")
    if experiment.strategies != STRATEGIES:
        words.append(f"--strategies {','.join(experiment.strategies)}")
    return " ".join([*words, f"--seeds {experiment.seeds}", f"--time-limit-s {experiment.time_limit_s:g}"])


if __name__ == "__main__":
    raise SystemExit(run_command(main))
