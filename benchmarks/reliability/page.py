"""The page of the proofs: how many cases, what came of them, and every failure."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from benchmarks.reliability.settings_fuzz import STEPS, WATCHDOG_S
from benchmarks.reliability.soak import ROBOT_STEPS

_SETTLED = 20
"""Cases of soak after which memory is taken for settled: 10⁶ robot-steps."""


class Kept(NamedTuple):
    """What is kept of a proof."""

    rows: Sequence[Mapping[str, Any]]
    planned: int
    """Cases of a full run."""


def page(kept: Mapping[str, Kept]) -> str:
    """The page as Markdown."""
    lines = [
        "# Reliability",
        "",
        "Made by `python -m benchmarks.reliability --page` and the path of this file.",
        "",
    ]
    for name, (title, summary) in _SUMMARIES.items():
        rows, planned = kept[name]
        played = [row for row in rows if "failure" not in row]
        failed = [row for row in rows if "failure" in row]
        lines += [f"## {title}", "", f"{len(rows):,} of {planned:,} cases played, {len(failed):,} failed."]
        lines += [summary(played)] if played else []
        lines += ["", *(f"- case {row['number']}: {row['failure'][:300]}" for row in failed[:20]), ""]
    return "\n".join(lines).rstrip() + "\n"


def _settings(rows: Sequence[Mapping[str, Any]]) -> str:
    refused = Counter(field for row in rows for field in row["refused"])
    most = ", ".join(f"{field} ({count:,})" for field, count in refused.most_common(3))
    slowest = max(row["seconds"] for row in rows)
    return (
        f"Each is a scenario with every setting drawn, played for {STEPS} steps with the kernels' assertions "
        f"compiled in; they may take {WATCHDOG_S:g} s of the processor. The slowest took "
        f"{slowest:.1f} s; {sum(row['episodes'] for row in rows):,} episodes were begun. Before them "
        f"{sum(refused.values()):,} scenarios were refused by name, most for {most or 'nothing'}."
    )


def _states(rows: Sequence[Mapping[str, Any]]) -> str:
    refused = sum(bool(row["refused"]) for row in rows)
    return (
        f"Each is a saved state, one number changed. {refused:,} were refused by name and changed nothing; "
        f"the missions of {len(rows) - refused:,} went on within their spaces."
    )


def _determinism(rows: Sequence[Mapping[str, Any]]) -> str:
    digests = defaultdict(set)
    for row in rows:
        digests[row["scenario"]].add(row["digest"])
    differing = sorted(number for number, found in digests.items() if len(found) > 1)
    variants = len({row["variant"] for row in rows})
    said = f"differences in drawn scenarios {differing}" if differing else "no difference"
    return (
        f"{len(digests):,} drawn scenarios, each in {variants} processes that differ in processor level, "
        f"threads, missions beside it, hash seed and start method: {said}."
    )


def _soak(rows: Sequence[Mapping[str, Any]]) -> str:
    said = f"{len(rows) * ROBOT_STEPS:,} robot-steps, the contract checked at each."
    memory = [row["resident_mib"] for row in sorted(rows, key=lambda row: row["number"])]
    if len(memory) <= _SETTLED:
        return said
    settled, end = memory[_SETTLED], memory[-1]
    return f"{said} Resident memory was {settled:.0f} MiB after 10⁶, and {end:.0f} MiB at the end."


_SUMMARIES: Mapping[str, tuple[str, Callable[[Sequence[Mapping[str, Any]]], str]]] = {
    "settings": ("Drawn settings", _settings),
    "states": ("Changed states", _states),
    "determinism": ("Determinism", _determinism),
    "soak": ("Soak", _soak),
}
