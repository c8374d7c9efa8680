"""What strategies are held to where robots drift."""

from __future__ import annotations

import numpy as np

from baselines.experiments.claims import Claim
from baselines.experiments.outcome import Record
from baselines.experiments.statistics import mean_interval, ratio_interval
from baselines.papers.sujan.drift.sweep import LEVELS, PLAIN, STRATEGIES, cell_id

Records = dict[str, list[Record]]
_MOST_SLOWER = 1.25
_DRIFTING = tuple(level for level, factor in LEVELS.items() if factor)


def all_claims(records: Records) -> list[Claim]:
    """Every claim, from the missions' records by cell."""
    claims = []
    for strategy in STRATEGIES:
        for level in _DRIFTING:
            ratio, low, high = ratio_interval(
                times_s(records, cell_id(strategy, level)), times_s(records, cell_id(strategy, "none"))
            )
            text = f"{strategy}, {level} drift: at most {_MOST_SLOWER - 1:.0%} more time than without; ratio"
            holds = high <= _MOST_SLOWER
            claims.append(
                Claim(f"time-{strategy}-{level}", text, f"≤ {_MOST_SLOWER}", ratio, low, high, holds)
            )
    for strategy in PLAIN:
        for level in _DRIFTING:
            with_both, without = (
                blocked(records, cell_id(strategy, level, plain)) for plain in (False, True)
            )
            fewer, low, high = mean_interval(with_both - without)
            text = f"{strategy}, {level} drift: margin and guard save blocked drives; difference"
            claims.append(Claim(f"blocked-{strategy}-{level}", text, "< 0", fewer, low, high, high < 0))
            ratio, low, high = ratio_interval(
                times_s(records, cell_id(strategy, level)), times_s(records, cell_id(strategy, level, True))
            )
            text = f"{strategy}, {level} drift: margin and guard save time; ratio"
            claims.append(Claim(f"guard-{strategy}-{level}", text, "< 1", ratio, low, high, high < 1))
    return claims


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
