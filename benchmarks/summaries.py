"""What it takes to write a map as a summary and to read it, and what steps with summaries cost.

The map has 1000 × 1000 cells, known as a robot may know them; robots are those of `stepping`.
"""

from __future__ import annotations

import numpy as np

from benchmarks.rows import Effort, Goal, Row, alone, compared, interleave, timed
from benchmarks.stepping import ROBOTS, TURNING, step_rates
from entropy_explore_env.robots.map_summary import decode_map, encode_map
from entropy_explore_env.scenario import with_settings

CELLS = 1000
_WALLS_APART, _WALL, _THINGS = 50, 3, 400
_SCANS, _RANGE_M = 150, 8.0
_THRESHOLD_BITS = 0.5
_MOST_MS = 30.0
_EVERY_S = 5.0


def known_plan(seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Mean and precision, (1000, 1000, 1) float32, of a plan of rooms with things in them.

    What was measured are discs of 8 m in cells of 0.1 m, as around the places of scans, more precisely near
    them (σ as `RangeSensor` has it); where more of them overlap, more is known.
    """
    rng = np.random.default_rng(seed)
    mean = np.zeros((CELLS, CELLS, 1), np.float32)
    for wall in range(0, CELLS, _WALLS_APART):
        mean[wall : wall + _WALL], mean[:, wall : wall + _WALL] = 1.0, 1.0
    for x, y, wide, long in rng.integers((0, 0, 3, 3), (CELLS, CELLS, 15, 15), (_THINGS, 4)):
        mean[x : x + wide, y : y + long] = 1.0
    across = np.arange(CELLS)
    precision = np.zeros((CELLS, CELLS, 1), np.float32)
    for x, y in rng.integers(0, CELLS, (_SCANS, 2)):
        range_m = 0.1 * np.hypot(across[:, None] - x, across - y)
        precision[range_m < _RANGE_M, 0] += ((0.08 + 0.006 * range_m) ** -2)[range_m < _RANGE_M]
    return mean, precision


def summary_rows(effort: Effort) -> list[Row]:
    """Milliseconds to encode the plan, and to decode it."""
    mean, precision = known_plan()
    data = encode_map(mean, precision, _THRESHOLD_BITS)
    decode_map(data, mean.shape)
    jobs = {
        "encode": lambda _: timed(lambda: encode_map(mean, precision, _THRESHOLD_BITS)),
        "decode": lambda _: timed(lambda: decode_map(data, mean.shape)),
    }
    taken = interleave(jobs, effort.rounds)
    milliseconds = {name: [1e3 * t.cpu_s for t in taken[name]] for name in taken}
    what = f"a map of {CELLS} × {CELLS} cells as a summary of {8 * len(data):,} bits"
    goals = {"encode": Goal("≤", _MOST_MS, "ms"), "decode": None}
    rows = [alone(f"{name} {what}", milliseconds[name], "ms", goal) for name, goal in goals.items()]
    return [*rows, step_row(effort)]


def step_row(effort: Effort) -> Row:
    """Steps a second of robots that send summaries beside robots that send batches."""
    channel = {"content": "summaries", "summary_every_s": _EVERY_S}
    scenarios = {"batches": TURNING, "summaries": with_settings(TURNING, {"channel": channel})}
    rates = step_rates(scenarios, effort)
    what = f"ParallelEnv.step, {ROBOTS} robots × {TURNING.sensor.rays} rays, a summary each {_EVERY_S:g} s"
    return compared(what, "batches", rates["summaries"], rates["batches"], "steps/s")
