"""What drift does to the strategies of all papers: one robot in `cluttered` with landmarks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from baselines.experiments.claims import Claim, below
from baselines.experiments.experiment import Amount, Experiment, Records, ratio_of, sample
from baselines.experiments.mission import run_mission
from baselines.experiments.plots import COLOURS
from baselines.experiments.rows import Record
from baselines.experiments.statistics import mean_interval, ratio_interval
from baselines.experiments.tables import cells_table
from baselines.experiments.trials import Cell, CellTrial, trials_of
from baselines.strategies import make_strategy
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.reports.metrics import mission_figures
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.localization import Localization
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.settings.scenarios import CLUTTERED

STRATEGIES = {
    "gradient": "Rocha04",
    "mutual-information": "RochaMI",
    "voronoi": "Bhattacharya",
    "per-time-visibility": "Sawhney",
    "next-best-view": "Sujan",
    "planned-rate": "ours",
    "nearest-frontier": "Yamauchi",
}
"""Strategy → whose it is."""
LEVELS = {"none": 0.0, "low": 0.3, "high": 1.0}
"""Name → factor of `HIGH`."""
DRIFTING = tuple(level for level, factor in LEVELS.items() if factor)
HIGH = Localization(xy_m_per_sqrt_m=0.02, yaw_rad_per_sqrt_m=0.01, yaw_rad_per_sqrt_rad=0.01)
"""After 25 m the standard deviation of x, and that of y, is 0.1 m, a voxel's edge, and that of the yaw 3°."""
MARGIN_M = 0.1
"""A voxel's edge: what plans keep clear of walls beyond the body."""
FIDUCIALS = 10
SEEN_SHARE = 0.8
LIMIT_S = 250.0
_QUICK_LIMIT_S = 100.0
PLAIN = ("nearest-frontier", "planned-rate")
"""Strategies that are run without margin and guard, too."""
_MOST_SLOWER = 1.25
_LEAST_SEEN = 0.95
_MOST_CUT_OFF = 0.05
"""A claim about times does not hold where more of the missions than this did not come so far."""
GROUPS = {
    "half-": "half is seen in at most 25 % more time than without drift, low and high drift; ratio",
    "seen-": "at least 95 % is seen of what is seen without drift; ratio",
    "blocked-": "margin and guard save blocked drives; difference",
    "guard-": "with margin and guard half is seen in less time; ratio",
}
"""Beginning of ids → what the claims are, on the page."""


@dataclass(frozen=True)
class Run:
    """Runs a mission of a cell.

    Attributes:
        guarded: Whether a robot that drifts backs off from what blocks it: see `planner.driver`.
    """

    guarded: bool = True

    def __call__(self, env: EntropyExploreEnv, strategy: str, seed: int) -> Record:
        """Run the mission, and return its figures."""
        run_mission(env, make_strategy(strategy), seed, backs_off=self.guarded)
        return mission_figures(env.missions, 0, floor=False)


def cell_id(strategy: str, level: str, plain: bool = False) -> str:
    """Return the name of the cell of a strategy and a level; `plain`, without margin and guard."""
    return f"{strategy}-{level}-plain" if plain else f"{strategy}-{level}"


def experiment(amount: Amount) -> list[CellTrial]:
    """Return all missions, one a world; a quick one ends after 100 s."""
    limit_s, worlds = _QUICK_LIMIT_S if amount.quick else LIMIT_S, amount.seeds
    cells = [
        Cell(cell_id(strategy, level), task(level, MARGIN_M, limit_s), strategy, worlds, Run())
        for strategy in STRATEGIES
        for level in LEVELS
    ]
    cells += [
        Cell(cell_id(name, level, True), task(level, 0.0, limit_s), name, worlds, Run(guarded=False))
        for name in PLAIN
        for level in DRIFTING
    ]
    return trials_of(cells)


def task(level: str, margin_m: float, limit_s: float) -> Scenario:
    """Return `cluttered` for one robot with drift of a level; it ends when a given share is seen."""
    factor = LEVELS[level]
    localization = Localization(
        xy_m_per_sqrt_m=factor * HIGH.xy_m_per_sqrt_m,
        yaw_rad_per_sqrt_m=factor * HIGH.yaw_rad_per_sqrt_m,
        yaw_rad_per_sqrt_rad=factor * HIGH.yaw_rad_per_sqrt_rad,
        margin_m=margin_m if factor else 0.0,
    )
    settings = {
        "robots": 1,
        "robot": {"localization": localization},
        "fiducials": {"number": FIDUCIALS},
        "ending": {"seen_share": SEEN_SHARE, "time_limit_s": limit_s},
        "track_truth": True,
    }
    return with_settings(CLUTTERED, settings)


def all_claims(records: Records) -> list[Claim]:
    """Return every claim.

    Missions are cut off at the time limit: so claims about times are about the time to half of what can be
    seen, and others about the share that was seen by then.
    """
    strategies = [
        claim for each in STRATEGIES for level in DRIFTING for claim in _claims(records, each, level)
    ]
    guard = [claim for each in PLAIN for level in DRIFTING for claim in _guard_claims(records, each, level)]
    return strategies + guard


def _claims(records: Records, strategy: str, level: str) -> list[Claim]:
    """Claim that drift costs a strategy little time, and little of what it sees."""
    both = cell_id(strategy, level), cell_id(strategy, "none")
    ratio = ratio_interval(*(half_times_s(records, cell) for cell in both))
    reached = min(saw_half(records, cell) for cell in both)
    enough = reached >= 1.0 - _MOST_CUT_OFF
    text = "" if enough else f"only {reached:.0%} of the missions did"
    holds = ratio.high <= _MOST_SLOWER and enough
    share = ratio_of(records, *both, "joint.explored")
    return [
        Claim(f"half-{strategy}-{level}", f"≤ {_MOST_SLOWER}", *ratio, holds, text),
        Claim(f"seen-{strategy}-{level}", f"≥ {_LEAST_SEEN}", *share, share.low >= _LEAST_SEEN),
    ]


def _guard_claims(records: Records, strategy: str, level: str) -> list[Claim]:
    """Claim that margin and guard save blocked drives and time."""
    both = cell_id(strategy, level), cell_id(strategy, level, True)
    drives = [sample(records, cell, "blocked_moves") for cell in both]
    ratio = ratio_interval(*(half_times_s(records, cell) for cell in both))
    return [
        below(f"blocked-{strategy}-{level}", mean_interval(drives[0] - drives[1]), 0.0),
        below(f"guard-{strategy}-{level}", ratio),
    ]


def half_times_s(records: Records, cell: str) -> np.ndarray:
    """Return (N,) seconds until half of what can be seen was; the whole mission where it was not."""
    halves = [(record["joint"]["t50_seen_s"], record["t_mission_s"]) for record in records[cell]]
    return np.asarray([end if half is None else half for half, end in halves], float)


def saw_half(records: Records, cell: str) -> float:
    """Return the share of the missions that saw half of what can be seen."""
    return float(np.mean([record["joint"]["t50_seen_s"] is not None for record in records[cell]]))


def error_m(records: Records, cell: str) -> np.ndarray:
    """Return (N,) root mean square error of the place over each mission's scans; 0 where no robot drifts."""
    return np.asarray([record.get("localization", {}).get("rms_error_m", 0.0) for record in records[cell]])


def _strategies_table(records: Records) -> str:
    """Return a table of the strategies at each level of drift."""
    return _table(records, [(strategy, level, False) for strategy in STRATEGIES for level in LEVELS])


def _plain_table(records: Records) -> str:
    """Return a table of strategies without margin and guard beside themselves with them."""
    return _table(
        records, [(n, level, plain) for n in PLAIN for level in DRIFTING for plain in (True, False)]
    )


def _table(records: Records, cells: Sequence[tuple[str, str, bool]]) -> str:
    rows = [
        ((f"{strategy}, plain" if plain else strategy, level), cell_id(strategy, level, plain))
        for strategy, level, plain in cells
    ]

    def mean(cell: str, figure: str) -> float:
        return float(sample(records, cell, figure).mean())

    columns = {
        "half seen (s)": lambda cell: f"{mean_interval(half_times_s(records, cell)):.0f}",
        "saw half": lambda cell: f"{saw_half(records, cell):.0%}",
        "share seen": lambda cell: f"{mean(cell, 'joint.explored'):.3f}",
        "wrong (%)": lambda cell: f"{100.0 * mean(cell, 'joint.wrong'):.2f}",
        "rms error (m)": lambda cell: f"{error_m(records, cell).mean():.3f}",
        "blocked": lambda cell: f"{mean(cell, 'blocked_moves'):.1f}",
    }
    return cells_table(["strategy", "drift"], rows, columns)


def figure_drift(records: Records) -> Figure:
    """Draw wrong voxels and times to half of what can be seen, of every strategy over the level of drift."""
    figure = Figure(figsize=(9.5, 4.0), layout="constrained")
    wrongs, times = figure.subplots(1, 2)
    factors = list(LEVELS.values())
    for number, strategy in enumerate(STRATEGIES):
        cells = [cell_id(strategy, level) for level in LEVELS]
        style: Any = {"color": COLOURS[number % len(COLOURS)], "marker": "o"}
        wrongs.plot(factors, [100.0 * sample(records, cell, "joint.wrong").mean() for cell in cells], **style)
        times.plot(factors, [half_times_s(records, cell).mean() for cell in cells], label=strategy, **style)
    wrongs.set(xlabel="drift over high drift", ylabel="voxels on the wrong side of ½ (%)", ylim=(0, None))
    times.set(xlabel="drift over high drift", ylabel="seconds to half of what can be seen", ylim=(0, None))
    figure.legend(*times.get_legend_handles_labels(), loc="outside right center", frameon=False)
    return figure


EXPERIMENT = Experiment(
    name="sujan-drift",
    title="Strategies over drift",
    template=Path(__file__).with_name("drift.md.j2"),
    trials=experiment,
    claims=all_claims,
    groups=GROUPS,
    figures={"drift": figure_drift},
    tables={"strategies": _strategies_table, "plain": _plain_table},
)
