"""A paper's claims as people read them: a table in the terminal, and one in Markdown."""

from __future__ import annotations

import platform
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from baselines.cli.arguments import print_json
from baselines.experiments.cells import Claim, markdown_table


def claims_table(claims: Sequence[Claim]) -> str:
    """The claims as a Markdown table."""
    rows = [
        [c.claim, _shown(c.paper), _shown(c.ours), _interval(c), "yes" if c.holds else "**no**"]
        for c in claims
    ]
    return markdown_table(["claim", "paper", "ours", "95 % interval", "holds"], rows)


def print_claims(claims: Sequence[Claim], paper: str = "Rocha04") -> None:
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
    """Show what a reproduction came to, the way its command was asked to.

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


def _shown(value: float | str | None) -> str:
    if value is None:
        return "-"
    if isinstance(value, str):
        return value
    return f"{value:,.0f}" if abs(value) >= 1000 else f"{value:,.4g}"


def _interval(claim: Claim) -> str:
    return "" if claim.low is None else f"{_shown(claim.low)} … {_shown(claim.high)}"


def processor() -> str:
    """The processor's name, as the system tells it: what seconds were measured on."""
    table = Path("/proc/cpuinfo")
    lines = table.read_text().splitlines() if table.exists() else []
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or "unknown"
