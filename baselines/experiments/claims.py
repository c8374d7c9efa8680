"""Claims of a paper beside what was measured, as people read them: in a terminal, and in Markdown."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from baselines.experiments.statistics import Interval
from baselines.experiments.tables import csv_table, markdown_table, terminal_table
from entropy_explore_env.errors import SettingError

_DIGITS = 4
"""Significant digits of figures below 1000; above, whole numbers."""
_FEW = 3
"""Figures of a paper that stand in a line of a group of claims."""
COLUMNS = ("id", "claim", "paper", "ours", "low", "high", "holds")
"""Of claims as JSON and CSV."""
SAME = "the number"
"""The paper claims that something is above or below the number to which it is compared."""


@dataclass(frozen=True)
class Claim:
    """A claim of a paper beside what was measured.

    Attributes:
        id: Stable name; its beginning says which group of claims it is in.
        paper: The paper's figure, if it gives one.
        ours: Ours.
        low: Lower end of a 95 % interval of ours, if it has one.
        high: Upper end.
        holds: Whether the claim holds.
        claim: What is claimed beside what the group's text says; after `told` the whole text.
    """

    id: str
    paper: float | str | None
    ours: float | str | None
    low: float | None
    high: float | None
    holds: bool
    claim: str = ""

    def row(self) -> dict[str, Any]:
        """Return the claim as JSON has it."""
        return {name: getattr(self, name) for name in COLUMNS}


def above(
    name: str, found: Interval, least: float = 1.0, claim: str = "", paper: float | str | None = SAME
) -> Claim:
    """Return the claim that something is above a number: it holds if the whole interval is; see `below`."""
    return Claim(name, f"> {least:g}" if paper == SAME else paper, *found, found.low > least, claim)


def below(
    name: str, found: Interval, most: float = 1.0, claim: str = "", paper: float | str | None = SAME
) -> Claim:
    """Return the claim that something is below a number: it holds if the whole interval is.

    Args:
        name: Its id.
        found: What was measured.
        most: The number.
        claim: What is claimed beside what the group's text says.
        paper: The paper's figure; SAME = that number.
    """
    return Claim(name, f"< {most:g}" if paper == SAME else paper, *found, found.high < most, claim)


def told(claims: Sequence[Claim], groups: Mapping[str, str]) -> list[Claim]:
    """Return claims with their whole text: that of their group, and what is said of each.

    Raises:
        SettingError: A claim is in no group.
    """
    texts = [groups[_group_of(each, groups)] + (f" ({each.claim})" if each.claim else "") for each in claims]
    return [replace(each, claim=text) for each, text in zip(claims, texts, strict=True)]


def groups_table(claims: Sequence[Claim], groups: Mapping[str, str]) -> str:
    """Return a Markdown table of the claims in groups: how many hold, and where ours lie.

    Args:
        claims: All of them.
        groups: Beginning of ids → what the claims are, in the order of the table; the longest one counts.

    Raises:
        SettingError: A claim is in no group.
    """
    found: dict[str, list[Claim]] = {start: [] for start in groups}
    for claim in claims:
        found[_group_of(claim, groups)].append(claim)
    rows = [
        [groups[start], _paper_of(some), _ours_of(some), f"{sum(c.holds for c in some)} of {len(some)}"]
        for start, some in found.items()
        if some
    ]
    return markdown_table(["claim", "paper", "ours (95 % interval, or span)", "hold"], rows)


def _group_of(claim: Claim, groups: Mapping[str, str]) -> str:
    """Return the beginning of the id that names the group of a claim."""
    starts = [start for start in groups if claim.id.startswith(start)]
    if not starts:
        raise SettingError("claim", claim.id, f"one in a group: {', '.join(groups)}")
    return max(starts, key=len)


def _paper_of(claims: Sequence[Claim]) -> str:
    """Return what the paper has of some claims."""
    values = dict.fromkeys(_shown(claim.paper) for claim in claims)
    return ", ".join(values) if len(values) <= _FEW else f"{len(values)} figures"


def _ours_of(claims: Sequence[Claim]) -> str:
    """Return our figure with its interval, or of several claims the span of ours."""
    if len(claims) == 1:
        interval = _interval(claims[0], 3)
        return f"{_shown(claims[0].ours)} ({interval})" if interval else _shown(claims[0].ours)
    numbers = [claim.ours for claim in claims if isinstance(claim.ours, int | float)]
    if not numbers:
        return ", ".join(dict.fromkeys(_shown(claim.ours) for claim in claims))
    return f"{_shown(min(numbers), 3)} … {_shown(max(numbers), 3)}"


def claims_csv(claims: Sequence[Claim]) -> str:
    """Return all claims as CSV, a line each."""
    return csv_table({name: [getattr(claim, name) for claim in claims] for name in COLUMNS})


def terminal_claims(claims: Sequence[Claim]) -> str:
    """Return a table of the claims for a terminal."""
    rows = [
        [
            each.id,
            each.claim,
            _shown(each.paper),
            _shown(each.ours),
            _interval(each),
            "yes" if each.holds else "no",
        ]
        for each in claims
    ]
    return terminal_table(["id", "claim", "paper", "ours", "95 % interval", "holds"], rows)


def _shown(value: float | str | None, digits: int = _DIGITS) -> str:
    if value is None:
        return "-"
    if isinstance(value, str):
        return value
    return f"{value:,.0f}" if abs(value) >= 1000 else f"{value:,.{digits}g}"


def _interval(claim: Claim, digits: int = _DIGITS) -> str:
    return "" if claim.low is None else f"{_shown(claim.low, digits)} … {_shown(claim.high, digits)}"
