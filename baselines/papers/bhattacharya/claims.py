"""The claims of Bhattacharya 2010, each beside what was measured."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np

from baselines.experiments.claims import Claim
from baselines.experiments.experiment import Records
from baselines.experiments.rows import Record
from baselines.experiments.statistics import Interval, mean_interval, median_interval, ratio_interval
from baselines.experiments.tables import markdown_table
from baselines.papers.bhattacharya.missions import CHANNELS, LOSSES, channel_claims, channel_id
from baselines.papers.bhattacharya.sweep import CONTROLS, FLOORS, coverage_id, exploration_id

STARTS = ("random", "cluster")
_NAMES = {
    "projected": "projected centroid",
    "projected-guarded": "the same, guarded",
    "gradient": "gradient search",
}
_SECONDS = {"projected": 0.03, "gradient": 0.1}


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


def covering(records: Records, control: str, starts: str) -> list[Record]:
    """Return the records of (a), by seed."""
    return records.get(coverage_id(control, starts), [])


def exploring(records: Records, floor: str, variant: str, range_cells: float) -> list[Record]:
    """Return the records of (b) on a kind of plan, by seed."""
    return records.get(exploration_id(floor, variant, range_cells), [])


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
        *(channel_claims(records) if channel_id(next(iter(CHANNELS)), LOSSES[0]) in records else []),
    ]


def first_floor(records: Records, variant: str) -> str:
    """The first kind of plan, and so the largest, on which a variant was run at the middle range."""
    return next(f for f, plan in FLOORS.items() if exploration_id(f, variant, plan.middle) in records)


def interval(found: Interval, runs: int) -> tuple[float, float | None, float | None]:
    """A figure with its interval, which one run does not have."""
    return found if runs > 1 else (found[0], None, None)


def _coverage_claims(records: Records, control: str) -> list[Claim]:
    """(a) and (d): convergence, its speed, and the fall of the functional."""
    claims, name = [], _NAMES[control]
    for starts in STARTS:
        found = covering(records, control, starts)
        ended = [record["ended"] == "converged" for record in found]
        text = f"(a) {name}, {starts} starts: share of runs that converge"
        mean, low, high = mean_interval(ended)
        claims.append(Claim(f"converges-{control}-{starts}", text, 1.0, mean, low, high, all(ended)))
        iterations = [record["iterations"] for record in found if record["ended"] == "converged"]
        if iterations:
            middle, low, high = median_interval(iterations)
            text = f"(a) {name}, {starts} starts: iterations of those, median"
            claims.append(
                Claim(f"iterations-{control}-{starts}", text, "< 150", middle, low, high, high < 150)
            )
    both = [record for starts in STARTS for record in covering(records, control, starts)]
    rises = [record["rises"] for record in both]
    mean, low, high = mean_interval(rises)
    largest = max(record["largest_rise"] for record in both)
    text = f"(d) {name}: iterations a run in which the functional rises (the largest by {largest:.2%})"
    claims.append(Claim(f"falls-{control}", text, 0.0, mean, low, high, max(rises) == 0))
    if control in _SECONDS:
        middle, low, high = median_interval([record["seconds_an_iteration"] for record in both])
        text = f"(a) {name}: seconds an iteration (2.1 GHz Pentium)"
        paper = _SECONDS[control]
        claims.append(Claim(f"seconds-{control}", text, paper, middle, low, high, high <= paper))
    return claims


def _exploration_claims(records: Records, floor: str, variant: str, range_cells: float) -> list[Claim]:
    """Whether an exploration ends, and when."""
    found = exploring(records, floor, variant, range_cells)
    if not found:
        return []
    ours = "" if variant == "paper" else "plain cells, nearest targets, "
    where = f"(b) {floor} plan, {ours}range {range_cells:g} cells"
    ended = [record["ended"] == "converged" for record in found]
    mean, low, high = interval(mean_interval(ended), len(found))
    text = f"{where}: share of runs that explore all, and converge"
    name = f"{variant}-{floor}-{range_cells:g}"
    claims = [Claim(f"explores-{name}", text, 1.0, mean, low, high, all(ended))]
    if all(ended):
        iterations = [record["iterations"] for record in found]
        middle, low, high = interval(median_interval(iterations), len(found))
        text, most = f"{where}: iterations until then", FLOORS[floor].paper
        claims.append(Claim(f"within-{name}", text, f"≤ {most}", middle, low, high, middle <= most))
    return claims


def _time_claims(records: Records) -> list[Claim]:
    measured = records["measured"][0]
    floor = first_floor(records, "paper")
    found = exploring(records, floor, "paper", FLOORS[floor].middle)
    seconds = [record["seconds_with_tessellation"] for record in found]
    centre, low, high = interval(median_interval(seconds), len(found))
    text = f"(b) {floor} plan: seconds an iteration in which cells and controls of all robots are worked out"
    claims = [Claim("seconds-exploration", text, 1.7, centre, low, high, centre <= 1.7)]
    mean = float(np.mean([record["seconds_an_iteration"] for record in found]))
    text = "(b) the same, mean of all iterations: a robot under way to its target needs no cells"
    claims.append(Claim("seconds-mean", text, 1.7, mean, None, None, mean <= 1.7))
    scipy_s, ours_s = measured["scipy_s"], measured["ours_s"]
    text = f"(b) SciPy's Dijkstra over our tessellation of the plan ({scipy_s:.3f} s, {ours_s:.3f} s)"
    ratio = scipy_s / ours_s
    return [*claims, Claim("scipy", text, None, ratio, None, None, ratio > 1.0)]


def _variant_claims(records: Records, floor: str) -> list[Claim]:
    """What the paper adds, and ours, beside its opposite; paired by plan."""
    middle = FLOORS[floor].middle
    rows = (
        ("metric", "paper", "length", "(b) entropy-weighted cells explore faster than plain ones"),
        ("nearest", "nearest", "paper", "ours: the nearest uncertain cell is faster than the centroid"),
        (
            "both",
            "nearest-length",
            "paper",
            "ours: plain cells and nearest targets are faster than the paper's",
        ),
        ("phases", "paper", "phases", "perfect messages are faster than phases of 10 iterations"),
        ("loss", "phases", "phases-loss", "phases of which no message is lost are faster than half lost"),
    )
    claims = []
    for name, ours, rival, text in rows:
        both = exploring(records, floor, ours, middle), exploring(records, floor, rival, middle)
        pairs = [tuple(map(until_explored, pair)) for pair in zip(*both, strict=False)]  # or one was not run
        if pairs:
            ratio, low, high = interval(ratio_interval(*zip(*pairs, strict=True)), len(pairs))
            count = "one plan" if len(pairs) == 1 else f"{len(pairs)} plans"
            words = f"{text}; ratio of iterations until all is explored ({floor}, {count})"
            paper, holds = "< 1" if name == "metric" else None, (ratio if high is None else high) < 1.0
            claims.append(Claim(f"variant-{name}-{floor}", words, paper, ratio, low, high, holds))
    return claims


def until_explored(record: Record) -> int:
    """Iterations until all was explored; if it never was, all of them."""
    return record["iterations"] if record["explored_at"] is None else record["explored_at"]


def _split_claims(splits: dict[str, Any]) -> list[Claim]:
    claims = []
    for region, ratios in splits.items():
        plain, weighted = ratios["plain"], ratios["0.01"]
        text = f"(c) {region}: plain geodesic cells split the unknown area unevenly; ratio"
        claims.append(Claim(f"split-plain-{region}", text, "≠ 1", plain, None, None, not 0.9 <= plain <= 1.1))
        text = f"(c) {region}: entropy-weighted cells, η = 0.01, split it evenly; ratio"
        claims.append(Claim(f"split-{region}", text, 1.0, weighted, None, None, 0.9 <= weighted <= 1.1))
    return claims


def coverage_table(records: Records) -> str:
    """Return a table of (a) and (d)."""
    rows = []
    for control, starts in product(CONTROLS, STARTS):
        found = covering(records, control, starts)
        done = [record["iterations"] for record in found if record["ended"] == "converged"]
        cycles = sorted(record["cycle"] for record in found if record["ended"] == "cycle")
        rows.append(
            [
                control,
                starts,
                f"{len(done)} of {len(found)}",
                f"{median_interval(done):,.0f}" if done else "-",
                f"{cycles[0]} … {cycles[-1]}" if cycles else "-",
                f"{np.mean([record['rises'] for record in found]):.1f}",
            ]
        )
    head = ["control", "starts", "converged", "median iterations", "limit cycles", "rises of H a run"]
    return markdown_table(head, rows)


def exploration_table(records: Records) -> str:
    """Return a table of (b)."""
    rows = []
    for name, floor in FLOORS.items():
        points = [("paper", r) for r in floor.ranges]
        points += [(variant, floor.middle) for variant in floor.variants]
        for variant, range_cells in points:
            if found := exploring(records, name, variant, range_cells):
                ended = [record for record in found if record["ended"] == "converged"]
                explored = [record for record in found if record["explored_at"] is not None]
                middle = np.median([until_explored(record) for record in found])
                at = ("" if len(explored) == len(found) else "≥ ") + f"{middle:,.0f}"
                rows.append([name, variant, f"{range_cells:g}", f"{len(ended)} of {len(found)}", at])
    return markdown_table(["plan", "variant", "range (cells)", "converged", "all explored at (median)"], rows)


def split_table(records: Records) -> str:
    """Return a table of (c)."""
    splits = records["measured"][0]["splits"]
    names = list(next(iter(splits.values())))
    rows = [[region, *(f"{found[name]:.2f}" for name in names)] for region, found in splits.items()]
    return markdown_table(["unknown region", "plain cells", *(f"η = {name}" for name in names[1:])], rows)
