"""Bhattacharya 2010 reproduced: `python -m baselines.papers.bhattacharya [--quick] [--out DIR] [--json]`.

Covers a known office with both controls, explores unknown plans over sensor ranges and with one thing
changed at a time, splits an unknown region, and runs the strategy in this package's missions; writes figures
2, 3, 4 and 6 and the claims. Runs are kept under `--runs`: a stopped experiment goes on where it was.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from baselines.cli.arguments import make_folder, parse, run_command
from baselines.experiments.cells import run_cells
from baselines.papers.bhattacharya.claims import all_claims
from baselines.papers.bhattacharya.missions import channel_claims, mission_cells
from baselines.papers.bhattacharya.simulation.team import Simulation
from baselines.papers.bhattacharya.splitting import ratios
from baselines.papers.bhattacharya.sweep import Run, all_runs, run_all, start_cells
from baselines.papers.bhattacharya.timing import beside_scipy, changed_share
from entropy_explore_env.errors import SettingError
from entropy_explore_env.validation import check_whole


@dataclass
class Args:
    """Reproduce Bhattacharya, Michael and Kumar 2010."""

    quick: bool = False
    """Small plans alone, fewer seeds, no flying teams: a few minutes."""
    out: Path = Path("results/bhattacharya")
    """Folder for the report and its figures."""
    runs: Path = Path("results/bhattacharya-runs")
    """Folder that keeps the runs."""
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
    jobs: int = 1
    """Processes."""
    json: bool = False
    """Print one JSON object and nothing else."""
    strict: bool = False
    """Exit with 1 if a claim does not hold."""


def main(words: Sequence[str]) -> int:
    """Run the command."""
    args = parse(Args, words, description=__doc__)
    from baselines.experiments.claims import report_claims
    from baselines.papers.bhattacharya.report import Results, write_report  # matplotlib: after the help

    chosen, given = _chosen(args)
    if args.corridor is not None and not args.corridor.is_file():
        raise SettingError("corridor", str(args.corridor), "a file")
    make_folder("out", args.out)
    make_folder("runs", args.runs)
    started = time.perf_counter()
    runs = all_runs(chosen["starts"], chosen["plans"], chosen["small_plans"])
    records = run_all(runs, args.runs, args.jobs, args.json)
    missions = chosen["missions"]
    cells = mission_cells(missions, args.corridor) if missions else []
    if args.quick:
        cells = [cell for cell in cells if not cell.id.startswith("flying")]
    flown = run_cells(cells, args.runs, args.jobs, "missions", args.json) if cells else {}
    splits, (timing, changed) = ratios(), _measured(runs)
    claims = [*all_claims(records, splits, timing), *(channel_claims(flown) if flown else [])]
    given += f" --corridor {args.corridor.name}" if args.corridor else ""
    command = f"python -m baselines.papers.bhattacharya{' --quick' * args.quick}{given} --out {args.out}"
    results = Results(runs, records, splits, timing, changed, flown, args.runs)
    report = write_report(args.out, results, claims, command)
    return report_claims("Bhattacharya", claims, report, started, args.json, args.strict)


_DEFAULTS = {
    "starts": (20, 5, 1),
    "plans": (1, 0, 0),
    "small_plans": (10, 1, 1),
    "missions": (5, 1, 0),
    "jobs": (1, 1, 1),
}
"""In full, with --quick, and the least that can be asked for."""


def _chosen(args: Args) -> tuple[dict[str, int], str]:
    """How much is run, and the options that say so."""
    chosen, given = {}, ""
    for name, (full, quick, least) in _DEFAULTS.items():
        value, option = getattr(args, name), name.replace("_", "-")
        if value is not None:
            check_whole(option, value, least)
        chosen[name] = (quick if args.quick else full) if value is None else value
        given += f" --{option} {value}" if value is not None and name != "jobs" else ""
    return chosen, given


def _measured(runs: Sequence[Run]) -> tuple[tuple[float, float], float]:
    """Seconds beside SciPy's on the largest plan, and the share of cells that change, on a small one."""
    unknown = [run for run in runs if not run.known]
    plan = max((run.plan() for run in unknown), key=np.size)
    rates = np.where(plan, np.inf, 1.0).astype(np.float32)
    timing = beside_scipy(rates, np.array(start_cells(plan, "random", 4, 0)))
    run = next(run for run in unknown if run.id.startswith("exploration-small-paper"))
    starts = start_cells(run.plan(), run.starts, run.robots, run.seed)
    return timing, changed_share(Simulation(run.plan(), starts, run.rules), 200)


if __name__ == "__main__":
    raise SystemExit(run_command(main))
