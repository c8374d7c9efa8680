"""The claims of Rocha04, each beside what was measured."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise, product

import numpy as np

from baselines.experiments.claims import Claim, below
from baselines.experiments.experiment import Records, ratio_of, sample
from baselines.experiments.statistics import (
    central_range,
    mean_interval,
    median_interval,
    ratio_interval,
    small_mean_range,
)
from baselines.experiments.tables import cells_table
from baselines.papers.rocha04.sweep import (
    ALTERNATIVES,
    BURSTS,
    I_MINS,
    STANDARD,
    TEAMS,
    alternative_id,
    team_id,
)

PAPER_STARTS = 10
PAPER_T_MISSION_S = 2142.0
_PAPER_HALVES = 7.452
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
    """Return every claim, from the missions' records by cell."""
    walks = [(n, team_id(n, *STANDARD), alternative_id(n, "random")) for n in (1, *TEAMS)]
    return [
        *_exact_claims(records),
        *_single_claims(records, "single", "single"),
        *_single_claims(records, "single-gradient-plane", "plane"),
        *_team_size_claims(records),
        *_channel_claims(records),
        *_shared_claims(records),
        *(below(f"random-{n}", ratio_of(records, *cells), paper=None) for n, *cells in walks),
    ]


def _exact_claims(records: Records) -> list[Claim]:
    single = records["single"]
    start, threshold = single[0]["entropy_start_bits"], single[0]["entropy_threshold_bits"]
    full = all(record["measurements"] == RAYS * record["scans"] for record in single)
    return [
        Claim("H0", 1.987e5, round(start, 1), None, None, f"{start:.3e}" == "1.987e+05"),
        Claim("H_th", -8.6068e4, round(threshold, 1), None, None, round(threshold) == -86068),
        Claim("batch", RAYS, RAYS if full else "not all", None, None, full),
    ]


def _single_claims(records: Records, cell: str, name: str) -> list[Claim]:
    """Claim what the paper says of one robot: it holds if 10 of our starts could have given that mean."""
    claims = []
    for what, figure, paper in (
        ("t_mission", "t_mission_s", PAPER_T_MISSION_S),
        ("k_max", "scans", 1211.0),
        ("measurements", "measurements", 155136.0),
    ):
        values = sample(records, cell, figure)
        low, high = small_mean_range(values, PAPER_STARTS)
        text = f"means of {PAPER_STARTS} starts lie in {low:,.0f} … {high:,.0f}"
        claims.append(Claim(f"{name}-{what}", paper, *mean_interval(values), low <= paper <= high, text))
    ratios = [each["t_mission_s"] / each["half_s"] for each in records[cell] if each["half_s"]]
    low, high = central_range(ratios)
    text = f"the paper shows one mission, ours lie in {low:.1f} … {high:.1f}"
    holds = low <= _PAPER_HALVES <= high
    return [*claims, Claim(f"{name}-halves", _PAPER_HALVES, *median_interval(ratios), holds, text)]


def _team_size_claims(records: Records) -> list[Claim]:
    """Claim that the mean time falls from team to team: with every channel, and by the motion-plane rule."""
    sizes = (1, *TEAMS)
    rows = {f"{b}-{i}": [team_id(robots, b, i) for robots in sizes] for b, i in product(BURSTS, I_MINS)}
    rows["plane"] = [alternative_id(robots, "gradient-plane") for robots in sizes]
    claims = []
    for name, cells in rows.items():
        seeds = min(len(records[cell]) for cell in cells)
        means = [sample(records, cell)[:seeds].mean() for cell in cells]
        ratio = ratio_of(records, cells[-1], cells[0])
        holds = ratio.high < 1 and all(later < earlier for earlier, later in pairwise(means))
        text = ", ".join(f"{mean:,.0f}" for mean in means) + " s"
        claims.append(Claim(f"team-size-{name}", "falls", *ratio, holds, text))
    return claims


def _channel_claims(records: Records) -> list[Claim]:
    """Claim what burst and I_min change, pooled over team sizes, the same seeds."""

    def pooled(burst: int, i_min_bits: float) -> np.ndarray:
        return np.mean([sample(records, team_id(robots, burst, i_min_bits)) for robots in TEAMS], axis=0)

    claims = []
    for i_min, (small, large) in product(I_MINS, ((32, 64), (64, 128), (32, 128))):
        ratio = ratio_interval(pooled(large, i_min), pooled(small, i_min))
        claims.append(below(f"burst-{small}-{large}-{i_min}", ratio))
    for burst, (large, small) in product(BURSTS, ((0.6215, 0.3219), (0.3219, 0.0291), (0.6215, 0.0291))):
        ratio = ratio_interval(pooled(burst, small), pooled(burst, large))
        claims.append(Claim(f"i-min-{large}-{small}-{burst}", "≤ 1", *ratio, ratio.low <= 1))
    return claims


def _shared_claims(records: Records) -> list[Claim]:
    """Claim the slope of the shared measurements, in measurements a scan (figs. 7 and 8)."""
    claims = []
    for burst in BURSTS:
        first = [np.mean(record["sent_by_scan"][:2]) for record in records[team_id(2, burst, STANDARD[1])]]
        median = median_interval(first)
        text = f"mean {np.mean(first):.1f}"
        claims.append(Claim(f"slope-{burst}", burst, *median, median.value == burst, text))
    for i_min in (0.6215, 0.3219):
        early, *_, late = _unfilled(records, i_min)
        rise = mean_interval(late - early)
        text = f"{late.mean():.0%} in the last quarter, {early.mean():.0%} in the first"
        claims.append(Claim(f"binds-late-{i_min}", "> 0", *rise, rise.low > 0, text))
    share = mean_interval(np.mean(_unfilled(records, 0.0291), axis=0))
    return [*claims, Claim("never-binds", 0.0, *share, share.value == 0.0)]


def _unfilled(records: Records, i_min: float) -> np.ndarray:
    """Return (4, N) shares of two robots' batches smaller than burst 64, in each quarter of the scans."""
    sent = [np.array_split(each["sent_by_scan"], 4) for each in records[team_id(2, STANDARD[0], i_min)]]
    return np.array([[float((part < STANDARD[0]).mean()) for part in parts] for parts in sent]).T


def _mean(records: Records, figure: str, form: str) -> Callable[[str], str]:
    """Return what shows the mean of a figure of a cell."""
    return lambda cell: format(sample(records, cell, figure).mean(), form)


def teams_table(records: Records) -> str:
    """Return strategies beside each other for every team size, burst 64 and I_min 0.3219."""
    rows = []
    for robots, strategy in product((1, *TEAMS), ("gradient", *ALTERNATIVES)):
        gradient = strategy == "gradient"
        cell = team_id(robots, *STANDARD) if gradient else alternative_id(robots, strategy)
        rows.append(((robots, strategy), cell))

    def scans(cell: str) -> np.ndarray:
        return sample(records, cell, "scans") / sample(records, cell, "robots")

    columns = {
        "mean t (s)": lambda cell: f"{mean_interval(sample(records, cell)):,.0f}",
        "scans a robot": lambda cell: f"{scans(cell).mean():,.0f}",
        "s a scan": lambda cell: f"{(sample(records, cell) / scans(cell)).mean():.2f}",
        "mean distance apart (m)": lambda cell: (
            "-" if cell.startswith("single") else _mean(records, "apart_m", ".2f")(cell)
        ),
    }
    return cells_table(["robots", "strategy"], rows, columns)
