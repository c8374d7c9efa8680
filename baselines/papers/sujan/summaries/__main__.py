"""Summaries beside batches: `python -m baselines.papers.sujan.summaries [--quick] [--out DIR] [--json]`.

Teams share maps as quadtrees (Sujan, sect. 2.4) or their most useful measurements (Rocha04), at equal bits a
second: mission times and errors of maps. Missions are kept under `--runs`: a stopped experiment goes on where
it was.
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
from baselines.papers.sujan.summaries.claims import all_claims
from baselines.papers.sujan.summaries.sweep import experiment

_WORLDS, _QUICK_WORLDS = 30, 4


@dataclass
class Args(PaperArgs):
    """Compare summaries of maps with batches of measurements."""

    quick: bool = False
    """Fewer worlds."""
    out: Path = Path("results/sujan")
    runs: Path = Path("results/sujan-summaries-runs")
    worlds: int | None = None
    """Worlds of each scenario, a mission of every channel in each; default: 30, with --quick 4."""


def main(words: Sequence[str]) -> int:
    """Run the command."""
    args = parse(Args, words, description=__doc__)
    check_counts(args, worlds=2)
    return reproduce("Sujan's summaries", args, lambda: _reproduced(args))


def _reproduced(args: Args) -> Reproduced:
    from baselines.papers.sujan.summaries.report import write_report  # matplotlib: after the help

    cells = experiment(args.worlds or (_QUICK_WORLDS if args.quick else _WORLDS))
    records = run_cells(cells, args.runs, args.workers, "Sujan's summaries", quiet=args.json)
    claims = all_claims(records)
    return Reproduced(write_report(args.out, records, claims, command_line("sujan.summaries", args)), claims)


if __name__ == "__main__":
    raise SystemExit(run_command(main))
