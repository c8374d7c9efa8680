"""The claims of Bhattacharya 2010, each beside what was measured."""

from __future__ import annotations

from typing import Any

import numpy as np

from baselines.experiment import Claim, mean_interval, median_interval, ratio_interval
from baselines.papers.bhattacharya_runs import CONTROLS, Record, Run, coverage_id, exploration_id

Records = dict[str, Record]
STARTS = ("random", "cluster")
_NAMES = {
    "projected": "projected centroid",
    "projected-guarded": "the same, guarded",
    "gradient": "gradient search",
}
_SECONDS = {"projected": 0.03, "gradient": 0.1}


def covering(records: Records, control: str, starts: str) -> list[Record]:
    """Records of (a), by seed."""
    found, seed = [], 0
    while (name := coverage_id(control, starts, seed)) in records:
        found.append(records[name])
        seed += 1
    return found


def exploring(records: Records, variant: str, range_cells: float) -> list[Record]:
    """Records of (b), by seed."""
    found, seed = [], 0
    while (name := exploration_id(variant, range_cells, seed)) in records:
        found.append(records[name])
        seed += 1
    return found


def all_claims(
    records: Records, runs: list[Run], splits: dict[str, Any], timing: tuple[float, float], middle: float
) -> list[Claim]:
    """Every claim.

    Args:
        records: Of all runs, by id.
        runs: The runs.
        splits: Ratios of (c).
        timing: Seconds of a tessellation of (b)'s plan, ours and SciPy's.
        middle: Sensor range of (b) at which variants are run, in cells.
    """
    ranges = sorted({run.rules.sensor.range_cells for run in runs if run.id.startswith("exploration-paper-")})
    return [
        *(claim for control in CONTROLS for claim in _coverage_claims(records, control)),
        *(claim for range_cells in ranges for claim in _exploration_claims(records, range_cells)),
        *_time_claims(records, middle, timing),
        *_variant_claims(records, middle),
        *_split_claims(splits),
    ]


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


def _exploration_claims(records: Records, range_cells: float) -> list[Claim]:
    found = exploring(records, "paper", range_cells)
    if not found:
        return []
    ended = [record["ended"] == "converged" for record in found]
    mean, low, high = mean_interval(ended)
    text = f"(b) range {range_cells:g} cells: share of runs that explore all, and converge"
    claims = [Claim(f"explores-{range_cells:g}", text, 1.0, mean, low, high, all(ended))]
    iterations = [record["iterations"] for record in found if record["ended"] == "converged"]
    if iterations:
        middle, low, high = median_interval(iterations)
        text = f"(b) range {range_cells:g} cells: iterations until then, median"
        claims.append(Claim(f"within-{range_cells:g}", text, "≤ 2750", middle, low, high, middle <= 2750))
    return claims


def _time_claims(records: Records, middle: float, timing: tuple[float, float]) -> list[Claim]:
    found = exploring(records, "paper", middle)
    seconds = [record["seconds_with_tessellation"] for record in found]
    centre, low, high = median_interval(seconds)
    text = "(b) seconds an iteration in which cells and controls of all robots are worked out"
    claims = [Claim("seconds-exploration", text, 1.7, centre, low, high, high <= 1.7)]
    mean = float(np.mean([record["seconds_an_iteration"] for record in found]))
    text = "(b) the same, mean of all iterations: a robot under way to its target needs no cells"
    claims.append(Claim("seconds-mean", text, 1.7, mean, None, None, mean <= 1.7))
    text = f"(b) SciPy's Dijkstra over our tessellation of the plan ({timing[1]:.3f} s, {timing[0]:.3f} s)"
    ratio = timing[1] / timing[0]
    return [*claims, Claim("scipy", text, None, ratio, None, None, ratio > 1.0)]


def _variant_claims(records: Records, middle: float) -> list[Claim]:
    """What the paper adds, and ours, beside its opposite; paired by plan."""
    rows = (
        ("metric", "length", "paper", "(b) entropy-weighted cells explore faster than plain ones; ratio"),
        (
            "nearest",
            "paper",
            "nearest",
            "ours: the nearest uncertain cell is faster than the centroid; ratio",
        ),
        (
            "both",
            "paper",
            "nearest-length",
            "ours: with plain cells and nearest uncertain cells it is faster than the paper's; ratio",
        ),
        ("phases", "paper", "phases", "perfect messages are faster than phases of 10 iterations; ratio"),
    )
    claims = []
    for name, rival, ours, text in rows:
        upper, lower = exploring(records, ours, middle), exploring(records, rival, middle)
        if name == "phases":
            upper, lower = lower, upper
        pairs = [
            (a["explored_at"] or a["iterations"], b["explored_at"] or b["iterations"])
            for a, b in zip(upper, lower, strict=False)
        ]
        if pairs:
            ratio, low, high = ratio_interval([a for a, _ in pairs], [b for _, b in pairs])
            paper = "< 1" if name == "metric" else None
            claims.append(
                Claim(
                    f"variant-{name}",
                    f"{text} of iterations until all is explored",
                    paper,
                    ratio,
                    low,
                    high,
                    high < 1,
                )
            )
    return claims


def _split_claims(splits: dict[str, Any]) -> list[Claim]:
    claims = []
    for region, ratios in splits.items():
        plain, weighted = ratios["plain"], ratios["0.01"]
        text = f"(c) {region}: plain geodesic cells split the unknown area unevenly; ratio"
        claims.append(Claim(f"split-plain-{region}", text, "≠ 1", plain, None, None, not 0.9 <= plain <= 1.1))
        text = f"(c) {region}: entropy-weighted cells, η = 0.01, split it evenly; ratio"
        claims.append(Claim(f"split-{region}", text, 1.0, weighted, None, None, 0.9 <= weighted <= 1.1))
    return claims
