"""What teams are held to, beside what was measured."""

from __future__ import annotations

import math

import numpy as np

from baselines.experiments.claims import Claim
from baselines.experiments.statistics import Interval, ratio_interval
from baselines.resilience.sweep import (
    ISOLATED,
    LOST,
    LOST_ISOLATED,
    NOTHING_FAILS,
    TEXTS,
    Experiment,
    Records,
    cell_id,
    conditions,
    times,
)


def all_claims(experiment: Experiment, records: Records) -> list[Claim]:
    """Every claim, from the missions' records by cell."""
    claims = [nothing_breaks(records)]
    for strategy in experiment.strategies:
        claims += [
            claim
            for scenario, robots in experiment.teams()
            for claim in _of_a_team(records, scenario, robots, strategy)
        ]
    return claims


def nothing_breaks(records: Records) -> Claim:
    """No mission raises an error, runs past the time on the clock, or has a figure that is no number."""
    broken = sum(_broken(record) for cell in records.values() for record in cell)
    missions = sum(len(cell) for cell in records.values())
    text = f"no mission raises an error, hangs or reports what is no number; of {missions:,} so many do"
    return Claim("nothing-breaks", text, 0.0, float(broken), None, None, broken == 0)


def _broken(figures: object) -> bool:
    """Whether a record says that its mission failed, or holds a number that is none."""
    if isinstance(figures, dict):
        return "failed" in figures or any(_broken(value) for value in figures.values())
    if isinstance(figures, list):
        return any(_broken(value) for value in figures)
    return isinstance(figures, float) and not math.isfinite(figures)


def slowdown(records: Records, scenario: str, robots: int, strategy: str, condition: str) -> Interval:
    """Mean time under a condition over that where nothing fails, by the same seeds."""
    return _ratio(records, scenario, robots, strategy, condition, NOTHING_FAILS)


def over_isolated(records: Records, scenario: str, robots: int, strategy: str, condition: str) -> Interval:
    """Mean time under a condition over that of the same robots in isolation, by the same seeds."""
    alone = LOST_ISOLATED if condition == LOST else ISOLATED
    return _ratio(records, scenario, robots, strategy, condition, alone)


def share_of_one(robots: int) -> float:
    """What losing one of A robots at half time costs if the rest do its share: ½ + ½ · A/(A - 1)."""
    return 0.5 + 0.5 * robots / (robots - 1)


def _ratio(records: Records, scenario: str, robots: int, strategy: str, over: str, under: str) -> Interval:
    pair = [times(records, cell_id(scenario, robots, strategy, name)) for name in (over, under)]
    known = np.isfinite(pair[0]) & np.isfinite(pair[1])
    if not known.any():
        return Interval(math.nan, math.nan, math.nan)
    return ratio_interval(pair[0][known], pair[1][known])


def _of_a_team(records: Records, scenario: str, robots: int, strategy: str) -> list[Claim]:
    team = f"{strategy}, {scenario}, {robots} robots"
    found = {
        name: over_isolated(records, scenario, robots, strategy, name)
        for name in conditions()
        if name not in (ISOLATED, LOST_ISOLATED)
    }
    worst = max(found, key=lambda name: (found[name].low, found[name].value))
    value, low, high = found[worst]
    text = f"{team}: never slower than in isolation; the worst ratio, with {TEXTS[worst]}"
    prefix = f"{scenario}-{robots}-{strategy}"
    claims = [
        Claim(f"isolated-{prefix}", text, "≤ 1", value, low, high, all(f.low <= 1 for f in found.values()))
    ]
    value, low, high = slowdown(records, scenario, robots, strategy, LOST)
    most = share_of_one(robots)
    text = f"{team}: losing one at half time costs at most its share; the ratio"
    return [*claims, Claim(f"lost-{prefix}", text, f"≤ {most:.2f}", value, low, high, low <= most)]
