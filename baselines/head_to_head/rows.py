"""From missions to rows: one of each strategy in a scenario and team size, and one over all scenarios.

Times count with the time limit where a mission was cut off or failed. A relative time is that of a
strategy's mission over the random walk's with the same world, starts and seed.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from baselines.experiments.outcome import Record
from baselines.experiments.statistics import (
    Interval,
    Profile,
    improvement_interval,
    interquartile_mean,
    iqm_interval,
    performance_profile,
)
from baselines.head_to_head.cells import BASELINE, Entries

REFERENCES = (BASELINE, "gradient")
"""Strategies against which the probability of being faster is given, where they take part."""
MARKS = ("t50_s", "t90_s", "t99_s")
FIGURES = (
    "scans",
    "scans_over_floor",
    "distance_m",
    "bits_gained_per_bit_sent",
    "overlap",
    "balance",
    "explored",
    "error",
    "wrong",
)
"""Of `mission_figures`: interquartile means over the missions that did not fail."""

Row = dict[str, Any]


@dataclass(frozen=True)
class Results:
    """An experiment that was run.

    Attributes:
        entries: The cells of the experiment.
        records: Cell id → records by seed: `timed_record`, or `failed_record`.
    """

    entries: Entries
    records: dict[str, list[Record]]

    def cell(self, scenario: str, robots: int, strategy: str) -> list[Record]:
        """Records by seed."""
        return self.records[self.entries.cell_id(scenario, robots, strategy)]

    def times_s(self, scenario: str, robots: int, strategy: str, mark: str = "t_mission_s") -> np.ndarray:
        """(N,) float64 when the missions had come so far; the time limit where they never did."""
        limit_s = self.entries.scenarios[scenario].ending.time_limit_s
        reached = [record.get(mark) for record in self.cell(scenario, robots, strategy)]
        return np.asarray([limit_s if time_s is None else time_s for time_s in reached], float)

    def stacked_s(self, robots: int, strategy: str, mark: str = "t_mission_s") -> np.ndarray:
        """(S, N) float64 the same in all scenarios."""
        return np.stack([self.times_s(name, robots, strategy, mark) for name in self.entries.scenarios])

    def relative(self, robots: int, strategy: str, mark: str = "t_mission_s") -> np.ndarray:
        """(S, N) float64 times over the random walk's of the same seed."""
        return self.stacked_s(robots, strategy, mark) / self.stacked_s(robots, BASELINE, mark)

    def mapped(self, robots: int, strategy: str) -> np.ndarray:
        """(S, N) bool which missions came to their end."""
        return np.stack(
            [
                [record.get("finished", False) for record in self.cell(name, robots, strategy)]
                for name in self.entries.scenarios
            ]
        )

    def profile(self, robots: int, strategy: str, thresholds: np.ndarray) -> Profile:
        """Share of missions that were mapped within a multiple of the random walk's time."""
        reached = np.where(self.mapped(robots, strategy), self.relative(robots, strategy), np.inf)
        return performance_profile(reached, thresholds)

    def comparisons(self) -> Iterator[tuple[str, int, str]]:
        """Scenario, team size and strategy of every cell."""
        for name in self.entries.scenarios:
            for robots in self.entries.robots:
                for strategy in self.entries.strategies:
                    yield name, robots, strategy


def scenario_rows(results: Results) -> list[Row]:
    """A row of each strategy in each scenario and team size; ends of intervals as `…_low` and `…_high`."""
    rows = []
    for name, robots, strategy in results.comparisons():
        cell = results.cell(name, robots, strategy)
        time_s = results.times_s(name, robots, strategy)
        relative = time_s / results.times_s(name, robots, BASELINE)
        failed = sum("failed" in record for record in cell)
        mapped = sum(record.get("finished", False) for record in cell)
        rows.append(
            {
                "scenario": name,
                "robots": robots,
                "strategy": strategy,
                "missions": len(cell),
                "time_limit_s": results.entries.scenarios[name].ending.time_limit_s,
                "mapped": mapped,
                "cut_off": len(cell) - mapped - failed,
                "failed": failed,
                **_with_interval("time_s", iqm_interval(time_s[None])),
                **_with_interval("relative_time", iqm_interval(relative[None])),
                **{mark: _iqm(results.times_s(name, robots, strategy, mark)) for mark in MARKS},
                **{figure: _figure(cell, figure) for figure in FIGURES},
            }
        )
    return rows


def overall_rows(results: Results) -> list[Row]:
    """A row of each team size and strategy over all scenarios."""
    rows = []
    for robots in results.entries.robots:
        for strategy in results.entries.strategies:
            time_s = results.stacked_s(robots, strategy)
            row: Row = {
                "robots": robots,
                "strategy": strategy,
                "mapped": float(results.mapped(robots, strategy).mean()),
                **_with_interval("relative_time", iqm_interval(results.relative(robots, strategy))),
                **_with_interval("relative_t90", iqm_interval(results.relative(robots, strategy, "t90_s"))),
            }
            for reference in REFERENCES:
                if reference in results.entries.strategies:
                    against = None if reference == strategy else results.stacked_s(robots, reference)
                    interval = None if against is None else improvement_interval(time_s, against)
                    row |= _with_interval(f"faster_than_{reference}", interval)
            rows.append(row)
    return rows


def mission_rows(results: Results) -> list[Row]:
    """A row of each mission."""
    wanted = ("world", "end_reason", "t_mission_s", *MARKS, *FIGURES)
    rows = []
    for name, robots, strategy in results.comparisons():
        for seed, record in enumerate(results.cell(name, robots, strategy)):
            found = {figure: _value(record, figure) for figure in wanted}
            found["end_reason"] = "FAILED" if "failed" in record else found["end_reason"]
            rows.append({"scenario": name, "robots": robots, "strategy": strategy, "seed": seed, **found})
    return rows


def failed_rows(results: Results) -> list[Row]:
    """Missions that failed: a row of each strategy, scenario, team size and reason, with the seeds."""
    seeds: dict[tuple[str, int, str, str], list[int]] = {}
    for comparison in results.comparisons():
        for seed, record in enumerate(results.cell(*comparison)):
            if "failed" in record:
                seeds.setdefault((*comparison, record["failed"]), []).append(seed)
    names = ("scenario", "robots", "strategy", "reason")
    return [{**dict(zip(names, place, strict=True)), "seeds": found} for place, found in seeds.items()]


def clock_rows(results: Results) -> list[Row]:
    """What each strategy cost to compute; these figures differ from run to run."""
    rows = []
    for name, robots, strategy in results.comparisons():
        clocks = [record["clock"] for record in results.cell(name, robots, strategy) if "clock" in record]
        spent_s = [clock["mission_s"] for clock in clocks]
        rows.append(
            {
                "scenario": name,
                "robots": robots,
                "strategy": strategy,
                "decision_ms": _median([clock["decision_ms"] for clock in clocks]),
                "mission_s": _median(spent_s),
                "all_missions_s": round(sum(spent_s), 3),
            }
        )
    return rows


def _median(values: list[float]) -> float | None:
    return round(float(np.median(values)), 4) if values else None


def _with_interval(name: str, interval: Interval | None) -> Row:
    value, low, high = (None, None, None) if interval is None else interval
    return {name: value, f"{name}_low": low, f"{name}_high": high}


def _iqm(values: np.ndarray) -> float:
    return float(interquartile_mean(values))


def _figure(cell: list[Record], figure: str) -> float | None:
    """Interquartile mean of a figure over the missions that have it."""
    values = [_value(record, figure) for record in cell]
    found = [value for value in values if value is not None]
    return _iqm(np.asarray(found, float)) if found else None


def _value(record: Record, figure: str) -> Any:  # noqa: ANN401 - a number, a word, or None
    """A figure of a mission, of its joint map where that has it."""
    return record.get("joint", {}).get(figure) if figure in _JOINT else record.get(figure)


_JOINT = ("explored", "error", "wrong")
