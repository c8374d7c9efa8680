"""Rocha04 reproduced: `python -m baselines.papers.rocha04 [--quick] [--out DIR] [--json]`.

Runs the paper's missions (one robot; teams of 2-4 for each burst and I_min of table 2), a random walk
beside them, and the room with one thing changed at a time; writes tables 1-2, figures 3-8 and the
claims. Missions are kept under `--runs`: a stopped experiment goes on where it was.
"""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from baselines.cli.arguments import make_folder, parse, run_command
from baselines.experiments.cells import run_cells
from baselines.papers.rocha04.claims import all_claims
from baselines.papers.rocha04.sweep import experiment
from entropy_explore_env.validation import check_whole

_STARTS = 100
_QUICK_STARTS, _QUICK_SINGLE_STARTS = 10, 30


@dataclass
class Args:
    """Reproduce Rocha, Dias and Carvalho 2004."""

    quick: bool = False
    """Fewer starts, and nothing changed one at a time: under a minute."""
    out: Path = Path("results/rocha04")
    """Folder for the report, its figures and tables."""
    runs: Path = Path("results/rocha04-runs")
    """Folder that keeps the missions."""
    starts: int | None = None
    """Missions a cell, the same seeds in every cell; default: 100, with --quick 10 (one robot: 30)."""
    jobs: int | None = None
    """Processes; default: one a processor."""
    json: bool = False
    """Print one JSON object and nothing else."""
    strict: bool = False
    """Exit with 1 if a claim does not hold."""


def main(words: Sequence[str]) -> int:
    """Run the command."""
    args = parse(Args, words, description=__doc__)
    from baselines.experiments.claims import report_claims
    from baselines.papers.rocha04.report import write_report  # matplotlib: after the help

    for name, value in (("starts", args.starts), ("jobs", args.jobs)):
        if value is not None:
            check_whole(name, value, 1)
    make_folder("out", args.out)
    make_folder("runs", args.runs)
    started = time.perf_counter()
    starts = args.starts or (_QUICK_STARTS if args.quick else _STARTS)
    single_starts = args.starts or (_QUICK_SINGLE_STARTS if args.quick else _STARTS)
    cells = experiment(starts, single_starts, changes=not args.quick)
    jobs = args.jobs or os.cpu_count() or 1
    records = run_cells(cells, args.runs, jobs, "Rocha04", quiet=args.json)
    claims = all_claims(records)
    given = " --quick" * args.quick + (f" --starts {args.starts}" if args.starts else "")
    command = f"python -m baselines.papers.rocha04{given} --out {args.out}"
    report = write_report(args.out, records, claims, command)
    return report_claims("Rocha04", claims, report, started, args.json, args.strict)


if __name__ == "__main__":
    raise SystemExit(run_command(main))
