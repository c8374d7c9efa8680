"""What it takes to write a map of 1000 × 1000 cells as a summary, and to read it."""

from __future__ import annotations

import numpy as np

from benchmarks.rows import Effort, Goal, Row, alone, interleave, timed
from entropy_explore_env.robots.map_summary import decode_map, encode_map

CELLS = 1000
_THRESHOLD_BITS = 0.5


def known_plan(seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Return the mean and precision, (1000, 1000, 1) float32, of a plan of rooms with things in them.

    What was measured are discs of 8 m in cells of 0.1 m, as around the places of scans, more precisely near
    them (σ as `RangeSensor` has it); where more of them overlap, more is known.
    """
    rng = np.random.default_rng(seed)
    mean, precision = np.zeros((2, CELLS, CELLS, 1), np.float32)
    for wall in range(0, CELLS, 50):
        mean[wall : wall + 3], mean[:, wall : wall + 3] = 1.0, 1.0
    for x, y, wide, long in rng.integers((0, 0, 3, 3), (CELLS, CELLS, 15, 15), (400, 4)):
        mean[x : x + wide, y : y + long] = 1.0
    across = np.arange(CELLS)
    for x, y in rng.integers(0, CELLS, (150, 2)):
        range_m = 0.1 * np.hypot(across[:, None] - x, across - y)
        precision[range_m < 8.0, 0] += ((0.08 + 0.006 * range_m) ** -2)[range_m < 8.0]
    return mean, precision


def summary_rows(effort: Effort) -> list[Row]:
    """Return rows of milliseconds to encode the plan, and to decode it."""
    mean, precision = known_plan()
    data = encode_map(mean, precision, _THRESHOLD_BITS)
    decode_map(data, mean.shape)
    jobs = {
        "encode": lambda _: timed(lambda: encode_map(mean, precision, _THRESHOLD_BITS)),
        "decode": lambda _: timed(lambda: decode_map(data, mean.shape)),
    }
    taken = interleave(jobs, effort.rounds)
    what = f"a map of {CELLS} × {CELLS} cells as a summary of {8 * len(data):,} bits"
    goals = {"encode": Goal("≤", 30.0, "ms"), "decode": None}
    return [
        alone(f"{name} {what}", [1e3 * t.cpu_s for t in taken[name]], "ms", goal)
        for name, goal in goals.items()
    ]
