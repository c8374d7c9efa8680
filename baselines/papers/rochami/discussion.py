"""What RochaMI's experiment says beyond its claims: sentences with numbers from the records."""

from __future__ import annotations

import numpy as np

from baselines.experiments.statistics import ratio_interval
from baselines.papers.rochami.claims import Records, distances, teams_in, times
from baselines.papers.rochami.sweep import (
    CHANGES,
    FEW,
    KAPPA_CHANGES,
    KAPPAS,
    METHODS,
    cell_id,
    change_id,
    kappa_id,
)

_SIZES = ", ".join(map(str, FEW))


def reading(records: Records) -> str:
    """The findings as a list."""
    lines = [
        _on_blocking(records),
        _on_uncoordinated(records),
        _on_coordinated(records),
        _on_random(records),
        *_on_kappa(records),
        *_on_changes(records),
    ]
    return "\n".join(f"- {line}" for line in lines)


def _ratio(records: Records, one: str, other: str) -> str:
    starts = min(len(records[one]), len(records[other]))
    return ratio_interval(times(records, one)[:starts], times(records, other)[:starts]).text()


def _by_size(records: Records, name: str | None) -> str:
    """Coordinated over uncoordinated for each of the few team sizes."""
    pairs = [[cell_id(n, m) if name is None else change_id(name, n, m) for m in METHODS[:2]] for n in FEW]
    return ", ".join(_ratio(records, *pair) for pair in pairs)


def _share(records: Records, cell: str, reasons: tuple[str, ...]) -> str:
    """Share of a cell's decisions that had these reasons."""
    counts = [record["decisions"] for record in records[cell] if "decisions" in record]
    every = sum(sum(count.values()) for count in counts)
    return f"{sum(count[reason] for count in counts for reason in reasons) / every:.0%}" if every else "-"


def _on_blocking(records: Records) -> str:
    by_what = {
        what: ", ".join(
            _ratio(records, cell_id(n, "coordinated", what), cell_id(n, "uncoordinated", what)) for n in FEW
        )
        for what in ("wait", "wander")
    }
    spread = ", ".join(
        _ratio(records, cell_id(n, "uncoordinated", "wander"), cell_id(n, "uncoordinated")) for n in FEW
    )
    return (
        "What a robot does behind a teammate decides the comparison. Coordinated over uncoordinated time "
        f"for {_SIZES} robots is {by_what['wait']} where robots wait, {by_what['wander']} where they wander. "
        f"The uncoordinated team's time with wandering over that with waiting is {spread}: being blocked "
        "spreads a team that wanders."
    )


def _on_uncoordinated(records: Records) -> str:
    sizes = teams_in(records)
    shares = []
    for n in sizes:
        blocked = [r["blocked_moves"] / r["scans"] for r in records[cell_id(n, "uncoordinated")]]
        shares.append(f"{np.mean(blocked):.0%}")
    longer = ""
    if change_id("wait-15", 8, "uncoordinated") in records:
        ends = [change_id("wait-15", n, "uncoordinated") for n in (8, 2)]
        longer = f" With waits of 15 s instead of 5 s t(8)/t(2) is {_ratio(records, *ends)}."
    growth = _ratio(records, cell_id(sizes[-1], "uncoordinated"), cell_id(2, "uncoordinated"))
    drives = f"{', '.join(shares)} are blocked for {', '.join(map(str, sizes))} robots"
    return (
        f"Of the uncoordinated robots' drives {drives}, where they wait. Yet t({sizes[-1]})/t(2) is "
        f"{growth}: a robot scans where it was stopped, and all share what it sees, so that one more robot "
        f"brings scans even where it only waits.{longer} Time would rise where a robot keeps its teammates "
        "from more scans than it brings: where waits last much longer than a drive, where blocked robots do "
        "not scan, or do not share."
    )


def _on_coordinated(records: Records) -> str:
    last = teams_in(records)[-1]
    end = _ratio(records, cell_id(last, "coordinated"), cell_id(8, "coordinated"))
    return (
        f"The coordinated team's t({last})/t(8) is {end}. It would stop falling where the robots' way "
        "through the room, or the first scans that any team takes, are all that is left of the mission."
    )


def _on_random(records: Records) -> str:
    sizes = (1, *FEW)
    far = ", ".join(_ratio(records, cell_id(n, "coordinated"), cell_id(n, "random")) for n in sizes)
    near = ", ".join(_ratio(records, cell_id(n, "coordinated"), f"n{n}-random-1m") for n in sizes)
    text = (
        f"Coordinated over random time for {', '.join(map(str, sizes))} robots is {far} against a walk "
        f"within the same reach of 4 m, and {near} against one of steps up to 1 m"
    )
    if change_id("reach", FEW[0], "coordinated") in records:
        short = ", ".join(
            _ratio(records, change_id("reach", n, "coordinated"), f"n{n}-random-1m") for n in FEW
        )
        text += f"; with candidates at most 1 m away, too, it is {short} for {_SIZES} robots"
    return f"{text}. Gradients between known and unknown voxels are equal wherever they are."


def _on_kappa(records: Records) -> list[str]:
    """Why time and distance go as they do."""
    wandering = ("blocked", "nothing", "trap")
    kappas = [kappa for kappa in KAPPAS if kappa_id(kappa) in records]
    shares = ", ".join(_share(records, kappa_id(kappa), wandering) for kappa in kappas)
    lines = [
        f"Of the decisions of two coordinated robots {shares} are wandering for "
        f"κ = {', '.join(f'{kappa:g}' for kappa in kappas)}: drives that κ does not shorten, and it shortens "
        "the others at no loss of gradient, since many candidates are equally steep."
    ]
    for name, (text, _, _) in KAPPA_CHANGES.items():
        if kappa_id(0.0, name) not in records:
            continue
        cells = [kappa_id(kappa, name) for kappa in (0.0, 0.25, 1.0)]
        time_s = " → ".join(f"{times(records, cell).mean():,.0f}" for cell in cells)
        path_m = " → ".join(f"{distances(records, cell).mean():,.1f}" for cell in cells)
        lines.append(f"κ = 0, 0.25, 1, and {text}: t {time_s} s, d {path_m} m.")
    return lines


def _on_changes(records: Records) -> list[str]:
    """A sentence a change: what it does to the comparison, and to the coordinated team."""
    lines = [
        f"As it is, coordinated over uncoordinated time is {_by_size(records, None)} for {_SIZES} robots."
    ]
    for name, change in CHANGES.items():
        if change_id(name, FEW[0], "coordinated") not in records:
            continue
        own = ", ".join(
            _ratio(records, change_id(name, n, "coordinated"), cell_id(n, "coordinated")) for n in FEW
        )
        ratios = _by_size(records, name)
        lines.append(f"{change.text}: {ratios}; the coordinated team's time over that as it is: {own}.")
    return lines
