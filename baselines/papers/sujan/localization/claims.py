"""The claims of fig. 19, and what weighing the localization error is held to."""

from __future__ import annotations

import itertools

import numpy as np

from baselines.experiments.claims import Claim
from baselines.experiments.outcome import Record
from baselines.experiments.statistics import ratio_interval
from baselines.papers.sujan.localization.sweep import COUNTS, ERROR_WEIGHTS, OWN_ID, REACH_M, SPARSE, cell_id

Records = dict[str, list[Record]]
WAY_M = 300.0
"""Errors are compared over so much of the way."""
EVERY_M = 10.0


def all_claims(records: Records) -> list[Claim]:
    """Every claim, from the missions' records by cell."""
    claims = []
    for reach in REACH_M:
        for fewer, more in itertools.pairwise(COUNTS):
            text = f"{reach} fiducials: the error is less with {more} than with {fewer}; ratio"
            pair = cell_id(more, reach), cell_id(fewer, reach)
            claims.append(_less(records, f"number-{reach}-{more}", text, *pair))
    for count in COUNTS[1:]:
        text = f"{count} within reach: the error is less with near fiducials than with far ones; ratio"
        claims.append(_less(records, f"near-{count}", text, cell_id(count, "near"), cell_id(count, "far")))
    text = "ours: the error is less with landmarks of its own map than with none; ratio"
    claims.append(_less(records, "own", text, OWN_ID, cell_id(0, "far")))
    for count in SPARSE:
        for weight in ERROR_WEIGHTS:
            text = (
                f"ours: {count} within reach, w_LE {weight:g} instead of 0: less of the map is wrong; ratio"
            )
            ratio, low, high = ratio_interval(
                at_end(records, cell_id(count, "far", weight), "wrong"),
                at_end(records, cell_id(count, "far"), "wrong"),
            )
            claims.append(Claim(f"weight-{count}-{weight:g}", text, "< 1", ratio, low, high, high < 1))
    return claims


def _less(records: Records, name: str, text: str, smaller: str, larger: str) -> Claim:
    ratio, low, high = ratio_interval(rms_error_m(records, smaller), rms_error_m(records, larger))
    return Claim(name, text, "< 1", ratio, low, high, high < 1)


def errors_by_way(records: Records, cell: str) -> np.ndarray:
    """(N, D) error of the place in metres after every `EVERY_M` of each mission's way, up to `WAY_M`.

    Between scans it is interpolated; beyond the last one it stays.
    """
    at = np.arange(0.0, WAY_M + 0.5 * EVERY_M, EVERY_M)
    return np.stack(
        [np.interp(at, record["driven_m_by_scan"], record["error_m"]) for record in records[cell]]
    )


def rms_error_m(records: Records, cell: str) -> np.ndarray:
    """(N,) root mean square error of the place over `WAY_M` of each mission's way."""
    return np.asarray(np.sqrt((errors_by_way(records, cell) ** 2).mean(axis=1)))


def at_end(records: Records, cell: str, field: str) -> np.ndarray:
    """(N,) a figure of each mission after its last scan."""
    return np.asarray([record[field][-1] for record in records[cell]], float)


def time_to_map(records: Records, cell: str, share: float) -> np.ndarray:
    """(N,) seconds until a share was mapped; where it was not, those of the whole mission."""
    times = []
    for record in records[cell]:
        reached = int(np.searchsorted(np.asarray(record["mapped"]), share))
        times.append(record["time_s"][min(reached, len(record["time_s"]) - 1)])
    return np.asarray(times, float)
