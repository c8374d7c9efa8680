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
    """Names, commas between; `office:4` or `office:2+4` for team sizes of its own."""
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
    usual, teams = _sizes("robots", args.robots, ","), []
    for each in args.scenarios.split(","):
        name, colon, own = each.partition(":")
        teams += [(name, size) for size in (_sizes("scenarios", own, "+") if colon else usual)]
    strategies = tuple(dict.fromkeys(resolved(name) for name in args.strategies.split(",")))
    for name in strategies:
        make_strategy(name)
    teams = list(dict.fromkeys(teams))
    if args.quick:
        teams, strategies = [team for team in teams if team[0] == teams[0][0]][-1:], strategies[:2]
    seeds = args.seeds or (_QUICK_SEEDS if args.quick else _SEEDS)
    return checked(Experiment(tuple(teams), strategies, seeds, args.time_limit_s))


def _sizes(option: str, text: str, between: str) -> list[int]:
    """Team sizes.

    Raises:
        SettingError: They are no numbers.
    """
    sizes = text.split(between)
    if not all(size.isascii() and size.isdigit() for size in sizes):
        raise SettingError(option, text, f"whole numbers from 2 to 1000, with {between} between")
    return [int(size) for size in sizes]


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
    words += [f"--scenarios {args.scenarios}", f"--robots {args.robots}"]
    if experiment.strategies != STRATEGIES:
        words.append(f"--strategies {','.join(experiment.strategies)}")
    return " ".join([*words, f"--seeds {experiment.seeds}", f"--time-limit-s {experiment.time_limit_s:g}"])


if __name__ == "__main__":
    raise SystemExit(run_command(main))
