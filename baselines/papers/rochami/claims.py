"""The claims of RochaMI, each beside what was measured."""

from __future__ import annotations

from itertools import pairwise, product

import numpy as np

from baselines.experiments.claims import Claim, above, below
from baselines.experiments.experiment import Records, ratio_of, sample
from baselines.experiments.statistics import (
    Interval,
    holm,
    interpolated_ratio_interval,
    mean_interval,
    paired_p,
    ratio_interval,
)
from baselines.experiments.tables import cells_table
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
    """Return every claim, from the missions' records by cell."""
    return [
        *(claim for blocked in BLOCKED for claim in _faster_claims(records, blocked)),
        *(claim for blocked in BLOCKED for claim in _size_claims(records, blocked)),
        *_kappa_claims(records),
        *_random_claims(records),
        *_sharing_claims(records),
    ]


def distances(records: Records, cell: str) -> np.ndarray:
    """Return (N,) metres that a robot drove on average, by seed."""
    return sample(records, cell, "distance_m") / sample(records, cell, "robots")


def teams_in(records: Records) -> tuple[int, ...]:
    """Return the team sizes of the main experiment that were run."""
    return tuple(n for n in TEAMS if cell_id(n, "coordinated") in records)


def _faster_claims(records: Records, blocked: str) -> list[Claim]:
    """Claim that coordinated teams are faster, whatever their size."""
    claims, sizes = [], teams_in(records)
    pairs = [[cell_id(n, method, blocked) for method in METHODS[:2]] for n in sizes]
    corrected = holm([paired_p(*(sample(records, cell) for cell in pair)) for pair in pairs])
    for n, pair, p in zip(sizes, pairs, corrected, strict=True):
        text = f"Wilcoxon, Holm: p = {p:.1g}"
        ratio = ratio_of(records, *pair)
        claims.append(Claim(f"faster-{blocked}-{n}", "< 1", *ratio, bool(p < LEVEL), text))
    return claims


def _size_claims(records: Records, blocked: str) -> list[Claim]:
    """Claim how the times change with the team's size."""
    sizes, alone = teams_in(records), cell_id(1, "coordinated")
    joint, apart = ({n: cell_id(n, method, blocked) for n in sizes} for method in METHODS[:2])
    claims = []
    for method, cells, paper in (
        ("coordinated", joint, PAPER_COORDINATED),
        ("uncoordinated", apart, PAPER_UNCOORDINATED),
    ):
        ratio = ratio_of(records, cells[2], alone)
        claims.append(Claim(f"pair-{blocked}-{method}", paper, *ratio, ratio.low <= paper <= ratio.high))
    up_to_8, last = [n for n in sizes if n <= 8], sizes[-1]
    ratio = ratio_of(records, joint[up_to_8[-1]], joint[2])
    falls = ratio.high < 1 and _falls([sample(records, joint[n]) for n in up_to_8])
    text = _means([sample(records, cell) for cell in joint.values()]) + f" s for {_list(sizes)} robots"
    claims.append(Claim(f"falls-{blocked}", "falls", *ratio, falls, text))
    if last > 8:
        ratio = ratio_of(records, joint[last], joint[8])
        claims.append(Claim(f"flattens-{blocked}", "≥ 1", *ratio, ratio.high >= 1))
    text = _means([sample(records, cell) for cell in apart.values()]) + f" s for {_list(sizes)} robots"
    return [
        *claims,
        above(f"worsens-{blocked}", ratio_of(records, apart[last], apart[2]), claim=text),
        above(f"slower-{blocked}", ratio_of(records, apart[last], alone), claim=f"{last} robots"),
    ]


def _falls(samples: list[np.ndarray]) -> bool:
    """Return whether the mean falls from each sample to the next."""
    return all(later.mean() < earlier.mean() for earlier, later in pairwise(samples))


def _means(samples: list[np.ndarray]) -> str:
    return ", ".join(f"{each.mean():,.0f}" for each in samples)


def _list(numbers: tuple[float, ...]) -> str:
    return ", ".join(f"{number:g}" for number in numbers)


def _kappa_claims(records: Records) -> list[Claim]:
    """Claim what the cost of distance does to two robots."""
    kappas = tuple(kappa for kappa in KAPPAS if kappa_id(kappa) in records)
    time_s = [sample(records, kappa_id(kappa)) for kappa in kappas]
    path_m = [distances(records, kappa_id(kappa)) for kappa in kappas]
    both = [times * metres for times, metres in zip(time_s, path_m, strict=True)]
    middle = min(range(len(kappas)), key=lambda place: abs(kappas[place] - _KNEE))
    longer, shorter = ratio_interval(time_s[-1], time_s[0]), ratio_interval(path_m[-1], path_m[0])
    rises, falls = longer.low > 1 and _falls(time_s[::-1]), shorter.high < 1 and _falls(path_m)
    asked = f"for κ = {_list(kappas)}"
    level = ratio_interval(both[-1], both[middle])
    levels = 1 - _LEVEL_BAND <= level.value <= 1 + _LEVEL_BAND
    return [
        Claim("kappa-time", "> 1, monotone", *longer, rises, f"{_means(time_s)} s {asked}"),
        Claim("kappa-distance", "< 1, monotone", *shorter, falls, f"{_means(path_m)} m {asked}"),
        below("kappa-product-falls", ratio_interval(both[middle], both[0])),
        Claim("kappa-product", "≈ 1", *level, levels),
    ]


def _random_claims(records: Records) -> list[Claim]:
    """Claim, which the paper does not, that coordinated teams are faster than random walks."""
    claims = []
    for n in (1, *teams_in(records)):
        for walk, name in ((cell_id(n, "random"), "as"), (f"n{n}-random-1m", "steps")):
            ratio = ratio_of(records, cell_id(n, "coordinated"), walk)
            claims.append(below(f"random-{n}-{name}", ratio, paper=None))
    return claims


def _sharing_claims(records: Records) -> list[Claim]:
    """Claim that a steered I_min, Rocha04's further work, is not slower than fixed ones at equal bits."""
    claims = []
    for robots, i_min in product(SHARING_TEAMS, I_MINS):
        if sharing_id(robots, i_min) in records:
            ratio, read_at = steered_ratio(records, robots, i_min)
            claims.append(Claim(f"steered-{robots}-{i_min}", None, *ratio, ratio.low <= 1, read_at))
    return claims


def bits_sent(records: Records, cell: str) -> np.ndarray:
    """Return (N,) megabits that a team sent, measurements and all else, by seed."""
    return sample(records, cell, "bits_sent") / 1e6


def steered_ratio(records: Records, robots: int, i_min_bits: float) -> tuple[Interval, str]:
    """Return the time with a steered I_min over that with a fixed one, and at which bits it was read."""
    steered = [cell for fill in FILLS if (cell := sharing_id(robots, fill=fill)) in records]
    fixed = sharing_id(robots, i_min_bits)
    times = np.stack([sample(records, cell) for cell in steered])
    sent, there = np.stack([bits_sent(records, cell) for cell in steered]), bits_sent(records, fixed)
    ratio = interpolated_ratio_interval(times, sent, sample(records, fixed), there)
    means = sent.mean(axis=1)
    inside = means.min() <= there.mean() <= means.max()
    beyond = "" if inside else ", beyond its fills: the nearest one"
    return ratio, f"{there.mean():.2f} Mbit{beyond}"


def teams_table(records: Records) -> str:
    """Return a table of a few team sizes and all methods, blocked robots that wait and that wander."""
    rows = []
    for blocked, n in product(BLOCKED, (1, *FEW)):
        for method in ("coordinated", "random") if n == 1 else METHODS:
            name = "rule" if n == 1 and method != "random" else method
            rows.append(((blocked, n, name), cell_id(n, method, blocked)))

    def share_blocked(cell: str) -> str:
        return f"{(sample(records, cell, 'blocked_moves') / sample(records, cell, 'scans')).mean():.0%}"

    columns = {
        "mean t (s)": lambda cell: f"{mean_interval(sample(records, cell)):,.0f}",
        "blocked": share_blocked,
        "m a robot": lambda cell: f"{distances(records, cell).mean():.1f}",
    }
    return cells_table(["blocked robots", "robots", "method"], rows, columns)
