"""Strategies over drift: `python -m baselines.papers.sujan.drift [--quick] [--out DIR] [--json]`.

The strategies of all five papers, and ours, with robots that drift: mission time and map error over a few
levels of drift. Missions are kept under `--runs`: a stopped experiment goes on where it was.
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
from baselines.papers.sujan.drift.claims import all_claims
from baselines.papers.sujan.drift.sweep import LIMIT_S, experiment

_WORLDS, _QUICK_WORLDS, _QUICK_LIMIT_S = 30, 3, 100.0


@dataclass
class Args(PaperArgs):
    """Measure what drift does to strategies."""

    quick: bool = False
    """Fewer worlds, and missions of 100 s at most."""
    out: Path = Path("results/sujan")
    runs: Path = Path("results/sujan-drift-runs")
    worlds: int | None = None
    """Worlds, one mission of every cell in each; default: 30, with --quick 3."""


def main(words: Sequence[str]) -> int:
    """Run the command."""
    args = parse(Args, words, description=__doc__)
    check_counts(args, worlds=1)
    return reproduce("Strategies over drift", args, lambda: _reproduced(args))


def _reproduced(args: Args) -> Reproduced:
    from baselines.papers.sujan.drift.report import write_report  # matplotlib: after the help

    worlds = args.worlds or (_QUICK_WORLDS if args.quick else _WORLDS)
    limit_s = _QUICK_LIMIT_S if args.quick else LIMIT_S
    cells = experiment(worlds, limit_s)
    records = run_cells(cells, args.runs, args.workers, "strategies over drift", quiet=args.json)
    claims = all_claims(records)
    command = command_line("sujan.drift", args)
    return Reproduced(write_report(args.out, records, claims, command, limit_s), claims)


if __name__ == "__main__":
    raise SystemExit(run_command(main))
