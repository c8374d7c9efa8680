"""What strategies are held to where robots drift."""

from __future__ import annotations

import numpy as np

from baselines.experiments.claims import Claim
from baselines.experiments.outcome import Record
from baselines.experiments.statistics import mean_interval, ratio_interval
from baselines.papers.sujan.drift.sweep import LEVELS, PLAIN, STRATEGIES, cell_id

Records = dict[str, list[Record]]
_MOST_SLOWER = 1.25
_LEAST_SEEN = 0.95
_MOST_CUT_OFF = 0.05
"""A claim about times does not hold where more of the missions than this did not come so far."""
_DRIFTING = tuple(level for level, factor in LEVELS.items() if factor)


def all_claims(records: Records) -> list[Claim]:
    """Every claim, from the missions' records by cell.

    Missions are cut off at the time limit: so claims about times are about the time to half of what can be
    seen, and others about the share that was seen by then.
    """
    claims = []
    for strategy in STRATEGIES:
        for level in _DRIFTING:
            claims += _strategy_claims(records, strategy, level)
    for strategy in PLAIN:
        for level in _DRIFTING:
            claims += _guard_claims(records, strategy, level)
    return claims


def _strategy_claims(records: Records, strategy: str, level: str) -> list[Claim]:
    """That drift costs a strategy little time, and little of what it sees."""
    drifting, exact = cell_id(strategy, level), cell_id(strategy, "none")
    ratio, low, high = ratio_interval(half_times_s(records, drifting), half_times_s(records, exact))
    reached = min(saw_half(records, cell) for cell in (drifting, exact))
    text = f"{strategy}, {level} drift: half is seen in at most {_MOST_SLOWER - 1:.0%} more time; ratio"
    if reached < 1.0 - _MOST_CUT_OFF:
        text += f" (only {reached:.0%} of the missions did)"
    holds = high <= _MOST_SLOWER and reached >= 1.0 - _MOST_CUT_OFF
    half = Claim(f"half-{strategy}-{level}", text, f"≤ {_MOST_SLOWER}", ratio, low, high, holds)
    share, low, high = ratio_interval(*(joint(records, cell, "explored") for cell in (drifting, exact)))
    text = f"{strategy}, {level} drift: sees at least {_LEAST_SEEN:.0%} of what it sees without; ratio"
    seen = Claim(f"seen-{strategy}-{level}", text, f"≥ {_LEAST_SEEN}", share, low, high, low >= _LEAST_SEEN)
    return [half, seen]


def _guard_claims(records: Records, strategy: str, level: str) -> list[Claim]:
    """That margin and guard save blocked drives and time."""
    guarded, plain = cell_id(strategy, level), cell_id(strategy, level, True)
    fewer, low, high = mean_interval(blocked(records, guarded) - blocked(records, plain))
    text = f"{strategy}, {level} drift: margin and guard save blocked drives; difference"
    drives = Claim(f"blocked-{strategy}-{level}", text, "< 0", fewer, low, high, high < 0)
    ratio, low, high = ratio_interval(half_times_s(records, guarded), half_times_s(records, plain))
    text = f"{strategy}, {level} drift: with margin and guard half is seen in less time; ratio"
    return [drives, Claim(f"guard-{strategy}-{level}", text, "< 1", ratio, low, high, high < 1)]


def half_times_s(records: Records, cell: str) -> np.ndarray:
    """(N,) seconds until half of what can be seen was; the whole mission where it was not."""
    halves = [(record["joint"]["t50_seen_s"], record["t_mission_s"]) for record in records[cell]]
    return np.asarray([end if half is None else half for half, end in halves], float)


def saw_half(records: Records, cell: str) -> float:
    """Share of the missions that saw half of what can be seen."""
    return float(np.mean([record["joint"]["t50_seen_s"] is not None for record in records[cell]]))


def times_s(records: Records, cell: str) -> np.ndarray:
    """(N,) mission times in seconds; the limit where a mission did not end before."""
    return np.asarray([record["t_mission_s"] for record in records[cell]], float)


def blocked(records: Records, cell: str) -> np.ndarray:
    """(N,) drives of each mission that something ended early."""
    return np.asarray([record["blocked_moves"] for record in records[cell]], float)


def joint(records: Records, cell: str, field: str) -> np.ndarray:
    """(N,) a figure of each mission's joint map against the truth."""
    return np.asarray([record["joint"][field] for record in records[cell]], float)


def error_m(records: Records, cell: str) -> np.ndarray:
    """(N,) root mean square error of the place over each mission's scans; 0 where nobody drifts."""
    return np.asarray([record.get("localization", {}).get("rms_error_m", 0.0) for record in records[cell]])
