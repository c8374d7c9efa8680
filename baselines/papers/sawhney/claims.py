"""The claims of Sawhney 2009, each beside what was measured, at three ends: 95 %, 99 %, no frontier left.

Times are relative: over the mean of V/t, asynchronous, in the same world with the same team, so that all
worlds and team sizes weigh alike. Missions of all team sizes in one world with one seed have the same plan or
ground, and count as one, their mean; methods are paired by world and seed.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from baselines.experiments.claims import SAME, Claim, above, below
from baselines.experiments.experiment import Records, sample
from baselines.experiments.statistics import Interval, ratio_interval
from baselines.papers.sawhney.sweep import (
    BETAS,
    DEM,
    FARTHER_BETAS,
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
    """Return the worlds of a part that were run."""
    worlds = PLANS if part == "plans" else (*TERRAINS, DEM)
    return tuple(w for w in worlds if any(cell_id(w, n, "ptv") in records for n in TEAMS))


def teams_in(records: Records, part: str) -> tuple[int, ...]:
    """Return the team sizes of a part that were run."""
    worlds = worlds_in(records, part)
    return tuple(n for n in TEAMS if worlds and cell_id(worlds[0], n, "ptv") in records)


def betas_in(records: Records, part: str) -> tuple[int, ...]:
    """Return the β that were run in a part, in the paper's numbers."""
    world, team = worlds_in(records, part)[0], teams_in(records, part)[0]
    return tuple(b for b in (*BETAS, *FARTHER_BETAS[part]) if cell_id(world, team, f"beta-{b}") in records)


def relative(
    records: Records,
    part: str,
    method: str,
    end: str,
    teams: Sequence[int] = (),
    worlds: Sequence[str] = (),
    seeds: slice = _ALL,
) -> np.ndarray:
    """Return (N,) relative times of a method by world and seed, means over teams; all methods in one order.

    An end is the name of a time in a record, or of anything else that is counted there. Without teams or
    worlds all that were run count.
    """
    found = []
    for world in worlds or worlds_in(records, part):
        by_team = []
        for n in teams or teams_in(records, part):
            unit = sample(records, cell_id(world, n, "ptv"), end)[seeds].mean()
            by_team.append(sample(records, cell_id(world, n, method), end)[seeds] / unit)
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
    """Return the time of a method over that of another, with its 95 % interval."""
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
    """Return the β with the least mean time over worlds and team sizes; chosen from these same missions."""
    found = [beta for beta in betas_in(records, part) if beta in among]
    return min(found, key=lambda b: relative(records, part, f"beta-{b}", end, teams, worlds, seeds).mean())


def all_claims(records: Records) -> list[Claim]:
    """Return every claim, from the missions' records by cell."""
    kinds = (_paper_claims, _extreme_claims, _distance_claims, _our_claims)
    parts = [part for part in PARTS if worlds_in(records, part)]
    return [claim for part in parts for kind in kinds for claim in kind(records, part)]


def _paper_claims(records: Records, part: str) -> list[Claim]:
    """Claim what is faster: asynchronous allocation, V/t, ray-cast V, the height factor, own β."""
    several = [n for n in teams_in(records, part) if n > 1]
    claims = []
    for end, text in ENDS.items():
        best = best_beta(records, part, end)
        rivals: dict[str, tuple[str, float | str, Sequence[int]]] = {
            "async": ("sync", PAPER_ASYNCHRONOUS[part], several),
            "beta": (f"beta-{best}", PAPER_BEST_BETA[part], ()),
            "naive": ("naive", SAME, ()),
            "no-height": ("no-height", SAME, ()),
        }
        skipped = {"no-height"} if part == "plans" else set()
        for name, (rival, paper, teams) in rivals.items():
            if name in skipped or (name == "async" and not several):
                continue
            ratio = compared(records, part, "ptv", rival, end, teams)
            said = f"{text}, β = {best}" if name == "beta" else text
            claims.append(below(f"{part}-{name}-{end}", ratio, claim=said, paper=paper))
        claims.append(_no_single_beta(records, part, end))
    return claims


def _extreme_claims(records: Records, part: str) -> list[Claim]:
    """Claim that the smallest and the largest β are slower than the best."""
    claims, swept = [], betas_in(records, part)
    betas = [beta for beta in swept if beta in BETAS]
    for end, text in ENDS.items():
        widest = best_beta(records, part, end, among=swept)
        place, inside = f"{swept.index(widest) + 1} of {len(swept)}", swept[0] < widest < swept[-1]
        claims.append(
            Claim(f"{part}-interior-{end}", None, place, None, None, inside, f"{text}, β = {widest}")
        )
        best = best_beta(records, part, end)
        for beta in (betas[0], betas[-1]):
            ratio = compared(records, part, f"beta-{beta}", f"beta-{best}", end)
            claims.append(above(f"{part}-extreme-{beta}-{end}", ratio, claim=f"{text}, β = {best}"))
    return claims


def _no_single_beta(records: Records, part: str, end: str) -> Claim:
    """Claim that every world's own best β is faster than the best of all.

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
    text = f"{ENDS[end]}, β: {listed}, all {best_beta(records, part, end)}"
    ratio = ratio_interval(np.concatenate(own), np.concatenate(shared))
    return below(f"{part}-no-single-{end}", ratio, claim=text)


def _distance_claims(records: Records, part: str) -> list[Claim]:
    """Claim that V/t visits nearly as many points as the best β to explore all, on shorter paths."""
    best = best_beta(records, part, "t_none_s")
    scans, lengths = (
        compared(records, part, "ptv", f"beta-{best}", what) for what in ("scans", "distance_m")
    )
    alike = scans.low > 1.0 - _ALIKE and scans.high < 1.0 + _ALIKE
    text = f"to no frontier, β = {best}"
    return [
        Claim(f"{part}-points", "about 1", *scans, alike, text),
        below(f"{part}-ways", lengths, claim=text),
    ]


def _our_claims(records: Records, part: str) -> list[Claim]:
    """Claim what the paper does not: the finishing rule, other rules, and gains by team size."""
    claims = []
    for name, (ours, theirs) in {
        "finish": ("finish", "ptv"),
        "nearest": ("ptv", "nearest"),
        "coordinated": ("ptv", "coordinated"),
    }.items():
        for end in ENDS if name == "finish" else ("t95_s", "t_none_s"):
            ratio = compared(records, part, ours, theirs, end)
            claims.append(below(f"{part}-{name}-{end}", ratio, claim=ENDS[end], paper=None))
    best = best_beta(records, part, "t95_s")
    for n in teams_in(records, part):
        if n > 1:
            ratio = compared(records, part, "ptv", "sync", "t95_s", (n,))
            claims.append(below(f"{part}-async-team-{n}", ratio, claim="to 95 %", paper=None))
        ratio = compared(records, part, "ptv", f"beta-{best}", "t95_s", (n,))
        paper = PAPER_SINGLE if part == "plans" and n == 1 else None
        claims.append(below(f"{part}-team-{n}", ratio, claim=f"to 95 %, β = {best}", paper=paper))
    return claims


def held_of_paper(records: Records) -> str:
    """Return how many claims hold, the paper's and ours."""
    claims = all_claims(records)
    ours = [claim.holds for claim in claims if claim.paper is None]
    paper = [claim.holds for claim in claims if claim.paper is not None]
    return f"{sum(paper)} of the paper's {len(paper)}, and {sum(ours)} of {len(ours)} of ours"
