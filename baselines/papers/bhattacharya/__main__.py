"""Bhattacharya 2010 reproduced: `python -m baselines.papers.bhattacharya [--quick] [--out DIR] [--json]`.

Covers a known office with both controls, explores unknown plans over sensor ranges and with one thing
changed at a time, splits an unknown region, and runs the strategy in this package's missions; writes figures
2, 3, 4 and 6 and the claims. Runs are kept under `--runs`: a stopped experiment goes on where it was.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from baselines.cli.arguments import parse, run_command
from baselines.experiments.cells import run_cells
from baselines.experiments.mission import Record
from baselines.experiments.ray_cluster import RayCluster
from baselines.experiments.reproduction import (
    PaperArgs,
    Reproduced,
    check_counts,
    command_line,
    reproduce,
)
from baselines.papers.bhattacharya.claims import all_claims
from baselines.papers.bhattacharya.missions import channel_claims, mission_cells
from baselines.papers.bhattacharya.run import Run, start_cells
from baselines.papers.bhattacharya.simulation.team import Simulation
from baselines.papers.bhattacharya.splitting import ratios
from baselines.papers.bhattacharya.sweep import all_runs, kept_records
from baselines.papers.bhattacharya.timing import Seconds, beside_scipy, changed_share
from entropy_explore_env.errors import SettingError


@dataclass
class Args(PaperArgs):
    """Reproduce Bhattacharya, Michael and Kumar 2010."""

    quick: bool = False
    """Small plans alone, fewer seeds, no flying teams: a few minutes."""
    out: Path = Path("results/bhattacharya")
    runs: Path = Path("results/bhattacharya-runs")
    """Folder that keeps the runs."""
    jobs: int | None = None
    """Missions at a time; default: 1, on a cluster one a processor."""
    starts: int | None = None
    """Runs of (a) for each control and kind of start; default: 20, with --quick 5."""
    plans: int | None = None
    """Plans of 1000 × 783 cells of (b), of each width of rooms; default: 1, with --quick 0."""
    small_plans: int | None = None
    """Plans of 333 × 261 cells of (b); default: 10, with --quick 1."""
    missions: int | None = None
    """Missions of (e), four times as many of (f); default: 5, with --quick 1, and no (e). 0 = none."""
    corridor: Path | None = None
    """An OctoMap of a real corridor for (e), such as geb079.bt."""


class Amounts(NamedTuple):
    """How much is run."""

    starts: int
    plans: int
    small_plans: int
    missions: int


_FULL, _QUICK = Amounts(20, 1, 10, 5), Amounts(5, 0, 1, 1)


def main(words: Sequence[str]) -> int:
    """Run the command."""
    args = parse(Args, words, description=__doc__)
    check_counts(args, starts=1, plans=0, small_plans=1, missions=0)
    if args.corridor is not None and not args.corridor.is_file():
        raise SettingError("corridor", str(args.corridor), "a file")
    return reproduce("Bhattacharya", args, lambda: _reproduced(args))


def _reproduced(args: Args) -> Reproduced:
    from baselines.papers.bhattacharya.report import Results, write_report  # matplotlib: after the help

    amounts = _amounts(args)
    runs = all_runs(amounts.starts, amounts.plans, amounts.small_plans)
    records = kept_records(runs, args.runs, _workers(args), quiet=args.json)
    missions = _missions(args, amounts.missions)
    splits, measured = ratios(), _measured(runs)
    claims = [
        *all_claims(records, splits, measured.seconds),
        *(channel_claims(missions) if missions else []),
    ]
    results = Results(runs, records, splits, measured.seconds, measured.changed, missions, args.runs)
    return Reproduced(write_report(args.out, results, claims, command_line("bhattacharya", args)), claims)


def _workers(args: Args) -> int | RayCluster:
    """One process, if nothing else is asked for: a run is large."""
    return 1 if args.jobs is None and args.cluster is None else args.workers


def _amounts(args: Args) -> Amounts:
    """What was asked for, else the usual amounts."""
    usual = (_QUICK if args.quick else _FULL)._asdict()
    given = {name: getattr(args, name) for name in usual}
    return Amounts(**{name: usual[name] if value is None else value for name, value in given.items()})


def _missions(args: Args, count: int) -> dict[str, list[Record]]:
    """Records of the missions of (e), unless quick, and of (f)."""
    cells = mission_cells(count, args.corridor) if count else []
    cells = [cell for cell in cells if not (args.quick and cell.id.startswith("flying"))]
    return run_cells(cells, args.runs, _workers(args), "missions", args.json) if cells else {}


class _Measured(NamedTuple):
    """Seconds of a tessellation of the largest plan; what share of a small one's cells changes."""

    seconds: Seconds
    changed: float


def _measured(runs: Sequence[Run]) -> _Measured:
    unknown = [run for run in runs if not run.known]
    plan = max((run.plan() for run in unknown), key=np.size)
    costs = np.where(plan, np.inf, 1.0).astype(np.float32)
    seconds = beside_scipy(costs, np.array(start_cells(plan, "random", 4, 0)))
    run = next(run for run in unknown if run.id.startswith("exploration-small-paper"))
    starts = start_cells(run.plan(), run.starts, run.robots, run.seed)
    return _Measured(seconds, changed_share(Simulation(run.plan(), starts, run.rules), 200))


if __name__ == "__main__":
    raise SystemExit(run_command(main))
