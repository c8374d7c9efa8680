"""Sujan's planar experiments: `python -m baselines.papers.sujan [--quick] [--out DIR] [--json]`.

Five ways of choosing poses map 100 × 100 m with occlusions, with one robot and with two (figs. 17, 20, 22);
method (v) is run with one thing changed at a time. Missions are kept under `--runs`: a stopped experiment
goes on where it was.
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
from baselines.papers.sujan.claims import all_claims
from baselines.papers.sujan.sweep import experiment

_STARTS, _QUICK_STARTS = 30, 5


@dataclass
class Args(PaperArgs):
    """Reproduce the planar experiments of Sujan and Meggiolaro."""

    quick: bool = False
    """Fewer worlds, and nothing changed one at a time: two minutes."""
    out: Path = Path("results/sujan")
    runs: Path = Path("results/sujan-runs")
    starts: int | None = None
    """Worlds, one mission of every method in each; default: 30, with --quick 5."""


def main(words: Sequence[str]) -> int:
    """Run the command."""
    args = parse(Args, words, description=__doc__)
    check_counts(args, starts=1)
    return reproduce("Sujan", args, lambda: _reproduced(args))


def _reproduced(args: Args) -> Reproduced:
    from baselines.papers.sujan.report import write_report  # matplotlib: after the help

    cells = experiment(args.starts or (_QUICK_STARTS if args.quick else _STARTS), changes=not args.quick)
    records = run_cells(cells, args.runs, args.workers, "Sujan", quiet=args.json)
    claims = all_claims(records)
    return Reproduced(write_report(args.out, records, claims, command_line("sujan", args)), claims)


if __name__ == "__main__":
    raise SystemExit(run_command(main))
