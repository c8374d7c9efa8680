"""The planar experiments of Sujan as cells: scenario, method and number of starts of each point."""

from __future__ import annotations

import json
import math

from baselines.experiments.cells import Cell
from baselines.experiments.mission import Surroundings
from baselines.papers.sujan.mission import Run
from baselines.strategies.rules.next_best_view import NextBestViewConfig
from entropy_explore_env.scenario import Scenario, with_settings
from entropy_explore_env.scenarios import OCCLUSIONS

METHODS = {
    "i": "random-known",
    "ii": "raster",
    "iii": "most-unmapped",
    "iv": "least-mapped",
    "v": "next-best-view",
}
"""The paper's number of a method → its strategy."""
TEAMS = (1, 2)
SCANS = 150
"""Of the team; the figures do not say how many the paper took."""
OTHERS = ("random", "nearest-frontier")
"""Strategies beside the paper's, for one robot."""
CHANGES: dict[str, tuple[str, NextBestViewConfig]] = {
    "near": ("w_d 0.05 bits a metre instead of 0.01", NextBestViewConfig(distance_weight=0.05)),
    "far": ("w_d 0", NextBestViewConfig(distance_weight=0.0)),
    "half": (
        "unknown cells at ½, not at the mean of their neighbours",
        NextBestViewConfig(extrapolated=False),
    ),
    "linear": ("q in place of -q log2 q", NextBestViewConfig(measure="linear")),
    "half-linear": (
        "both of these",
        NextBestViewConfig(measure="linear", extrapolated=False),
    ),
    "half-linear-far": (
        "both of these, and w_d 0",
        NextBestViewConfig(measure="linear", extrapolated=False, distance_weight=0.0),
    ),
    "stretched": ("eqs. 6-7 instead of eq. 8", NextBestViewConfig(measure="stretched")),
    "interest": ("β = 0: no interest is lost", NextBestViewConfig(interest_decay=0.0)),
    "poses": ("400 poses instead of 100", NextBestViewConfig(poses=400)),
}
"""Name → what is changed in method (v), and its settings; one robot."""


def cell_id(robots: int, method: str) -> str:
    """Name of the cell of a method, or of a change of method (v)."""
    return f"robots-{robots}-{method}"


def experiment(starts: int, changes: bool) -> list[Cell]:
    """All cells.

    Args:
        starts: Missions a cell, in as many worlds.
        changes: Whether method (v) with one thing changed at a time is part of it.
    """
    cells = []
    for robots in TEAMS:
        for method, strategy in METHODS.items():
            cells.append(_cell(robots, method, strategy, starts, Run()))
    for strategy in OTHERS:
        cells.append(_cell(1, strategy, strategy, starts, Run()))
    if changes:
        for name, (_, config) in CHANGES.items():
            cells.append(_cell(1, f"v-{name}", METHODS["v"], starts, Run(config)))
    return cells


def _cell(robots: int, method: str, strategy: str, starts: int, run: Run) -> Cell:
    return Cell(cell_id(robots, method), scenario_of(robots), strategy, starts, run, in_the_middle(robots))


def scenario_of(robots: int) -> Scenario:
    """The task: a sensor of 90° and 15 m for one robot, of 75° and 10 m for two; a number of scans.

    A drive leads wherever the robot wants, so that each decision is one scan, as in the paper.
    """
    view, range_m = (math.pi / 2, 15.0) if robots == 1 else (math.radians(75.0), 10.0)
    settings = {
        "robots": robots,
        "robot": {"reach_m": math.inf},
        "sensor": {"field_of_view_rad": (view, 0.0), "max_range_m": range_m},
        "channel": {"burst": 1000},
        "ending": {"max_cycles": SCANS, "time_limit_s": 1e6, "seen_share": 1.0},
        "track_truth": True,
    }
    return with_settings(OCCLUSIONS, settings)


def in_the_middle(robots: int) -> Surroundings:
    """All missions start in the middle; two robots a metre apart."""
    middle = [0.5 * size for size in OCCLUSIONS.grid.size_m]
    places = [[middle[0] + robot - 0.5 * (robots - 1), *middle[1:], 0.0, 0.0] for robot in range(robots)]
    return Surroundings(every_reset=json.dumps({"starts": places}))
