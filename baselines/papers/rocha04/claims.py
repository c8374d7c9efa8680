"""The claims of Rocha04, each beside what was measured."""

from __future__ import annotations

from itertools import pairwise, product

import numpy as np

from baselines.experiments.claims import Claim
from baselines.experiments.experiment import Records
from baselines.experiments.rows import Record
from baselines.experiments.statistics import (
    central_range,
    mean_interval,
    median_interval,
    ratio_interval,
    small_mean_range,
)
from baselines.experiments.tables import markdown_table
from baselines.papers.rocha04.sweep import (
    ALTERNATIVES,
    BURSTS,
    CHANGES,
    I_MINS,
    STANDARD,
    TEAMS,
    alternative_id,
    team_id,
)

PAPER_STARTS = 10
PAPER_T_MISSION_S = 2142.0
RAYS = 128
GROUPS = {
    "H0": "H(0) in bits",
    "H_th": "H_th in bits",
    "batch": "measurements in every batch",
    "single-t_mission": "one robot (eqs. 33-34): mean seconds",
    "single-k_max": "one robot: mean scans",
    "single-measurements": "one robot: mean measurements",
    "single-halves": "one robot: time to the end over time to half of the entropy; median",
    "plane-t_mission": "one robot, motion plane (eqs. 38-40): mean seconds",
    "plane-k_max": "the same: mean scans",
    "plane-measurements": "the same: mean measurements",
    "plane-halves": "the same: time to the end over time to half of the entropy; median",
    "team-size-": "time falls from 1 to 4 robots, for every burst and I_min; t(4)/t(1)",
    "burst-": "a larger burst is faster, for every I_min; ratio of times",
    "i-min-": "a smaller I_min is not slower, for every burst; ratio of times",
    "slope-": "2 robots: the first batches send as many measurements as the burst (32, 64, 128); median",
    "binds-late-": "2 robots: I_min 0.6215 and 0.3219 bind late; rise of the share of batches not filled",
    "never-binds": "2 robots: I_min 0.0291 never binds; share of batches not filled",
    "random-": "ours: 1, 2, 3, 4 robots: the gradient rule is faster than a random walk; ratio of times",
}
"""Beginning of ids → what the claims are, on the page."""


def all_claims(records: Records) -> list[Claim]:
    """Every claim, from the missions' records by cell."""
    return [
        *_exact_claims(records),
        *_single_claims(records["single"], "single", "one robot"),
        *_single_claims(records["single-gradient-plane"], "plane", "one robot, motion plane (eqs. 38-40)"),
        *_team_size_claims(records),
        *_burst_claims(records),
        *_i_min_claims(records),
        *_shared_claims(records),
        *_random_claims(records),
    ]


def times(records: Records, cell: str) -> np.ndarray:
    """Mission times of a cell in seconds, by seed; a mission cut off counts with its limit."""
    return np.asarray([record["t_mission_s"] for record in records[cell]])


def _exact_claims(records: Records) -> list[Claim]:
    single = records["single"]
    start, threshold = single[0]["entropy_start_bits"], single[0]["entropy_threshold_bits"]
    full = sum(record["measurements"] == RAYS * record["scans"] for record in single) / len(single)
    return [
        Claim("H0", "H(0) in bits", 1.987e5, round(start, 1), None, None, f"{start:.3e}" == "1.987e+05"),
        Claim("H_th", "H_th in bits", -8.6068e4, round(threshold, 1), None, None, round(threshold) == -86068),
        Claim(
            "batch",
            "measurements in every batch",
            RAYS,
            RAYS if full == 1 else "not all",
            None,
            None,
            full == 1,
        ),
    ]


def _single_claims(single: list[Record], name: str, subject: str) -> list[Claim]:
    """One robot: our mean, and whether the paper's is one that 10 of our starts could have given."""
    claims = []
    for figure, field, paper in (
        ("t_mission", "t_mission_s", PAPER_T_MISSION_S),
        ("k_max", "scans", 1211.0),
        ("measurements", "measurements", 155136.0),
    ):
        values = [record[field] for record in single]
        mean, low, high = mean_interval(values)
        lowest, highest = small_mean_range(values, PAPER_STARTS)
        text = (
            f"{subject}: mean {field}; means of {PAPER_STARTS} starts lie in {lowest:,.0f} … {highest:,.0f}"
        )
        claims.append(Claim(f"{name}-{figure}", text, paper, mean, low, high, lowest <= paper <= highest))
    ratios = [record["t_mission_s"] / record["half_s"] for record in single if record["half_s"]]
    median, low, high = median_interval(ratios)
    lowest, highest = central_range(ratios)
    text = (
        f"{subject}: time to the end over time to half of the entropy; the paper shows one mission, "
        "ours lie in "
        f"{lowest:.1f} … {highest:.1f}; median"
    )
    holds = lowest <= 7.452 <= highest
    return [*claims, Claim(f"{name}-halves", text, 7.452, median, low, high, holds)]


def _team_size_claims(records: Records) -> list[Claim]:
    """The gradient rule with every channel, and the rule whose single robot is the paper's."""
    channels = [(burst, i_min_bits) for burst in BURSTS for i_min_bits in I_MINS]
    claims = [
        _team_size_claim(
            records,
            f"{burst}-{i_min_bits}",
            f"burst {burst}, I_min {i_min_bits}",
            [team_id(robots, burst, i_min_bits) for robots in (1, *TEAMS)],
        )
        for burst, i_min_bits in channels
    ]
    plane = [alternative_id(robots, "gradient-plane") for robots in (1, *TEAMS)]
    return [*claims, _team_size_claim(records, "plane", "motion plane, burst 64, I_min 0.3219", plane)]


def _team_size_claim(records: Records, name: str, what: str, cells: list[str]) -> Claim:
    """Larger team, faster: the mean falls from cell to cell, the last is below the first, the same seeds."""
    seeds = min(len(records[cell]) for cell in cells)
    means = [times(records, cell)[:seeds].mean() for cell in cells]
    ratio, low, high = ratio_interval(times(records, cells[-1])[:seeds], times(records, cells[0])[:seeds])
    falls = all(later < earlier for earlier, later in pairwise(means))
    shown = ", ".join(f"{mean:,.0f}" for mean in means)
    text = f"{what}: t falls from 1 to 4 robots ({shown} s); t(4)/t(1)"
    return Claim(f"team-size-{name}", text, "falls", ratio, low, high, falls and high < 1)


def _burst_claims(records: Records) -> list[Claim]:
    """Larger burst, faster: for every I_min, pooled over team sizes, the same seeds."""
    claims = []
    for i_min_bits in I_MINS:
        for small, large in ((32, 64), (64, 128), (32, 128)):
            ratio, low, high = ratio_interval(
                _pooled(records, large, i_min_bits), _pooled(records, small, i_min_bits)
            )
            text = f"I_min {i_min_bits}: burst {large} is faster than {small}; t({large})/t({small})"
            claims.append(
                Claim(f"burst-{small}-{large}-{i_min_bits}", text, "< 1", ratio, low, high, high < 1)
            )
    return claims


def _i_min_claims(records: Records) -> list[Claim]:
    """Smaller I_min, not slower: for every burst, pooled over team sizes, the same seeds."""
    claims = []
    for burst in BURSTS:
        for large, small in ((0.6215, 0.3219), (0.3219, 0.0291), (0.6215, 0.0291)):
            ratio, low, high = ratio_interval(_pooled(records, burst, small), _pooled(records, burst, large))
            text = f"burst {burst}: I_min {small} is not slower than {large}; t({small})/t({large})"
            claims.append(Claim(f"i-min-{large}-{small}-{burst}", text, "≤ 1", ratio, low, high, low <= 1))
    return claims


def _pooled(records: Records, burst: int, i_min_bits: float) -> np.ndarray:
    """Mission time of each seed, averaged over team sizes."""
    return np.mean([times(records, team_id(robots, burst, i_min_bits)) for robots in TEAMS], axis=0)


def _shared_claims(records: Records) -> list[Claim]:
    """Figures 7 and 8: the slope of the shared measurements, in measurements a scan."""
    claims = []
    for burst in BURSTS:
        first = [np.mean(record["sent_by_scan"][:2]) for record in records[team_id(2, burst, STANDARD[1])]]
        median, low, high = median_interval(first)
        text = (
            f"2 robots, burst {burst}: the shared measurements start at slope burst: measurements in the "
            f"first batches, median mission (mean {np.mean(first):.1f})"
        )
        claims.append(Claim(f"slope-{burst}", text, burst, median, low, high, median == burst))
    for i_min_bits in (0.6215, 0.3219):
        cell = records[team_id(2, STANDARD[0], i_min_bits)]
        early, late = (_unfilled(cell, part) for part in (0, 3))
        mean, low, high = mean_interval(late - early)
        text = (
            f"2 robots, burst 64: I_min {i_min_bits} binds late: batches not filled, last quarter "
            f"({late.mean():.0%}) minus first ({early.mean():.0%})"
        )
        claims.append(Claim(f"binds-late-{i_min_bits}", text, "> 0", mean, low, high, low > 0))
    unfilled = np.mean(
        [_unfilled(records[team_id(2, STANDARD[0], 0.0291)], part) for part in range(4)], axis=0
    )
    mean, low, high = mean_interval(unfilled)
    text = "2 robots, burst 64: I_min 0.0291 never binds: share of batches not filled"
    return [*claims, Claim("never-binds", text, 0.0, mean, low, high, mean == 0.0)]


def _unfilled(cell: list[Record], quarter: int) -> np.ndarray:
    """Share of a mission's batches in one quarter of its scans that were smaller than burst 64."""
    shares = []
    for record in cell:
        parts = np.array_split(np.asarray(record["sent_by_scan"]), 4)
        shares.append(float((parts[quarter] < STANDARD[0]).mean()))
    return np.asarray(shares)


def _random_claims(records: Records) -> list[Claim]:
    """Not the paper's: the gradient rule against a random walk from the same starts."""
    claims = []
    for robots in (1, *TEAMS):
        walk = times(records, alternative_id(robots, "random"))
        ratio, low, high = ratio_interval(times(records, team_id(robots, *STANDARD)), walk)
        text = (
            f"ours, {robots} robot{'s' if robots > 1 else ''}: gradient is faster than a random walk; ratio"
        )
        claims.append(Claim(f"random-{robots}", text, None, ratio, low, high, high < 1))
    return claims


def teams_table(records: Records) -> str:
    """Return strategies beside each other for every team size, burst 64 and I_min 0.3219."""
    rows = []
    for robots, strategy in product((1, *TEAMS), ("gradient", *ALTERNATIVES)):
        gradient = strategy == "gradient"
        cell = team_id(robots, *STANDARD) if gradient else alternative_id(robots, strategy)
        time_s, scans = times(records, cell), [record["scans"] / robots for record in records[cell]]
        apart_m = np.mean([record["apart_m"] for record in records[cell]])
        rows.append(
            [
                robots,
                strategy,
                f"{mean_interval(time_s):,.0f}",
                f"{np.mean(scans):,.0f}",
                f"{(time_s / scans).mean():.2f}",
                "-" if robots == 1 else f"{apart_m:.2f}",
            ]
        )
    head = ["robots", "strategy", "mean t (s)", "scans a robot", "s a scan", "mean distance apart (m)"]
    return markdown_table(head, rows)


def changes_table(records: Records) -> str:
    """Return mission times with one setting changed, paired with the room as it is."""
    base, rows = times(records, "single"), []
    for name, text in {"": "nothing", **{name: change[0] for name, change in CHANGES.items()}}.items():
        cell = f"change-{name}" if name else "single"
        time_s, found = times(records, cell), records[cell]
        rows.append(
            [
                text,
                f"{time_s.mean():,.0f}",
                f"{np.median(time_s):,.0f}",
                f"{ratio_interval(time_s, base):.2f}",
                f"{np.median([record['half_s'] for record in found if record['half_s']]):,.0f}",
                f"{np.mean([record['scans'] for record in found]):,.0f}",
                f"{time_s.sum() / sum(record['scans'] for record in found):.2f}",
                sum(not record["finished"] for record in found),
            ]
        )
    head = ["changed", "mean t (s)", "median t (s)", "t over the room's", "median half (s)", "mean scans"]
    return markdown_table([*head, "s a scan", "cut off"], rows)


def cut_off(records: Records) -> int:
    """Return how many missions the time limit ended."""
    return sum(not record["finished"] for cell in records.values() for record in cell)
