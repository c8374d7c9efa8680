"""What teams are held to, beside what was measured."""

from __future__ import annotations

import math
from collections.abc import Sequence

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

MARGIN = 1.05
"""What is shown to be at most so much larger counts as not larger."""


def all_claims(experiment: Experiment, records: Records) -> list[Claim]:
    """Every claim, from the missions' records by cell."""
    claims = [nothing_breaks(records)]
    for strategy in experiment.strategies:
        claims += [
            claim
            for scenario, robots in experiment.teams
            for claim in _of_a_team(records, scenario, robots, strategy)
        ]
    return claims


def nothing_breaks(records: Records) -> Claim:
    """No mission raises an error, runs past the time on the clock, or has a figure that is no number."""
    broken = sum(_broken(record) for cell in records.values() for record in cell)
    missions = sum(len(cell) for cell in records.values())
    text = f"missions of {missions:,} that raise an error, hang or report NaN"
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


def share_of_one(robots: int) -> float:
    """What losing one of A robots at half time costs if the rest do its share: ½ + ½ · A/(A - 1)."""
    return 0.5 + 0.5 * robots / (robots - 1)


def _pair(scenario: str, robots: int, strategy: str, over: str, under: str) -> tuple[str, str]:
    """The two cells of a ratio."""
    return cell_id(scenario, robots, strategy, over), cell_id(scenario, robots, strategy, under)


def _ratio(records: Records, scenario: str, robots: int, strategy: str, over: str, under: str) -> Interval:
    pair = [times(records, cell) for cell in _pair(scenario, robots, strategy, over, under)]
    known = np.isfinite(pair[0]) & np.isfinite(pair[1])
    if not known.any():
        return Interval(math.nan, math.nan, math.nan)
    return ratio_interval(pair[0][known], pair[1][known])


def _tells(records: Records, *cells: str) -> bool:
    """Whether some mission of these cells came to its end: the ratio of missions cut off is 1 by itself."""
    return any(record.get("finished", False) for cell in cells for record in records[cell])


def _of_a_team(records: Records, scenario: str, robots: int, strategy: str) -> list[Claim]:
    who, prefix = (scenario, robots, strategy), f"{scenario}-{robots}-{strategy}"
    team = f"{strategy}, {scenario}, {robots} robots"
    alone = {name: LOST_ISOLATED if name == LOST else ISOLATED for name in conditions()}
    found = {
        name: _ratio(records, *who, name, alone[name])
        for name in conditions()
        if name not in alone.values() and _tells(records, *_pair(*who, name, alone[name]))
    }
    text = f"{team}: never slower than in isolation"
    cut = [
        name
        for name in conditions()
        if name not in alone.values() and missions_cut_off(records, cell_id(*who[:2], strategy, name))
    ]
    return [
        _claim(f"isolated-{prefix}", text, 1.0, found, cut),
        _claim(
            f"lost-{prefix}",
            f"{team}: losing one at half time costs at most its share",
            share_of_one(robots),
            {LOST: slowdown(records, *who, LOST)}
            if _tells(records, *_pair(*who, LOST, NOTHING_FAILS))
            else {},
            [name for name in cut if name == LOST],
        ),
    ]


def missions_cut_off(records: Records, cell: str) -> int:
    """How many missions of a cell did not come to their end: they take longer than what is known of them."""
    return sum(not record.get("finished", False) for record in records[cell])


def _claim(name: str, text: str, most: float, found: dict[str, Interval], cut: Sequence[str] = ()) -> Claim:
    """That every ratio lies below a number and MARGIN with its whole interval; beside it stands the worst.

    Under conditions in which missions were `cut` off ratios are at least so large: nothing is shown of them.
    """
    allowed = f"≤ {most:.3g}"
    if not found:
        return Claim(name, f"{text}: all missions were cut off", allowed, None, None, None, False)
    worst = max(found, key=lambda condition: (found[condition].high, found[condition].value))
    value, low, high = found[worst]
    unknown = [TEXTS[condition] for condition in cut]
    holds = not unknown and all(each.high <= most * MARGIN for each in found.values())
    text = f"{text}; at worst: {TEXTS[worst]}"
    text += f"; missions were cut off with {', '.join(unknown)}" if unknown else ""
    return Claim(name, text, allowed, value, low, high, holds)
