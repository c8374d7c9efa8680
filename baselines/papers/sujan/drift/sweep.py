"""Strategies over drift as cells: one robot in `cluttered` with landmarks, at a few levels of drift."""

from __future__ import annotations

from baselines.experiments.cells import Cell
from baselines.papers.sujan.drift.mission import Run
from entropy_explore_env.localization_settings import Localization
from entropy_explore_env.scenario import Scenario, with_settings
from entropy_explore_env.scenarios import CLUTTERED

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
HIGH = Localization(xy_m_per_sqrt_m=0.02, yaw_rad_per_sqrt_m=0.01, yaw_rad_per_sqrt_rad=0.01)
"""After 25 m the standard deviation of x, and that of y, is 0.1 m, a voxel's edge, and that of the yaw 3°."""
MARGIN_M = 0.1
"""A voxel's edge: what plans keep clear of walls beyond the body."""
FIDUCIALS = 10
SEEN_SHARE = 0.8
LIMIT_S = 250.0
PLAIN = ("nearest-frontier", "planned-rate")
"""Strategies that are run without margin and guard, too."""


def cell_id(strategy: str, level: str, plain: bool = False) -> str:
    """Name of the cell of a strategy and a level; `plain`, without margin and guard."""
    return f"{strategy}-{level}-plain" if plain else f"{strategy}-{level}"


def experiment(worlds: int, limit_s: float = LIMIT_S) -> list[Cell]:
    """All cells, a mission a world."""
    cells = [
        Cell(cell_id(strategy, level), task(level, MARGIN_M, limit_s), strategy, worlds, Run())
        for strategy in STRATEGIES
        for level in LEVELS
    ]
    return cells + [
        Cell(cell_id(name, level, True), task(level, 0.0, limit_s), name, worlds, Run(guarded=False))
        for name in PLAIN
        for level in LEVELS
        if LEVELS[level]
    ]


def task(level: str, margin_m: float, limit_s: float) -> Scenario:
    """`cluttered` for one robot, until so much is seen, with drift of a level."""
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
