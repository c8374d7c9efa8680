"""The claims of Bhattacharya 2010, each beside what was measured."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np

from baselines.experiments.claims import Claim, above, below
from baselines.experiments.experiment import Records, ratio_of, sample
from baselines.experiments.rows import Record
from baselines.experiments.statistics import Interval, mean_interval, median_interval, ratio_interval
from baselines.experiments.tables import cells_table, markdown_table
from baselines.papers.bhattacharya.sweep import (
    CHANNELS,
    CONTROLS,
    FLOORS,
    LOSSES,
    RIVALS,
    channel_id,
    coverage_id,
    exploration_id,
)

STARTS = ("random", "cluster")
_SECONDS = {"projected": 0.03, "gradient": 0.1}
_EXPLORATION_S = 1.7
_UTILITY = "bits_gained_per_bit_sent"
"""Bits taken from the hearers' maps, for each bit sent."""
GROUPS = {
    "converges-projected-": "(a) projected centroid: share of runs that converge",
    "converges-projected-guarded-": "(a) the same, guarded (ours)",
    "converges-gradient-": "(a) gradient search: the same",
    "iterations-": "(a) iterations of those, median",
    "falls-": "(d) iterations a run in which the functional rises",
    "seconds-projected": "(a) projected centroid: seconds an iteration (2.1 GHz Pentium)",
    "seconds-gradient": "(a) gradient search: seconds an iteration",
    "explores-": "(b) share of runs that explore all, and converge",
    "within-": "(b) iterations until then",
    "seconds-exploration": "(b) seconds of an iteration with cells and controls",
    "seconds-mean": "(b) the same, mean of all iterations",
    "scipy": "(b) SciPy's Dijkstra over our tessellation; ratio",
    "variant-metric-": "(b) entropy-weighted cells explore faster than plain ones",
    "variant-nearest-": "ours: the nearest uncertain cell is faster than the centroid",
    "variant-both-": "ours: plain cells and nearest targets are faster",
    "variant-phases-": "perfect messages are faster than phases",
    "variant-loss-": "phases without losses are faster than half lost",
    "split-plain-": "(c) plain cells split the unknown area unevenly",
    "split-": "(c) entropy-weighted cells split it evenly",
    "utility-": "(f) sending at once brings more entropy a bit",
    "time-": "(f) sending at once maps faster",
}
"""Beginning of ids → what the claims are, on the page."""


def all_claims(records: Records) -> list[Claim]:
    """Return every claim."""
    points = [
        (floor, *point)
        for floor, plan in FLOORS.items()
        for point in (*(("paper", r) for r in plan.ranges), ("nearest-length", plan.middle))
    ]
    return [
        *(claim for control in CONTROLS for claim in _coverage_claims(records, control)),
        *(claim for point in points for claim in _exploration_claims(records, *point)),
        *_time_claims(records),
        *(claim for floor in FLOORS for claim in _variant_claims(records, floor)),
        *_split_claims(records["measured"][0]["splits"]),
        *channel_claims(records),
    ]


def exploring(records: Records, floor: str, variant: str, range_cells: float) -> list[Record]:
    """Return the records of (b) on a kind of plan, by seed."""
    return records.get(exploration_id(floor, variant, range_cells), [])


def first_floor(records: Records, variant: str) -> str:
    """Return the first kind of plan, and so the largest, on which a variant was run at the middle range."""
    return next(f for f, plan in FLOORS.items() if exploration_id(f, variant, plan.middle) in records)


def interval(found: Interval, runs: int) -> tuple[float, float | None, float | None]:
    """Return a figure with its interval, which one run does not have."""
    return found if runs > 1 else (found[0], None, None)


def _coverage_claims(records: Records, control: str) -> list[Claim]:
    """Claim convergence, its speed, and the fall of the functional: (a) and (d)."""
    claims, both = [], list[Record]()
    for starts in STARTS:
        found = records.get(coverage_id(control, starts), [])
        both += found
        ended = [record["ended"] == "converged" for record in found]
        claims.append(Claim(f"converges-{control}-{starts}", 1.0, *mean_interval(ended), all(ended)))
        iterations = [record["iterations"] for record in found if record["ended"] == "converged"]
        if iterations:
            claims.append(below(f"iterations-{control}-{starts}", median_interval(iterations), 150))
    rises, largest = [each["rises"] for each in both], max(each["largest_rise"] for each in both)
    text = f"the largest by {largest:.2%}"
    claims.append(Claim(f"falls-{control}", 0.0, *mean_interval(rises), max(rises) == 0, text))
    if control in _SECONDS:
        seconds = median_interval([record["seconds_an_iteration"] for record in both])
        paper = _SECONDS[control]
        claims.append(Claim(f"seconds-{control}", paper, *seconds, seconds.high <= paper))
    return claims


def _exploration_claims(records: Records, floor: str, variant: str, range_cells: float) -> list[Claim]:
    """Claim that an exploration ends, and when."""
    found = exploring(records, floor, variant, range_cells)
    if not found:
        return []
    ended = [record["ended"] == "converged" for record in found]
    share = interval(mean_interval(ended), len(found))
    name = f"{variant}-{floor}-{range_cells:g}"
    claims = [Claim(f"explores-{name}", 1.0, *share, all(ended))]
    if all(ended):
        middle = interval(median_interval([record["iterations"] for record in found]), len(found))
        most = FLOORS[floor].paper
        claims.append(Claim(f"within-{name}", f"≤ {most}", *middle, middle[0] <= most))
    return claims


def _time_claims(records: Records) -> list[Claim]:
    measured = records["measured"][0]
    floor = first_floor(records, "paper")
    found = exploring(records, floor, "paper", FLOORS[floor].middle)
    busy_s = [record["seconds_with_tessellation"] for record in found]
    middle = interval(median_interval(busy_s), len(found))
    mean_s = float(np.mean([record["seconds_an_iteration"] for record in found]))
    idle = "a robot under way to its target needs no cells"
    scipy_s, ours_s = measured["scipy_s"], measured["ours_s"]
    ratio, text = scipy_s / ours_s, f"{scipy_s:.3f} s and {ours_s:.3f} s"
    return [
        Claim("seconds-exploration", _EXPLORATION_S, *middle, middle[0] <= _EXPLORATION_S),
        Claim("seconds-mean", _EXPLORATION_S, mean_s, None, None, mean_s <= _EXPLORATION_S, idle),
        Claim("scipy", None, ratio, None, None, ratio > 1.0, text),
    ]


def _variant_claims(records: Records, floor: str) -> list[Claim]:
    """Claim that what the paper adds, and ours, is faster than its opposite; paired by plan."""
    claims = []
    for name, ours, rival in (
        ("metric", "paper", "length"),
        ("nearest", "nearest", "paper"),
        ("both", "nearest-length", "paper"),
        ("phases", "paper", "phases"),
        ("loss", "phases", "phases-loss"),
    ):
        both = (exploring(records, floor, variant, FLOORS[floor].middle) for variant in (ours, rival))
        pairs = [tuple(map(until_explored, pair)) for pair in zip(*both, strict=False)]  # or one was not run
        if pairs:
            ratio = interval(ratio_interval(*zip(*pairs, strict=True)), len(pairs))
            holds = (ratio[0] if ratio[2] is None else ratio[2]) < 1.0
            text = f"iterations until all is explored; plans: {len(pairs)}"
            paper = "< 1" if name == "metric" else None
            claims.append(Claim(f"variant-{name}-{floor}", paper, *ratio, holds, text))
    return claims


def until_explored(record: Record) -> int:
    """Return the iterations until all was explored; if it never was, all of them."""
    return record["iterations"] if record["explored_at"] is None else record["explored_at"]


def _split_claims(splits: dict[str, Any]) -> list[Claim]:
    claims = []
    for region, ratios in splits.items():
        plain, weighted = ratios["plain"], ratios["0.01"]
        claims += [
            Claim(f"split-plain-{region}", "≠ 1", plain, None, None, not 0.9 <= plain <= 1.1),
            Claim(f"split-{region}", 1.0, weighted, None, None, 0.9 <= weighted <= 1.1, "η = 0.01"),
        ]
    return claims


def channel_claims(records: Records) -> list[Claim]:
    """Claim that selection by utility is better than phases at as many bits a scan; paired by seed."""
    claims = []
    for loss, (phases, utility) in product(LOSSES, RIVALS.items()):
        ours, theirs = channel_id(utility, loss), channel_id(phases, loss)
        if ours in records:
            gained = ratio_interval(utilities(records, ours), utilities(records, theirs))
            claims.append(above(f"utility-{phases}-{loss:g}", gained, paper=None))
            claims.append(below(f"time-{phases}-{loss:g}", ratio_of(records, ours, theirs), paper=None))
    return claims


def utilities(records: Records, cell: str) -> np.ndarray:
    """Return (N,) bits taken from the hearers' maps, for each bit sent; 0 where nothing was sent."""
    return np.array([record[_UTILITY] or 0.0 for record in records[cell]])


def coverage_table(records: Records) -> str:
    """Return a table of (a) and (d)."""

    def ended(cell: str, how: str, figure: str) -> list[int]:
        return sorted(record[figure] for record in records[cell] if record["ended"] == how)

    def cycles(cell: str) -> str:
        found = ended(cell, "cycle", "cycle")
        return f"{found[0]} … {found[-1]}" if found else "-"

    def iterations(cell: str) -> str:
        found = ended(cell, "converged", "iterations")
        return f"{median_interval(found):,.0f}" if found else "-"

    columns = {
        "converged": lambda cell: f"{len(ended(cell, 'converged', 'iterations'))} of {len(records[cell])}",
        "median iterations": iterations,
        "limit cycles": cycles,
        "rises of H a run": lambda cell: f"{sample(records, cell, 'rises').mean():.1f}",
    }
    rows = [(names, coverage_id(*names)) for names in product(CONTROLS, STARTS)]
    return cells_table(["control", "starts"], rows, columns)


def exploration_table(records: Records) -> str:
    """Return a table of (b)."""

    def converged(cell: str) -> str:
        return f"{sum(each['ended'] == 'converged' for each in records[cell])} of {len(records[cell])}"

    def explored(cell: str) -> str:
        bound = "≥ " if any(record["explored_at"] is None for record in records[cell]) else ""
        return f"{bound}{np.median([until_explored(record) for record in records[cell]]):,.0f}"

    rows = [
        ((floor, variant, f"{range_cells:g}"), cell)
        for floor, plan in FLOORS.items()
        for variant, range_cells in plan.points
        if (cell := exploration_id(floor, variant, range_cells)) in records
    ]
    columns = {"converged": converged, "all explored at (median)": explored}
    return cells_table(["plan", "variant", "range (cells)"], rows, columns)


def split_table(records: Records) -> str:
    """Return a table of (c)."""
    splits = records["measured"][0]["splits"]
    names = list(next(iter(splits.values())))
    rows = [[region, *(f"{found[name]:.2f}" for name in names)] for region, found in splits.items()]
    return markdown_table(["unknown region", "plain cells", *(f"η = {name}" for name in names[1:])], rows)


def channel_table(records: Records) -> str:
    """Return a table of both schemes: means for each share of messages that is lost."""
    rows = []
    for channel in CHANNELS:
        cells = [channel_id(channel, loss) for loss in LOSSES]
        times = [f"{sample(records, cell).mean():,.0f}" for cell in cells]
        rows.append([channel, *times, *(f"{utilities(records, cell).mean():.3f}" for cell in cells)])
    heads = [f"{what}, loss {loss:g}" for what in ("mean t (s)", "utility") for loss in LOSSES]
    return markdown_table(["channel", *heads], rows)
