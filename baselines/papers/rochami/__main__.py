"""RochaMI reproduced: `python -m baselines.papers.rochami [--quick] [--out DIR] [--json]`.

Runs teams of 1-10 ground robots in the laboratory, coordinated by mutual information, uncoordinated and at
random, behind each other waiting or wandering; the cost of distance; one thing changed at a time; and a
steered I_min in Rocha04's room. Writes figures 6 and 7, three more, and the claims. Missions are kept under
`--runs`: a stopped experiment goes on where it was.
"""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from baselines.cli.arguments import make_folder, parse, run_command
from baselines.experiments.cells import run_cells
from baselines.papers.rochami.claims import all_claims
from baselines.papers.rochami.sweep import experiment
from entropy_explore_env.validation import check_whole

_STARTS, _QUICK_STARTS = 50, 10


@dataclass
class Args:
    """Reproduce Rocha, Efficient Information Sharing and Coordination."""

    quick: bool = False
    """Fewer starts, team sizes and changes: a minute or two."""
    out: Path = Path("results/rochami")
    """Folder for the report, its figures and tables."""
    runs: Path = Path("results/rochami-runs")
    """Folder that keeps the missions."""
    starts: int | None = None
    """Missions a cell, the same seeds in every cell; default: 50, with --quick 10."""
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
    from baselines.papers.rochami.report import write_report

    for name, value, least in (("starts", args.starts, 2), ("jobs", args.jobs, 1)):
        if value is not None:
            check_whole(name, value, least)
    make_folder("out", args.out)
    make_folder("runs", args.runs)
    started = time.perf_counter()
    starts = args.starts or (_QUICK_STARTS if args.quick else _STARTS)
    cells = experiment(starts, args.quick)
    records = run_cells(cells, args.runs, args.jobs or os.cpu_count() or 1, "RochaMI", quiet=args.json)
    claims = all_claims(records)
    given = " --quick" * args.quick + (f" --starts {args.starts}" if args.starts else "")
    report = write_report(
        args.out, records, claims, f"python -m baselines.papers.rochami{given} --out {args.out}"
    )
    return report_claims("RochaMI", claims, report, started, args.json, args.strict)


if __name__ == "__main__":
    raise SystemExit(run_command(main))
