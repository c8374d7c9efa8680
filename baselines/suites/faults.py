"""Teams whose robots and messages fail, beside the same teams where nothing fails, by the same seeds.

The robot that is lost stops for good at half the median time of the strategy's missions in which nothing
fails: those run first. Worlds are those that the scenarios draw, until one map is known.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np

from baselines.experiments.claims import Claim
from baselines.experiments.rows import Record
from baselines.experiments.statistics import Interval, ratio_interval
from baselines.suites.results import Results
from baselines.suites.suite import QUICK_STARTS, Place, Records, Suite, Task
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.settings.scenarios import SCENARIOS

STRATEGIES = (
    "planned-rate",
    "mutual-information",
    "per-time-visibility",
    "coordinated-frontier",
    "assigned-frontier",
    "voronoi",
)
"""Those that use where teammates are, or what they announce; not their variants."""
TEAMS = (("room", 2), ("room", 4), ("office", 4))
QUICK_TEAMS = TEAMS[1:2]
MISSIONS, TIME_LIMIT_S = 5, 1000.0
MARGIN = 1.05
"""What is shown to be larger by at most this factor counts as not larger."""

NOTHING_FAILS, ISOLATED, LOST, LOST_ISOLATED = "", "isolated", "one robot lost", "isolated, one lost"
LOSSES = (0.3, 0.6, 0.9)
_ALONE = {"burst": 0, "announcements": False}
CHANNELS: Mapping[str, Mapping[str, Any]] = MappingProxyType(
    {
        NOTHING_FAILS: {},
        **{f"{loss:.0%} of messages lost": {"loss_probability": loss} for loss in LOSSES},
        "only announcements": {"burst": 0},
        "range 3 m": {"range_m": 3.0},
        "line of sight": {"reach": "line_of_sight"},
        ISOLATED: _ALONE,
    }
)
"""Condition → settings of the channel; nothing fails."""
SENSORS_FAIL, RADIOS_FAIL = "sensors fail", "radios fail"
FAULTS: Mapping[str, Mapping[str, Any]] = MappingProxyType(
    {
        SENSORS_FAIL: {
            "sensor": {"lost_rays": 0.1, "range_factor": 1.02, "range_bias_m": 0.02, "robots": (0,)},
            "blind": {"mean_s": 60.0, "lasts_s": 20.0},
        },
        RADIOS_FAIL: {
            "radio": {"garbled": 0.1, "repeated": 0.1, "late": 0.2, "late_s": 5.0, "robots": (0,)},
            "silent": {"mean_s": 60.0, "lasts_s": 20.0},
        },
    }
)
"""Condition → faults: robot 0 has a worse sensor, or radio, and all are blind, or silent, for a while."""
CONDITIONS = (*CHANNELS, *FAULTS, LOST, LOST_ISOLATED)


def tasks(quick: bool = False) -> tuple[Task, ...]:
    """Return the tasks in which no robot is lost."""
    conditions = [(condition, channel, {}) for condition, channel in CHANNELS.items()]
    conditions += [(condition, {}, faults) for condition, faults in FAULTS.items()]
    return tuple(
        Task(
            task_name(name, robots, condition),
            (Place(name, _scenario(name, robots, channel, faults), _missions(quick)),),
        )
        for name, robots in (QUICK_TEAMS if quick else TEAMS)
        for condition, channel, faults in conditions
    )


def later_tasks(suite: Suite, records: Records) -> tuple[Task, ...]:
    """Return the tasks in which the last robot is lost, at a time of its own for each strategy."""
    times, missions = Times(Results(suite, records)), max(task.missions for task in suite.tasks)
    found = []
    for name, robots in times.teams:
        for condition, channel in ((LOST, {}), (LOST_ISOLATED, _ALONE)):
            places = []
            for strategy in suite.strategies:
                whole = list(times.of(name, robots, strategy, NOTHING_FAILS).values())
                if whole:
                    stop = {"at_s": round(0.5 * float(np.median(whole)), 1), "robots": (robots - 1,)}
                    scenario = _scenario(name, robots, channel, {"stop": stop})
                    places.append(Place(strategy, scenario, missions, strategy=strategy))
            if places:
                found.append(Task(task_name(name, robots, condition), tuple(places)))
    return tuple(found)


def _missions(quick: bool) -> int:
    return QUICK_STARTS if quick else MISSIONS


def _scenario(
    name: str, robots: int, channel: Mapping[str, Any], faults: Mapping[str, Any] | None = None
) -> Scenario:
    settings = {"robots": robots, "time_limit_s": TIME_LIMIT_S, "channel": channel}
    return with_settings(SCENARIOS[name], {**settings, **({"faults": faults} if faults else {})})


def task_name(scenario: str, robots: int, condition: str) -> str:
    """Return the name of the task of a team under a condition."""
    return f"{scenario}, {robots} robots" + (f", {condition}" if condition else "")


class Times:
    """Mission times of the suite, by team, strategy and condition.

    Attributes:
        results: Of the suite.
        teams: Those that were run.
    """

    def __init__(self, results: Results) -> None:
        """Take what the missions came to."""
        self.results, self.strategies = results, results.suite.strategies
        self._tasks = {task.name: task for task in results.suite.tasks}
        self.teams = [
            team for team in TEAMS if any(self.records(*team, n, NOTHING_FAILS) for n in self.strategies)
        ]

    def records(self, scenario: str, robots: int, strategy: str, condition: str) -> dict[int, Record]:
        """Return the records of a cell by seed; none if it was not run."""
        task = self._tasks.get(task_name(scenario, robots, condition))
        return {} if task is None else self.results.numbered(task, strategy)

    def all_records(self) -> list[Record]:
        """Return the records of all missions that were run."""
        return [record for cell in self.results.records.values() for record in cell.values()]

    def of(self, scenario: str, robots: int, strategy: str, condition: str) -> dict[int, float]:
        """Return seconds by seed: the limit of missions that were cut off, nothing of those that failed."""
        found = self.records(scenario, robots, strategy, condition).items()
        return {seed: record["t_mission_s"] for seed, record in found if "t_mission_s" in record}

    def cut_off(self, scenario: str, robots: int, strategy: str, condition: str) -> int:
        """Return how many missions of a cell did not come to their end."""
        found = self.records(scenario, robots, strategy, condition).values()
        return sum(not record.get("finished", False) for record in found)

    def ratio(self, scenario: str, robots: int, strategy: str, over: str, under: str) -> Interval | None:
        """Return the mean time under one condition over that under another; None without a shared mission."""
        times = [self.of(scenario, robots, strategy, condition) for condition in (over, under)]
        shared = sorted(times[0].keys() & times[1].keys())
        return ratio_interval(*([own[seed] for seed in shared] for own in times)) if shared else None

    def told_ratio(self, scenario: str, robots: int, strategy: str, over: str, under: str) -> Interval | None:
        """Return the same; None also where all missions were cut off, since the ratio is 1 by itself."""
        cells = [self.records(scenario, robots, strategy, name).values() for name in (over, under)]
        if not any(record.get("finished", False) for cell in cells for record in cell):
            return None
        return self.ratio(scenario, robots, strategy, over, under)


def share_of_one(robots: int) -> float:
    """Return what losing one of A robots at half time costs if the others do its share: ½ + ½ · A/(A - 1)."""
    return 0.5 + 0.5 * robots / (robots - 1)


def all_claims(times: Times) -> list[Claim]:
    """Return what teams are held to, beside what was measured."""
    claims = [nothing_breaks(times.all_records())]
    for strategy in times.strategies:
        for team in times.teams:
            claims += _claims_of(times, *team, strategy)
    return claims


def nothing_breaks(records: Sequence[Record]) -> Claim:
    """Claim that no mission raises an error, runs past the time on the clock, or has a figure that is NaN."""
    broken = sum(map(_broken, records))
    text = f"missions of {len(records):,} that raise an error, hang or report NaN"
    return Claim("nothing-breaks", 0.0, float(broken), None, None, broken == 0, text)


def _broken(figures: object) -> bool:
    if isinstance(figures, dict):
        return "failed" in figures or any(_broken(value) for value in figures.values())
    if isinstance(figures, list):
        return any(_broken(value) for value in figures)
    return isinstance(figures, float) and not math.isfinite(figures)


def _claims_of(times: Times, scenario: str, robots: int, strategy: str) -> list[Claim]:
    team, words = (scenario, robots, strategy), f"{strategy}, {scenario}, {robots} robots"
    alone = {name: LOST_ISOLATED if name == LOST else ISOLATED for name in CONDITIONS}
    shared = [name for name in CONDITIONS if name not in (ISOLATED, LOST_ISOLATED, SENSORS_FAIL)]
    found = {name: times.told_ratio(*team, name, alone[name]) for name in shared}
    cut = [name for name in shared if times.cut_off(*team, name)]
    lost = {LOST: times.told_ratio(*team, LOST, NOTHING_FAILS)}
    return [
        _claim(
            f"isolated-{scenario}-{robots}-{strategy}", f"{words}: not slower than isolated", 1.0, found, cut
        ),
        _claim(
            f"lost-{scenario}-{robots}-{strategy}",
            f"{words}: losing one at half time costs at most its share",
            share_of_one(robots),
            lost,
            [name for name in cut if name == LOST],
        ),
    ]


def _claim(
    name: str, text: str, most: float, ratios: Mapping[str, Interval | None], cut: Sequence[str]
) -> Claim:
    """Claim that the interval of every ratio lies below a number and MARGIN; the worst stands beside it.

    Ratios of conditions in which missions were cut off are lower bounds: they show nothing.
    """
    allowed = f"≤ {most:.3g}"
    found = {condition: ratio for condition, ratio in ratios.items() if ratio is not None}
    if not found:
        return Claim(name, allowed, None, None, None, False, f"{text}: all missions were cut off")
    worst = max(found, key=lambda condition: (found[condition].high, found[condition].value))
    holds = not cut and all(ratio.high <= most * MARGIN for ratio in found.values())
    text = f"{text}; at worst: {worst or 'nothing fails'}"
    text += f"; missions were cut off with {', '.join(name or 'no fault' for name in cut)}" if cut else ""
    return Claim(name, allowed, *found[worst], holds, text)
