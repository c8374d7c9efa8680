"""The claims of Sawhney 2009, each beside what was measured, at three ends: 95 %, 99 %, no frontier left.

Times are relative: over the mean of V/t, asynchronous, in the same world with the same team, so that all
worlds and team sizes weigh alike. Missions of all team sizes in one world with one seed have the same plan or
ground, and count as one, their mean; methods are paired by world and seed.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from baselines.experiments.claims import Claim, above
from baselines.experiments.experiment import Records
from baselines.experiments.statistics import Interval, mean_interval, ratio_interval
from baselines.experiments.tables import markdown_table
from baselines.papers.sawhney.sweep import (
    BETAS,
    CHANGED_IN,
    CHANGED_METHODS,
    CHANGED_TEAM,
    CHANGES,
    DEM,
    FARTHER_BETAS,
    MAP_METHODS,
    MAP_TEAM,
    PLANS,
    TEAMS,
    TERRAINS,
    cell_id,
)

ENDS = {"t95_s": "to 95 %", "t99_s": "to 99 %", "t_none_s": "to no frontier"}
PARTS = {"plans": "2-D", "terrains": "3-D"}
PAPER_ASYNCHRONOUS = {"plans": 0.90, "terrains": 0.91}
"""Asynchronous over synchronous: about 10 % and 9 % faster."""
PAPER_BEST_BETA = {"plans": 0.90, "terrains": 0.91}
"""V/t over the best β: about 10 % and 9 % faster."""
PAPER_BETA = {"plans": 30, "terrains": 40}
"""The paper's best β."""
PAPER_SINGLE = 0.93
"""V/t over the best β of one robot in plans (sect. 5, a robot with a laser): about 7 % faster."""
GROUPS = {
    f"{part}-{kind}": f"{name}{text}"
    for part, name in PARTS.items()
    for kind, text in (
        ("async-t", ": asynchronous is faster than synchronous"),
        ("beta-", ": V/t is faster than the best β"),
        ("extreme-", ": β = 1 and 70 are slower than the best β"),
        ("no-single-", ": each world's own best β is faster, on other seeds"),
        ("points", ": V/t scans from nearly as many points as the best β"),
        ("ways", ": ways of V/t are shorter than those of the best β"),
        ("naive-", ": ray-cast V is faster than naive V"),
        ("no-height-", ": the height factor helps"),
        ("team-", ", each team size: V/t is faster than the best β"),
        ("interior-", ", ours: others lie on both sides of the best β"),
        ("finish-", ", ours: (V + bonus)/t is faster than V/t"),
        ("nearest-", ", ours: V/t is faster than Yamauchi's metric"),
        ("coordinated-", ", ours: V/t is faster than Burgard's metric"),
        ("async-team-", ", ours, each team size: asynchronous is faster"),
    )
}
"""Beginning of ids → what the claims are, on the page; ratios of times, if not said otherwise."""
_ALIKE = 0.1
"""Numbers that differ by no more than this share are nearly the same."""
_ALL = slice(None)
_HALVES = (slice(0, None, 2), slice(1, None, 2))


def worlds_in(records: Records, part: str) -> tuple[str, ...]:
    """Worlds of a part that were run."""
    worlds = PLANS if part == "plans" else (*TERRAINS, DEM)
    return tuple(w for w in worlds if any(cell_id(w, n, "ptv") in records for n in TEAMS))


def teams_in(records: Records, part: str) -> tuple[int, ...]:
    """Team sizes of a part that were run."""
    worlds = worlds_in(records, part)
    return tuple(n for n in TEAMS if worlds and cell_id(worlds[0], n, "ptv") in records)


def betas_in(records: Records, part: str) -> tuple[int, ...]:
    """The β that were run in a part, in the paper's numbers."""
    world, team = worlds_in(records, part)[0], teams_in(records, part)[0]
    return tuple(b for b in (*BETAS, *FARTHER_BETAS[part]) if cell_id(world, team, f"beta-{b}") in records)


def times(records: Records, cell: str, end: str) -> np.ndarray:
    """Times of a cell in seconds, by seed."""
    return np.asarray([record[end] for record in records[cell]], float)


def relative(
    records: Records,
    part: str,
    method: str,
    end: str,
    teams: Sequence[int] = (),
    worlds: Sequence[str] = (),
    seeds: slice = _ALL,
) -> np.ndarray:
    """(N,) relative times of a method by world and seed, means over teams; in the same order for all methods.

    Args:
        records: By cell.
        part: `plans` or `terrains`.
        method: Name of the method.
        end: Name of a time in a record, or of anything else that is counted there.
        teams: Team sizes; none = all that were run.
        worlds: None = all that were run.
        seeds: Which of them.
    """
    found = []
    for world in worlds or worlds_in(records, part):
        by_team = []
        for n in teams or teams_in(records, part):
            unit = times(records, cell_id(world, n, "ptv"), end)[seeds].mean()
            by_team.append(times(records, cell_id(world, n, method), end)[seeds] / unit)
        found.append(np.mean(by_team, axis=0))
    return np.concatenate(found)


def compared(
    records: Records,
    part: str,
    ours: str,
    theirs: str,
    end: str,
    teams: Sequence[int] = (),
    worlds: Sequence[str] = (),
) -> Interval:
    """Time of a method over that of another, with its 95 % interval."""
    pair = (relative(records, part, method, end, teams, worlds) for method in (ours, theirs))
    return ratio_interval(*pair)


def best_beta(
    records: Records,
    part: str,
    end: str,
    worlds: Sequence[str] = (),
    teams: Sequence[int] = (),
    among: Sequence[int] = BETAS,
    seeds: slice = _ALL,
) -> int:
    """The β with the least mean time over worlds and team sizes; chosen from these same missions."""
    found = [beta for beta in betas_in(records, part) if beta in among]
    return min(found, key=lambda b: relative(records, part, f"beta-{b}", end, teams, worlds, seeds).mean())


def all_claims(records: Records) -> list[Claim]:
    """Every claim, from the missions' records by cell."""
    claims = []
    for part in PARTS:
        if worlds_in(records, part):
            claims += _part_claims(records, part)
    return claims


def _part_claims(records: Records, part: str) -> list[Claim]:
    """The claims of plans, or of terrains."""
    name, claims = PARTS[part], []
    several = [n for n in teams_in(records, part) if n > 1]
    for end, text in ENDS.items() if several else ():
        ratio = compared(records, part, "ptv", "sync", end, several)
        claim = f"{name}, {text}: asynchronous is faster than synchronous; t ratio"
        claims.append(_faster(f"{part}-async-{end}", claim, PAPER_ASYNCHRONOUS[part], ratio))
    for end, text in ENDS.items():
        best = best_beta(records, part, end)
        ratio = compared(records, part, "ptv", f"beta-{best}", end)
        claim = f"{name}, {text}: V/t is faster than the best β ({best}); t ratio"
        claims.append(_faster(f"{part}-beta-{end}", claim, PAPER_BEST_BETA[part], ratio))
    for end, text in ENDS.items():
        claims += _extreme_claims(records, part, end, f"{name}, {text}")
    claims += [_no_single_beta(records, part, end) for end in ENDS]
    claims += _distance_claims(records, part, name)
    for other, what in (
        ("naive", "ray-cast V is faster than naive V"),
        ("no-height", "the height factor helps"),
    ):
        if other == "no-height" and part == "plans":
            continue
        for end, text in ENDS.items():
            ratio = compared(records, part, "ptv", other, end)
            claims.append(_faster(f"{part}-{other}-{end}", f"{name}, {text}: {what}; t ratio", "< 1", ratio))
    return [*claims, *_our_claims(records, part, name)]


def _faster(name: str, claim: str, paper: float | str | None, ratio: Interval) -> Claim:
    """Holds if the whole interval is below 1."""
    return Claim(name, claim, paper, *ratio, ratio.high < 1.0)


def _extreme_claims(records: Records, part: str, end: str, text: str) -> list[Claim]:
    """The smallest and the largest β are slower than the best."""
    best, claims, swept = best_beta(records, part, end), [], betas_in(records, part)
    widest = best_beta(records, part, end, among=swept)
    claim = f"ours, {text}: the best of all β that were tried ({widest}) has others on both sides; its place"
    inside = swept[0] < widest < swept[-1]
    claims.append(
        Claim(
            f"{part}-interior-{end}",
            claim,
            None,
            f"{swept.index(widest) + 1} of {len(swept)}",
            None,
            None,
            inside,
        )
    )
    betas = [beta for beta in swept if beta in BETAS]
    for beta in (betas[0], betas[-1]):
        ratio = compared(records, part, f"beta-{beta}", f"beta-{best}", end)
        claim = f"{text}: β = {beta} is slower than the best β ({best}); t ratio"
        claims.append(above(f"{part}-extreme-{beta}-{end}", claim, ratio))
    return claims


def _no_single_beta(records: Records, part: str, end: str) -> Claim:
    """Every world's own best β is faster than the best of all.

    Chosen on half of the seeds and compared on the rest, and the other way round: no β is judged by the
    missions that it was chosen for.
    """
    own, shared, worlds = [], [], worlds_in(records, part)
    for chosen, judged in (_HALVES, _HALVES[::-1]):
        overall = best_beta(records, part, end, seeds=chosen)
        for world in worlds:
            best = best_beta(records, part, end, (world,), seeds=chosen)
            for beta, found in ((best, own), (overall, shared)):
                found.append(relative(records, part, f"beta-{beta}", end, (), (world,), judged))
    listed = ", ".join(f"{world} {best_beta(records, part, end, (world,))}" for world in worlds)
    text = f"{PARTS[part]}, {ENDS[end]}: every world's own best β ({listed}) is faster than the best of all "
    text += f"({best_beta(records, part, end)}), on other seeds than it was chosen on; t ratio"
    return _faster(
        f"{part}-no-single-{end}", text, "< 1", ratio_interval(np.concatenate(own), np.concatenate(shared))
    )


def _distance_claims(records: Records, part: str, name: str) -> list[Claim]:
    """To explore all, V/t visits nearly as many points as the best β, on shorter paths (abstract)."""
    best = best_beta(records, part, "t_none_s")
    scans, lengths = (
        compared(records, part, "ptv", f"beta-{best}", what) for what in ("scans", "distance_m")
    )
    alike = scans.low > 1.0 - _ALIKE and scans.high < 1.0 + _ALIKE
    text = f"{name}, to no frontier: V/t scans from nearly as many points as the best β ({best}); ratio"
    shorter = f"{name}, to no frontier: ways of V/t are shorter than those of the best β ({best}); ratio"
    return [
        Claim(f"{part}-points", text, "about 1", *scans, alike),
        _faster(f"{part}-ways", shorter, "< 1", lengths),
    ]


def _our_claims(records: Records, part: str, name: str) -> list[Claim]:
    """Not the paper's: the finishing rule, other rules, and the gain over the best β by team size."""
    claims = []
    for end in ENDS:
        ratio = compared(records, part, "finish", "ptv", end)
        text = f"ours, {name}, {ENDS[end]}: (V + bonus)/t is faster than V/t; t ratio"
        claims.append(_faster(f"{part}-finish-{end}", text, None, ratio))
    for other, metric in (("nearest", "Yamauchi"), ("coordinated", "Burgard")):
        for end in ("t95_s", "t_none_s"):
            ratio = compared(records, part, "ptv", other, end)
            text = f"ours, {name}, {ENDS[end]}: V/t is faster than {metric}'s metric; t ratio"
            claims.append(_faster(f"{part}-{other}-{end}", text, None, ratio))
    for n in teams_in(records, part):
        if n > 1:
            ratio = compared(records, part, "ptv", "sync", "t95_s", (n,))
            text = f"ours, {name}, to 95 %, {n} robots: asynchronous is faster than synchronous; t ratio"
            claims.append(_faster(f"{part}-async-team-{n}", text, None, ratio))
    best = best_beta(records, part, "t95_s")
    for n in teams_in(records, part):
        ratio = compared(records, part, "ptv", f"beta-{best}", "t95_s", (n,))
        text = f"{name}, to 95 %, {n} robot{'s' * (n > 1)}: V/t is faster than β = {best}; t ratio"
        said = part == "plans" and n == 1
        text, paper = (text, PAPER_SINGLE) if said else (f"ours, {text}", None)
        claims.append(_faster(f"{part}-team-{n}", text, paper, ratio))
    return claims


def changes_in(records: Records, part: str) -> dict[str, tuple[str, ...]]:
    """What was changed in a part → the worlds in which it was."""
    found = {
        change: tuple(w for w in CHANGED_IN[part] if cell_id(w, CHANGED_TEAM, "ptv", change) in records)
        for change in CHANGES[part]
    }
    return {change: worlds for change, worlds in found.items() if worlds}


def changed_ratio(
    records: Records, change: str | None, method: str, end: str, worlds: Sequence[str]
) -> Interval:
    """V/t over another method at `CHANGED_TEAM`, with one thing changed; relative in each world."""
    return ratio_interval(*_changed(records, change, method, end, worlds))


def fastest_changed(
    records: Records, change: str | None, methods: Sequence[str], end: str, worlds: Sequence[str]
) -> str:
    """Of some methods the one with the least mean time, relative to V/t in each world."""
    return min(methods, key=lambda method: _changed(records, change, method, end, worlds)[1].mean())


def _changed(
    records: Records, change: str | None, method: str, end: str, worlds: Sequence[str]
) -> tuple[np.ndarray, np.ndarray]:
    """(N,) relative times of V/t and of another method, by world and seed."""
    return _in_units_of_first(records, (("ptv", change), (method, change)), end, worlds)


def _in_units_of_first(
    records: Records, pair: Sequence[tuple[str, str | None]], end: str, worlds: Sequence[str]
) -> tuple[np.ndarray, np.ndarray]:
    """(N,) times of two methods, each with what is changed, over the first one's mean in each world."""
    found: tuple[list[np.ndarray], list[np.ndarray]] = [], []
    for world in worlds:
        both = [times(records, cell_id(world, CHANGED_TEAM, *cell), end) for cell in pair]
        for values, taken in zip(found, both, strict=True):
            values.append(taken / both[0].mean())
    return np.concatenate(found[0]), np.concatenate(found[1])


def changed_table(records: Records) -> str:
    """Return V/t over the faster of β = 5 and 20 to 95 %, with one thing changed."""
    rows = []
    for part in PARTS:
        changes = changes_in(records, part)
        betas = [method for method in CHANGED_METHODS[part] if method.startswith("beta-")]
        worlds = next(iter(changes.values()), ())
        for change in (None, *changes) if changes else ():
            other = fastest_changed(records, change, betas, "t95_s", worlds)
            text = "as it is" if change is None else CHANGES[part][change].text
            ratio = changed_ratio(records, change, other, "t95_s", worlds)
            rows.append([f"{PARTS[part]}, {text}", f"{ratio:.2f}"])
    return markdown_table(["changed", "V/t over the faster β, to 95 %"], rows)


def maps_table(records: Records) -> str:
    """Return mean seconds to no frontier in plans from files, by method; without such plans a sentence."""
    rows = []
    for world in dict.fromkeys(cell.split("/")[0] for cell in records if cell.startswith("map-")):
        cells = [cell_id(world, MAP_TEAM, method) for method in MAP_METHODS]
        means = [f"{mean_interval(times(records, cell, 't_none_s')).value:,.0f}" for cell in cells]
        rows.append([world.removeprefix("map-"), *means])
    return markdown_table(["plan", *MAP_METHODS], rows) if rows else "None were given."


def held_of_paper(records: Records) -> str:
    """Return how many claims hold, the paper's and ours."""
    claims = all_claims(records)
    ours = [claim.holds for claim in claims if claim.paper is None]
    paper = [claim.holds for claim in claims if claim.paper is not None]
    return f"{sum(paper)} of the paper's {len(paper)}, and {sum(ours)} of {len(ours)} of ours"
