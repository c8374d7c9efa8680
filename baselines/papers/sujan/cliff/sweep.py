"""The cliff of Sujan as cells: a scenario, five methods, and how many steps they take."""

from __future__ import annotations

import json
import math

from baselines.experiments.cells import Cell
from baselines.experiments.mission import Surroundings
from baselines.papers.sujan.cliff.mission import record_mapping
from entropy_explore_env.scenario import Scenario, with_settings
from entropy_explore_env.scenarios import CLIFF

METHODS = {
    1: "cliff-raster-fixed-yaw",
    2: "cliff-raster",
    3: "cliff-straight-edge",
    4: "cliff-polygon-edge",
    5: "cliff-next-best-view",
}
"""The paper's number of a method → its strategy."""
LOOKS = 4
"""First looks around, which are no steps: the paper's initialization."""
STEPS = 40
"""The paper shows method 1 after 70, method 3 after 20 and method 5 after 10."""
START_M = (2.0625, 6.0625)
"""On the plateau, some 3 m from the edge."""


def cell_id(method: int) -> str:
    """Name of the cell of a method."""
    return f"cliff-{method}"


def experiment(worlds: int) -> list[Cell]:
    """All cells; a mission a world."""
    scenario = scenario_of(STEPS)
    where = Surroundings(every_reset=json.dumps({"starts": [start_of(scenario)]}))
    return [
        Cell(cell_id(method), scenario, strategy, worlds, record_mapping, where)
        for method, strategy in METHODS.items()
    ]


def scenario_of(steps: int) -> Scenario:
    """`cliff` for some steps after the first looks; a drive leads wherever the rover wants."""
    ending = {"max_cycles": LOOKS + steps, "time_limit_s": 1e6}
    return with_settings(CLIFF, {"robot": {"reach_m": math.inf}, "ending": ending})


def start_of(scenario: Scenario) -> list[float]:
    """The pose at which all missions start; map frame."""
    height_m = scenario.plane_m(0)
    assert height_m is not None  # rovers keep theirs
    return [*START_M, height_m, 0.0, 0.0]
