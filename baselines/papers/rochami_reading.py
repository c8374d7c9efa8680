"""What RochaMI's experiment says, in numbers from its records: written by the command, sentence by sentence."""

from __future__ import annotations

import numpy as np

from baselines.experiment import ratio_interval
from baselines.papers.rochami_cells import CHANGES, FEW, cell_id, change_id
from baselines.papers.rochami_claims import Records, teams_in, times


def reading(records: Records) -> str:
    """The findings as a list."""
    lines = [_on_waiting(records), _on_uncoordinated(records), _on_rises(records), _on_random(records)]
    lines += _on_changes(records)
    return "\n".join(f"- {line}" for line in lines)


def _ratio(records: Records, one: str, other: str) -> str:
    starts = min(len(records[one]), len(records[other]))
    ratio, low, high = ratio_interval(times(records, one)[:starts], times(records, other)[:starts])
    return f"{ratio:.2f} ({low:.2f} … {high:.2f})"


def _by_size(records: Records, name: str | None) -> str:
    """Coordinated over uncoordinated for each of the few team sizes."""
    ratios = []
    for n in FEW:
        cells = [
            cell_id(n, m) if name is None else change_id(name, n, m) for m in ("coordinated", "uncoordinated")
        ]
        ratios.append(_ratio(records, *cells))
    return ", ".join(ratios)


def _on_waiting(records: Records) -> str:
    found = {}
    for blocked in ("wait", "wander"):
        found[blocked] = ", ".join(
            _ratio(records, cell_id(n, "coordinated", blocked), cell_id(n, "uncoordinated", blocked))
            for n in FEW
        )
    gains = ", ".join(
        _ratio(records, cell_id(n, "uncoordinated", "wander"), cell_id(n, "uncoordinated", "wait"))
        for n in FEW
    )
    sizes = ", ".join(map(str, FEW))
    return (
        f"What a robot does behind a teammate decides the comparison. Coordinated over uncoordinated time for "
        f"{sizes} robots: {found['wait']} where they wait, {found['wander']} where they wander. Wandering by "
        f"itself spreads the uncoordinated team: its time over that with waiting is {gains}."
    )


def _on_uncoordinated(records: Records) -> str:
    """Whether, and when, more uncoordinated robots get slower."""
    shares = []
    for n in teams_in(records):
        found = records[cell_id(n, "uncoordinated")]
        shares.append(f"{np.mean([r['blocked_moves'] / r['scans'] for r in found]):.0%}")
    last = teams_in(records)[-1]
    wait = ""
    if change_id("wait-15", 8, "uncoordinated") in records:
        ratio = _ratio(
            records, change_id("wait-15", 8, "uncoordinated"), change_id("wait-15", 2, "uncoordinated")
        )
        wait = f" With 15 s of waiting instead of 5 s, t(8)/t(2) is {ratio}."
    return (
        f"Uncoordinated time goes down with the team's size, not up: t({last})/t(2) is "
        f"{_ratio(records, cell_id(last, 'uncoordinated'), cell_id(2, 'uncoordinated'))}, although the share of "
        f"blocked drives grows ({', '.join(shares)} for 2 to {last} robots): every robot that scans adds to a "
        f"map that all share, and a robot that waits still holds one.{wait} It would get worse where a further "
        "robot costs its teammates more scans than it brings: longer waits, larger bodies or a smaller room."
    )


def _on_rises(records: Records) -> str:
    last = teams_in(records)[-1]
    return (
        f"The coordinated time goes on falling to {last} robots: t({last})/t(8) is "
        f"{_ratio(records, cell_id(last, 'coordinated'), cell_id(8, 'coordinated'))}. The floor of such a mission "
        "is the time of the first few scans, which every team needs; a rise would need robots that keep "
        "each other from scanning at all."
    )


def _on_random(records: Records) -> str:
    sizes = (1, *FEW)
    far = ", ".join(_ratio(records, cell_id(n, "coordinated"), cell_id(n, "random")) for n in sizes)
    near = ", ".join(_ratio(records, cell_id(n, "coordinated"), f"n{n}-random-1m") for n in sizes)
    return (
        f"Coordinated over random time for {', '.join(map(str, sizes))} robots: {far} against a walk that draws "
        f"from the same reach; {near} against one of steps up to 1 m, which wastes less time on driving."
    )


def _on_changes(records: Records) -> list[str]:
    """A sentence a change: what it does to the comparison."""
    lines = []
    base = _by_size(records, None)
    for name, change in CHANGES.items():
        if change_id(name, FEW[0], "coordinated") not in records:
            continue
        kept = ", ".join(
            _ratio(records, change_id(name, n, "coordinated"), cell_id(n, "coordinated")) for n in FEW
        )
        lines.append(
            f"{change.text}: coordinated over uncoordinated {_by_size(records, name)} for "
            f"{', '.join(map(str, FEW))} robots (as it is: {base}); the coordinated team's time changes by {kept}."
        )
    return lines
