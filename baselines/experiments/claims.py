"""Claims of a paper beside what was measured, as people read them: in the terminal, and in Markdown."""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from baselines.cli.arguments import print_json
from baselines.experiments.tables import markdown_table

_DIGITS = 4
"""Significant digits of figures below 1000; above, whole numbers."""


@dataclass(frozen=True)
class Claim:
    """A claim of a paper beside what was measured.

    Attributes:
        id: Stable name.
        claim: What is claimed.
        paper: The paper's figure, if it gives one.
        ours: Ours.
        low: Lower end of a 95 % interval of ours, if it has one.
        high: Upper end.
        holds: Whether the claim holds.
    """

    id: str
    claim: str
    paper: float | str | None
    ours: float | str | None
    low: float | None
    high: float | None
    holds: bool

    def row(self) -> dict[str, Any]:
        """As JSON has it."""
        return asdict(self)


def claims_table(claims: Sequence[Claim], interval_digits: int = _DIGITS, given: str = "paper") -> str:
    """The claims as a Markdown table.

    Args:
        claims: A row each.
        interval_digits: Significant digits of the ends of intervals.
        given: Head of the column of figures that were given.
    """
    rows = [
        [
            claim.claim,
            _shown(claim.paper),
            _shown(claim.ours),
            _interval(claim, interval_digits),
            "yes" if claim.holds else "**no**",
        ]
        for claim in claims
    ]
    return markdown_table(["claim", given, "ours", "95 % interval", "holds"], rows)


def print_claims(claims: Sequence[Claim], paper: str) -> None:
    """A table of the claims on standard output."""
    from rich.console import Console
    from rich.table import Table

    table = Table(title=paper, title_justify="left")
    table.add_column("claim")
    for head in ("paper", "ours", "95 % interval"):
        table.add_column(head, justify="right")
    table.add_column("holds")
    for claim in claims:
        holds = "[green]yes[/green]" if claim.holds else "[red]no[/red]"
        table.add_row(claim.claim, _shown(claim.paper), _shown(claim.ours), _interval(claim), holds)
    Console().print(table)


def report_claims(
    paper: str, claims: Sequence[Claim], report: Path, started: float, as_json: bool, strict: bool
) -> int:
    """Print the results of a reproduction in the requested form.

    Args:
        paper: Short name.
        claims: Of the paper.
        report: The page that was written.
        started: `time.perf_counter()` when the work began.
        as_json: One JSON object instead of a table.
        strict: Whether a claim that does not hold is a failure.

    Returns:
        The command's exit code.
    """
    if as_json:
        wall_s = round(time.perf_counter() - started, 1)
        print_json({"paper": paper, "claims": [claim.row() for claim in claims], "wall_s": wall_s})
    else:
        print_claims(claims, paper)
        print(f"written: {report}, its figures and tables beside it", file=sys.stderr)
    return 1 if strict and not all(claim.holds for claim in claims) else 0


def _shown(value: float | str | None, digits: int = _DIGITS) -> str:
    if value is None:
        return "-"
    if isinstance(value, str):
        return value
    return f"{value:,.0f}" if abs(value) >= 1000 else f"{value:,.{digits}g}"


def _interval(claim: Claim, digits: int = _DIGITS) -> str:
    return "" if claim.low is None else f"{_shown(claim.low, digits)} … {_shown(claim.high, digits)}"
