"""The claims of RochaMI, each beside what was measured."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise, product
from typing import NamedTuple

import numpy as np

from baselines.experiments.claims import Claim, above, below
from baselines.experiments.experiment import Records
from baselines.experiments.statistics import (
    Interval,
    holm,
    interpolated_ratio_interval,
    mean_interval,
    paired_p,
    ratio_interval,
)
from baselines.experiments.tables import markdown_table
from baselines.papers.rochami.sweep import (
    BLOCKED,
    FEW,
    FILLS,
    I_MINS,
    KAPPAS,
    METHODS,
    SHARING_TEAMS,
    TEAMS,
    cell_id,
    kappa_id,
    sharing_id,
)

LEVEL = 0.01
PAPER_UNCOORDINATED, PAPER_COORDINATED, PAPER_REAL = 0.81, 0.59, 0.72
"""Time of two robots over that of one: both methods, and an earlier real run without coordination."""
_KNEE = 0.25
"""κ up to which distance falls at little cost in time."""
_LEVEL_BAND = 0.1
"""A product that changes by less than this share has levelled off."""


GROUPS = {
    "faster-wait": "blocked robots wait: the coordinated team is faster, each team size; t ratio",
    "faster-wander": "blocked robots wander: the coordinated team is faster, each team size; t ratio",
    "pair-wait-coordinated": "wait, coordinated: t(2)/t(1)",
    "pair-wait-uncoordinated": "wait, uncoordinated: t(2)/t(1)",
    "pair-wander-coordinated": "wander, coordinated: t(2)/t(1)",
    "pair-wander-uncoordinated": "wander, uncoordinated: t(2)/t(1)",
    "falls-": "coordinated: t falls from 2 to 8 robots, wait and wander; t(8)/t(2)",
    "flattens-": "coordinated: beyond 8 robots t does not fall any more; t(10)/t(8)",
    "worsens-": "uncoordinated: t rises from 2 robots on; t(last)/t(2)",
    "slower-": "uncoordinated: the largest team is slower than one robot; t(last)/t(1)",
    "kappa-time": "2 robots: t rises with κ; t(1)/t(0)",
    "kappa-distance": "2 robots: the distance driven falls with κ; d(1)/d(0)",
    "kappa-product-falls": "2 robots: t·d falls up to κ = ¼; ratio",
    "kappa-product": "2 robots: t·d levels off beyond κ = ¼ (within 10 %); ratio",
    "random-": "ours: coordinated is faster than random walks (as far; steps up to 1 m); t ratio",
    "steered-": "Rocha04's room: a steered I_min is not slower than a fixed one at equal bits; t ratio",
}
"""Beginning of ids → what the claims are, on the page."""


def all_claims(records: Records) -> list[Claim]:
    """Every claim, from the missions' records by cell."""
    claims = []
    for blocked in BLOCKED:
        claims += _faster_claims(records, blocked)
    for blocked in BLOCKED:
        claims += [*_pair_claims(records, blocked), *_size_claims(records, blocked)]
    return [*claims, *_kappa_claims(records), *_random_claims(records), *_sharing_claims(records)]


def times(records: Records, cell: str) -> np.ndarray:
    """Mission times of a cell in seconds, by seed; a mission cut off counts with its limit."""
    return np.asarray([record["t_mission_s"] for record in records[cell]])


def distances(records: Records, cell: str) -> np.ndarray:
    """Metres that a robot drove on average, by seed."""
    return np.asarray([record["distance_m"] / record["robots"] for record in records[cell]])


def teams_in(records: Records) -> tuple[int, ...]:
    """Team sizes of the main experiment that there are."""
    return tuple(n for n in TEAMS if cell_id(n, "coordinated") in records)


def _faster_claims(records: Records, blocked: str) -> list[Claim]:
    """Coordinated teams are faster, whatever their size."""
    claims, sizes = [], teams_in(records)
    pairs = [
        (
            times(records, cell_id(n, "coordinated", blocked)),
            times(records, cell_id(n, "uncoordinated", blocked)),
        )
        for n in sizes
    ]
    corrected = holm([paired_p(*pair) for pair in pairs])
    for n, pair, p in zip(sizes, pairs, corrected, strict=True):
        ratio = ratio_interval(*pair)
        text = (
            f"blocked robots {blocked}, {n} robots: the coordinated team is faster (Wilcoxon, Holm: "
            f"p = {p:.1g}); t ratio"
        )
        claims.append(Claim(f"faster-{blocked}-{n}", text, "< 1", *ratio, bool(p < LEVEL)))
    return claims


def _pair_claims(records: Records, blocked: str) -> list[Claim]:
    """Two robots against one: the paper's ratios."""
    claims, alone = [], times(records, cell_id(1, "coordinated"))
    for method, paper in (("coordinated", PAPER_COORDINATED), ("uncoordinated", PAPER_UNCOORDINATED)):
        ratio = ratio_interval(times(records, cell_id(2, method, blocked)), alone)
        text = f"blocked robots {blocked}, {method}: t(2)/t(1)"
        holds = ratio.low <= paper <= ratio.high
        claims.append(Claim(f"pair-{blocked}-{method}", text, paper, *ratio, holds))
    return claims


def _size_claims(records: Records, blocked: str) -> list[Claim]:
    """How the times change with the team's size."""
    sizes, alone = teams_in(records), times(records, cell_id(1, "coordinated"))
    joint = {n: times(records, cell_id(n, "coordinated", blocked)) for n in sizes}
    apart = {n: times(records, cell_id(n, "uncoordinated", blocked)) for n in sizes}
    up_to_8 = [n for n in sizes if n <= 8]
    falls = all(joint[later].mean() < joint[earlier].mean() for earlier, later in pairwise(up_to_8))
    ratio = ratio_interval(joint[up_to_8[-1]], joint[2])
    shown = ", ".join(f"{joint[n].mean():,.0f}" for n in sizes)
    prefix = f"blocked robots {blocked}, "
    text = f"{prefix}coordinated: t falls from 2 to 8 robots ({shown} s for {_list(sizes)}); t(8)/t(2)"
    claims = [Claim(f"falls-{blocked}", text, "falls", *ratio, falls and ratio.high < 1)]
    last = sizes[-1]
    if last > 8:
        ratio = ratio_interval(joint[last], joint[8])
        text = f"{prefix}coordinated: beyond 8 robots t does not fall any more; t({last})/t(8)"
        claims.append(Claim(f"flattens-{blocked}", text, "≥ 1", *ratio, ratio.high >= 1))
    ratio = ratio_interval(apart[last], apart[2])
    shown = ", ".join(f"{apart[n].mean():,.0f}" for n in sizes)
    text = f"{prefix}uncoordinated: t rises from 2 robots on ({shown} s for {_list(sizes)}); t({last})/t(2)"
    claims.append(above(f"worsens-{blocked}", text, ratio))
    ratio = ratio_interval(apart[last], alone)
    text = f"{prefix}uncoordinated: {last} robots are slower than one; t({last})/t(1)"
    return [*claims, above(f"slower-{blocked}", text, ratio)]


def _list(sizes: Sequence[int]) -> str:
    return ", ".join(map(str, sizes)) + " robots"


def _kappa_claims(records: Records) -> list[Claim]:
    """What the cost of distance does to two robots."""
    kappas = [kappa for kappa in KAPPAS if kappa_id(kappa) in records]
    time_s = {kappa: times(records, kappa_id(kappa)) for kappa in kappas}
    path_m = {kappa: distances(records, kappa_id(kappa)) for kappa in kappas}
    both = {kappa: time_s[kappa] * path_m[kappa] for kappa in kappas}
    last = kappas[-1]
    shown = [", ".join(f"{values[kappa].mean():,.0f}" for kappa in kappas) for values in (time_s, path_m)]
    asked = f"κ = {', '.join(f'{kappa:g}' for kappa in kappas)}"
    rises = all(time_s[b].mean() > time_s[a].mean() for a, b in pairwise(kappas))
    ratio = ratio_interval(time_s[last], time_s[0.0])
    text = f"2 robots: t rises with κ ({shown[0]} s for {asked}); t({last:g})/t(0)"
    claims = [Claim("kappa-time", text, "> 1, monotone", *ratio, rises and ratio.low > 1)]
    falls = all(path_m[b].mean() < path_m[a].mean() for a, b in pairwise(kappas))
    ratio = ratio_interval(path_m[last], path_m[0.0])
    text = f"2 robots: the distance driven falls with κ ({shown[1]} m); d({last:g})/d(0)"
    claims.append(Claim("kappa-distance", text, "< 1, monotone", *ratio, falls and ratio.high < 1))
    middle = min(kappas, key=lambda kappa: abs(kappa - _KNEE))
    ratio = ratio_interval(both[middle], both[0.0])
    text = f"2 robots: t·d falls up to κ = {middle:g}; (t·d)({middle:g})/(t·d)(0)"
    claims.append(below("kappa-product-falls", text, ratio))
    ratio = ratio_interval(both[last], both[middle])
    text = f"2 robots: t·d levels off beyond κ = {middle:g} (within 10 %); (t·d)({last:g})/(t·d)({middle:g})"
    level = 1 - _LEVEL_BAND <= ratio.value <= 1 + _LEVEL_BAND
    return [*claims, Claim("kappa-product", text, "≈ 1", *ratio, level)]


def _random_claims(records: Records) -> list[Claim]:
    """Not the paper's: the coordinated team against random walks from the same starts."""
    claims = []
    for n in (1, *teams_in(records)):
        for walk, text in ((cell_id(n, "random"), "as far"), (f"n{n}-random-1m", "steps up to 1 m")):
            ratio = ratio_interval(times(records, cell_id(n, "coordinated")), times(records, walk))
            team = f"{n} robot{'s' if n > 1 else ''}"
            claim = f"ours, {team}: coordinated is faster than a random walk ({text}); t ratio"
            claims.append(Claim(f"random-{n}-{text.split()[0]}", claim, None, *ratio, ratio.high < 1))
    return claims


def _sharing_claims(records: Records) -> list[Claim]:
    """Rocha04's further work: a steered I_min against fixed ones, at equal bits sent."""
    claims = []
    for robots in SHARING_TEAMS:
        if sharing_id(robots, I_MINS[0]) not in records:
            continue
        for i_min_bits in I_MINS:
            ratio, read_at = steered_ratio(records, robots, i_min_bits)
            text = (
                f"Rocha04's room, {robots} robots: a steered I_min is not slower than {i_min_bits} at "
                f"the bits that it sends ({read_at}); t ratio"
            )
            name = f"steered-{robots}-{i_min_bits}"
            claims.append(Claim(name, text, None, *ratio, ratio.low <= 1))
    return claims


def bits_sent(records: Records, cell: str) -> np.ndarray:
    """Measurement bits and all that a team sent, by seed, in megabits."""
    return np.asarray([record["bits_sent"] / 1e6 for record in records[cell]])


class SteeredRatio(NamedTuple):
    """Time with a steered I_min over that with a fixed one, and where on the steered curve it was read."""

    ratio: Interval
    read_at: str


def steered_ratio(records: Records, robots: int, i_min_bits: float) -> SteeredRatio:
    """Time with a steered I_min, read between its fills at the bits of a fixed one, over that one's time."""
    fills = [fill for fill in FILLS if sharing_id(robots, fill=fill) in records]
    steered = [sharing_id(robots, fill=fill) for fill in fills]
    fixed = sharing_id(robots, i_min_bits)
    sent = np.stack([bits_sent(records, cell) for cell in steered])
    ratio = interpolated_ratio_interval(
        np.stack([times(records, cell) for cell in steered]),
        sent,
        times(records, fixed),
        bits_sent(records, fixed),
    )
    there, means = bits_sent(records, fixed).mean(), sent.mean(axis=1)
    inside = means.min() <= there <= means.max()
    return SteeredRatio(
        ratio, f"{there:.2f} Mbit" + ("" if inside else ", beyond its fills: the nearest one")
    )


def teams_table(records: Records) -> str:
    """Return a table of a few team sizes and all methods, blocked robots that wait and that wander."""
    rows = []
    for blocked, n in product(BLOCKED, (1, *FEW)):
        for method in ("coordinated", "random") if n == 1 else METHODS:
            cell = cell_id(n, method, blocked)
            sample, found = times(records, cell), records[cell]
            blocks = np.mean([record["blocked_moves"] / record["scans"] for record in found])
            rows.append(
                [
                    blocked,
                    n,
                    "rule" if n == 1 and method != "random" else method,
                    f"{mean_interval(sample):,.0f}",
                    f"{blocks:.0%}",
                    f"{distances(records, cell).mean():.1f}",
                ]
            )
    head = ["blocked robots", "robots", "method", "mean t (s)", "blocked", "m a robot"]
    return markdown_table(head, rows)


def cut_off(records: Records) -> int:
    """Return how many missions the time limit ended."""
    return sum(not record["finished"] for cell in records.values() for record in cell)
