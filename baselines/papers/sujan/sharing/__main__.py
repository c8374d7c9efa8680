"""Bits of shared maps: `python -m baselines.papers.sujan.sharing [--quick] [--out DIR] [--json]`.

Full maps, their quadtrees and compressed quadtrees, against the errors that they make (sect. 2.4). Missions
are kept under `--runs`: a stopped experiment goes on where it was.
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
from baselines.papers.sujan.sharing.claims import all_claims
from baselines.papers.sujan.sharing.sweep import experiment

_WORLDS, _QUICK_WORLDS = 30, 4


@dataclass
class Args(PaperArgs):
    """Measure what shared maps cost."""

    quick: bool = False
    """Fewer worlds."""
    out: Path = Path("results/sujan")
    runs: Path = Path("results/sujan-sharing-runs")
    worlds: int | None = None
    """Worlds of each scenario; default: 30, with --quick 4."""


def main(words: Sequence[str]) -> int:
    """Run the command."""
    args = parse(Args, words, description=__doc__)
    check_counts(args, worlds=1)
    return reproduce("Sujan's shared maps", args, lambda: _reproduced(args))


def _reproduced(args: Args) -> Reproduced:
    from baselines.papers.sujan.sharing.report import write_report  # matplotlib: after the help

    cells = experiment(args.worlds or (_QUICK_WORLDS if args.quick else _WORLDS))
    records = run_cells(cells, args.runs, args.workers, "Sujan's shared maps", quiet=args.json)
    claims = all_claims(records)
    return Reproduced(write_report(args.out, records, claims, command_line("sujan.sharing", args)), claims)


if __name__ == "__main__":
    raise SystemExit(run_command(main))
