"""RochaMI reproduced: `python -m baselines.papers.rochami [--quick] [--out DIR] [--json]`.

Runs teams of 1-10 ground robots in the laboratory, coordinated by mutual information, uncoordinated and at
random, behind each other waiting or wandering; the cost of distance; one thing changed at a time; and a
steered I_min in Rocha04's room. Writes figures 6 and 7, three more, and the claims. Missions are kept under
`--runs`: a stopped experiment goes on where it was.
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
from baselines.papers.rochami.claims import all_claims
from baselines.papers.rochami.sweep import experiment

_STARTS, _QUICK_STARTS = 50, 10


@dataclass
class Args(PaperArgs):
    """Reproduce Rocha, Efficient Information Sharing and Coordination."""

    quick: bool = False
    """Fewer starts, team sizes and changes: a minute or two."""
    out: Path = Path("results/rochami")
    runs: Path = Path("results/rochami-runs")
    starts: int | None = None
    """Missions a cell, the same seeds in every cell; default: 50, with --quick 10."""


def main(words: Sequence[str]) -> int:
    """Run the command."""
    args = parse(Args, words, description=__doc__)
    check_counts(args, starts=2)
    return reproduce("RochaMI", args, lambda: _reproduced(args))


def _reproduced(args: Args) -> Reproduced:
    from baselines.papers.rochami.report import write_report  # matplotlib: after the help

    cells = experiment(args.starts or (_QUICK_STARTS if args.quick else _STARTS), args.quick)
    records = run_cells(cells, args.runs, args.workers, "RochaMI", quiet=args.json)
    claims = all_claims(records)
    return Reproduced(write_report(args.out, records, claims, command_line("rochami", args)), claims)


if __name__ == "__main__":
    raise SystemExit(run_command(main))
