"""Sujan's cliff: `python -m baselines.papers.sujan.cliff [--quick] [--out DIR] [--json]`.

Five methods map a cliff from the plateau above it (figs. 24-27); unknown heights are completed and the edge
is found (figs. 7, 9). Missions are kept under `--runs`: a stopped experiment goes on where it was.
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
from baselines.papers.sujan.cliff.claims import all_claims
from baselines.papers.sujan.cliff.sweep import experiment

_WORLDS, _QUICK_WORLDS = 30, 4


@dataclass
class Args(PaperArgs):
    """Reproduce the cliff of Sujan and Meggiolaro."""

    quick: bool = False
    """Fewer worlds: a minute or two."""
    out: Path = Path("results/sujan")
    runs: Path = Path("results/sujan-cliff-runs")
    worlds: int | None = None
    """Worlds, one mission of every method in each; default: 30, with --quick 4."""


def main(words: Sequence[str]) -> int:
    """Run the command."""
    args = parse(Args, words, description=__doc__)
    check_counts(args, worlds=1)
    return reproduce("Sujan's cliff", args, lambda: _reproduced(args))


def _reproduced(args: Args) -> Reproduced:
    from baselines.papers.sujan.cliff.report import write_report  # matplotlib: after the help

    cells = experiment(args.worlds or (_QUICK_WORLDS if args.quick else _WORLDS))
    records = run_cells(cells, args.runs, args.workers, "Sujan's cliff", quiet=args.json)
    claims = all_claims(records)
    return Reproduced(write_report(args.out, records, claims, command_line("sujan.cliff", args)), claims)


if __name__ == "__main__":
    raise SystemExit(run_command(main))
