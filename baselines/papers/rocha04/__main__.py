"""Rocha04 reproduced: `python -m baselines.papers.rocha04 [--quick] [--out DIR] [--json]`.

Runs the paper's missions (one robot; teams of 2-4 for each burst and I_min of table 2), a random walk
beside them, and the room with one thing changed at a time; writes tables 1-2, figures 3-8 and the
claims. Missions are kept under `--runs`: a stopped experiment goes on where it was.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from baselines.cli.arguments import parse, run_command
from baselines.experiments.cells import run_cells
from baselines.experiments.reproduction import (
    PaperArgs,
    Reproduced,
    check_counts,
    command_line,
    reproduce,
)
from baselines.papers.rocha04.claims import all_claims
from baselines.papers.rocha04.sweep import experiment

_STARTS = 100
_QUICK_STARTS, _QUICK_SINGLE_STARTS = 10, 30


@dataclass
class Args(PaperArgs):
    """Reproduce Rocha, Dias and Carvalho 2004."""

    quick: bool = False
    """Fewer starts, and nothing changed one at a time: under a minute."""
    out: Path = Path("results/rocha04")
    runs: Path = Path("results/rocha04-runs")
    starts: int | None = None
    """Missions a cell, the same seeds in every cell; default: 100, with --quick 10 (one robot: 30)."""


def main(words: Sequence[str]) -> int:
    """Run the command."""
    args = parse(Args, words, description=__doc__)
    check_counts(args, starts=1)
    return reproduce("Rocha04", args, lambda: _reproduced(args))


def _reproduced(args: Args) -> Reproduced:
    from baselines.papers.rocha04.report import write_report  # matplotlib: after the help

    starts = args.starts or (_QUICK_STARTS if args.quick else _STARTS)
    single_starts = args.starts or (_QUICK_SINGLE_STARTS if args.quick else _STARTS)
    cells = experiment(starts, single_starts, changes=not args.quick)
    records = run_cells(cells, args.runs, args.workers, "Rocha04", quiet=args.json)
    claims = all_claims(records)
    return Reproduced(write_report(args.out, records, claims, command_line("rocha04", args)), claims)


if __name__ == "__main__":
    raise SystemExit(run_command(main))
