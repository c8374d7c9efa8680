"""Errors of localization: `python -m baselines.papers.sujan.localization [--quick] [--out DIR] [--json]`.

A robot that drifts maps 100 × 100 m by method (v), with no, few and many fiducials, near and far (fig. 19);
ours: with the localization error LE weighed in the rating. Missions are kept under `--runs`: a stopped
experiment goes on where it was.
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
from baselines.papers.sujan.localization.claims import all_claims
from baselines.papers.sujan.localization.sweep import SCANS, experiment

_WORLDS, _QUICK_WORLDS, _QUICK_SCANS = 30, 3, 40


@dataclass
class Args(PaperArgs):
    """Measure errors of localization."""

    quick: bool = False
    """Fewer worlds and scans."""
    out: Path = Path("results/sujan")
    runs: Path = Path("results/sujan-localization-runs")
    worlds: int | None = None
    """Worlds, one mission of every cell in each; default: 30, with --quick 3."""
    scans: int | None = None
    """Of each mission; default: 60, with --quick 40."""


def main(words: Sequence[str]) -> int:
    """Run the command."""
    args = parse(Args, words, description=__doc__)
    check_counts(args, worlds=1, scans=2)
    return reproduce("Sujan's errors of localization", args, lambda: _reproduced(args))


def _reproduced(args: Args) -> Reproduced:
    from baselines.papers.sujan.localization.report import write_report  # matplotlib: after the help

    worlds = args.worlds or (_QUICK_WORLDS if args.quick else _WORLDS)
    cells = experiment(worlds, args.scans or (_QUICK_SCANS if args.quick else SCANS))
    records = run_cells(cells, args.runs, args.workers, "Sujan's fig. 19", quiet=args.json)
    claims = all_claims(records)
    command = command_line("sujan.localization", args)
    return Reproduced(write_report(args.out, records, claims, command), claims)


if __name__ == "__main__":
    raise SystemExit(run_command(main))
