"""A paper's claims as people read them: a table in the terminal, and one in Markdown."""

from __future__ import annotations

from collections.abc import Sequence

from baselines.experiment import Claim, markdown_table


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


def _shown(value: float | str | None) -> str:
    if value is None:
        return "-"
    if isinstance(value, str):
        return value
    return f"{value:,.0f}" if abs(value) >= 1000 else f"{value:,.4g}"


def _interval(claim: Claim) -> str:
    return "" if claim.low is None else f"{_shown(claim.low)} … {_shown(claim.high)}"
