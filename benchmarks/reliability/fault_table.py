"""The faults that were put into formulas, as a part of the page of the proofs."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any

from benchmarks.reliability.equivalent_faults import EQUIVALENT

Row = Mapping[str, Any]
_REASONS = {(each.path, each.function, each.what): each.reason for each in EQUIVALENT}


def share_found(faults: Collection[Row]) -> float:
    """The share of faults that a test finds, of those that can change what the code does."""
    able = [row for row in faults if not reason_of(row)]
    return sum(bool(row["found"]) for row in able) / max(len(able), 1)


def fault_table(mutants: Mapping[str, Sequence[Row]]) -> str:
    """How many faults were found, file by file, and every one that was not.

    Args:
        mutants: What is kept of each file or folder whose faults were drawn.
    """
    faults = {row["digest"]: row for rows in mutants.values() for row in rows}.values()
    if not faults:
        return "None drawn yet: `python -m benchmarks.reliability.mutants entropy_explore_env/missions`."
    found, late, equivalent = (sum(map(kind, faults)) for kind in (_found, _late, _equivalent))
    lines = [
        f"{len(faults)} faults put into formulas, one at a time (`python -m "
        f"benchmarks.reliability.mutants`): {found} were found by a test that failed; {late} made tests run "
        f"on and on, and no other test failed; {equivalent} change nothing that the code does, for the "
        f"reasons below; {len(faults) - found - late - equivalent} were not found. Of those that change "
        f"something {share_found(faults):.1%} were found. Each is run with interpreted kernels against the "
        "tests that take its line, none that takes longer than 3 s that way and 30 s of them in all, until "
        "one fails: a fault not found here may be found by others. Tests were written for many that were not "
        "found at first: of others, drawn anew, fewer are found. Faults in functions that have changed since "
        "are not counted.",
        "",
        "| file | faults | found | late | without effect |",
        "| --- | ---: | ---: | ---: | ---: |",
    ]
    for path in sorted({row["path"] for row in faults}):
        own = [row for row in faults if row["path"] == path]
        counts = [sum(map(kind, own)) for kind in (_found, _late, _equivalent)]
        lines.append("| " + " | ".join(map(str, (path, len(own), *counts))) + " |")
    lines.append("")
    for row in sorted(faults, key=lambda row: (row["path"], row["line"], row["what"])):
        if not row["found"]:
            lines.append(f"- {_said(row)}")
    return "\n".join(lines)


def _said(row: Row) -> str:
    """What became of a fault that no test found."""
    place = f"{row['path']}:{row['line']}: `{row['what']}`"
    if reason := reason_of(row):
        return f"without effect: {place}: {reason}"
    if row.get("late"):
        return f"late: {place}"
    return f"{'no test takes its line' if row.get('tests') == 0 else 'not found'}: {place}"


def _found(row: Row) -> bool:
    return bool(row["found"])


def _late(row: Row) -> bool:
    return bool(row.get("late")) and not _equivalent(row)


def _equivalent(row: Row) -> bool:
    return not row["found"] and bool(reason_of(row))


def reason_of(row: Row) -> str:
    """Why a fault cannot change anything; "" = it can."""
    return "" if row["found"] else _REASONS.get((row["path"], row.get("function", ""), row["what"]), "")
