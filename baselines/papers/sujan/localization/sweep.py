"""The experiment of fig. 19 as cells: fiducials near and far, and weights of the localization error."""

from __future__ import annotations

import math

from baselines.experiments.cells import Cell
from baselines.papers.sujan.localization.mission import Run
from baselines.papers.sujan.sweep import METHODS, in_the_middle, scenario_of
from baselines.strategies.rules.next_best_view import NextBestViewConfig
from entropy_explore_env.localization_settings import Localization
from entropy_explore_env.scenario import Scenario, with_settings

DRIFT = Localization(xy_m_per_sqrt_m=0.02, yaw_rad_per_sqrt_m=0.002, yaw_rad_per_sqrt_rad=0.002)
"""Ours: after 100 m the standard deviation of x, and that of y, is 0.2 m, and that of the yaw 1.1°."""
COUNTS = (0, 1, 3, 10)
"""Fiducials within reach of a robot on average, the numbers of fig. 19."""
REACH_M = {"near": 7.5, "far": 15.0}
"""How far away fiducials are sighted."""
AREA_M2 = 100.0 * 100.0
ERROR_WEIGHTS = (0.3, 1.0)
"""w_LE, bits a metre, beside 0."""
SPARSE = (1, 3)
"""Fiducials within reach, far, where w_LE is weighed: with more, any way leads past some."""
OWN = 16
"""Landmarks of the robot's own map, where there are no fiducials: ours."""
OWN_ID = "own-landmarks"
SCANS = 60


def cell_id(count: int, reach: str, weight: float = 0.0) -> str:
    """Name of the cell of a number of fiducials, `near` or `far`, and a weight of the error."""
    place = f"fiducials-{count}-{reach}" if count else "fiducials-0"
    return f"{place}-weight-{weight:g}" if weight else place


def in_world(count: int, reach: str) -> int:
    """How many fiducials a world has where so many are to be in a circle of the reach."""
    return round(count * AREA_M2 / (math.pi * REACH_M[reach] ** 2))


def experiment(worlds: int, scans: int = SCANS) -> list[Cell]:
    """All cells, a mission a world: method (v), one robot."""
    cells = [_cell(0, "far", 0.0, worlds, scans)]
    for reach in REACH_M:
        cells += [_cell(count, reach, 0.0, worlds, scans) for count in COUNTS if count]
    own = with_settings(drifting(0, "far", scans), {"fiducials": {"own_number": OWN}})
    cells.append(Cell(OWN_ID, own, METHODS["v"], worlds, Run(NextBestViewConfig()), in_the_middle(1)))
    for count in SPARSE:
        cells += [_cell(count, "far", weight, worlds, scans) for weight in ERROR_WEIGHTS]
    return cells


def _cell(count: int, reach: str, weight: float, worlds: int, scans: int) -> Cell:
    run = Run(NextBestViewConfig(error_weight=weight))
    task = drifting(count, reach, scans)
    return Cell(cell_id(count, reach, weight), task, METHODS["v"], worlds, run, in_the_middle(1))


def drifting(count: int, reach: str, scans: int) -> Scenario:
    """The planar task for one robot that drifts."""
    return with_settings(
        scenario_of(1),
        {
            "robot": {"localization": DRIFT},
            "fiducials": {"number": in_world(count, reach), "range_m": REACH_M[reach]},
            "ending": {"max_cycles": scans},
        },
    )
