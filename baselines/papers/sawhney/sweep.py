"""The experiment of Sawhney 2009 as cells: world, team size, metric and allocation of each point.

β of V - βt goes with the units of V and t. The paper's β ∈ [1, 70] count its own terrain points; here a point
is taken to be 0.05 m² of plan, and 4 m³ over terrain (m² of ground times the height factor): so the paper's
numbers sweep 0.05 … 3.5 m²/s and 4 … 280 m³/s, from well below to well above what a robot discovers a second.
"""

from __future__ import annotations

import math
from typing import Any

from baselines.experiments.experiment import Amount
from baselines.experiments.trials import Cell, CellTrial, trials_of
from baselines.papers.sawhney.mission import Run
from baselines.strategies.allocation import ExplorationConfig
from entropy_explore_env.frontiers.frontier_map import FrontierConfig
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.settings.scenarios import find_scenario

PLANS = ("office", "corridor", "cluttered", "hybrid")
TERRAINS = ("terrain-smooth", "terrain", "terrain-rough")
DEM = "dem"
TEAMS, QUICK_TEAMS = (1, 2, 3, 4, 5, 6), {"plans": (1, 3), "terrains": (3,)}
BETAS = (1, 2, 5, 10, 20, 30, 40, 50, 60, 70)
QUICK_BETAS = (1, 5, 10, 20, 40, 70)
FARTHER_BETAS = {"plans": (), "terrains": (100, 200)}
"""Beyond the paper's, so that the best one has others on both sides."""
POINT = {"plans": 0.05, "terrains": 4.0}
"""What one of the paper's points is taken to be: m² of plan; m² of ground times metres of height factor."""
BONUS = {"plans": 0.5, "terrains": 40.0}
"""Of the finishing rule."""
STRATEGY = "per-time-visibility"
TIME_LIMIT_S = 3600.0

_PLAN: dict[str, Any] = {
    "robot": {"reach_m": math.inf, "body_radius_m": 0.0, "unknown_cost": 1e4},
    "sensor": {"max_range_m": 3.0, "angular_step_rad": math.pi / 180, "scan_time_s": 2.0},
}
_TERRAIN: dict[str, Any] = {
    "robot": {"navigator": "planned", "reach_m": math.inf, "body_radius_m": 0.0},
    "sensor": {
        "field_of_view_rad": (2 * math.pi, math.pi / 2),
        "angular_step_rad": math.pi / 60,
        "max_range_m": 20.0,
        "scan_time_s": 2.0,
    },
}
_ALL: dict[str, Any] = {
    "channel": {"burst": 10_000, "i_min_bits": 0.0},
    "ending": {"sigma_end": 1e-3, "time_limit_s": TIME_LIMIT_S},
    "track_truth": True,
}


def part_of(world: str) -> str:
    """Return `plans` or `terrains`."""
    return "plans" if world in PLANS else "terrains"


def methods(part: str, quick: bool) -> dict[str, dict[str, Any]]:
    """Return each method's fields of ExplorationConfig, by its name."""
    betas = (*(QUICK_BETAS if quick else BETAS), *FARTHER_BETAS[part])
    frontiers = {"frontiers": FrontierConfig(visibility="naive")}
    found: dict[str, dict[str, Any]] = {
        "ptv": {},
        "sync": {"allocation": "synchronous"},
        **{f"beta-{beta}": {"beta": beta * POINT[part]} for beta in betas},
        "naive": frontiers,
        "finish": {"bonus": BONUS[part]},
        "nearest": {"metric": "nearest", "promises": False},
        "coordinated": {"metric": "coordinated"},
    }
    if part == "terrains":
        found["no-height"] = {"frontiers": FrontierConfig(gamma=None)}
    return found


def cell_id(world: str, robots: int, method: str) -> str:
    """Return the name of a cell."""
    return f"{world}/n{robots}/{method}"


def experiment(amount: Amount) -> list[CellTrial]:
    """Return all missions: a quick run has fewer team sizes and β, and no model of real ground."""
    cells = []
    for world in (*PLANS, *TERRAINS, *(() if amount.quick else (DEM,))):
        part = part_of(world)
        for robots in QUICK_TEAMS[part] if amount.quick else TEAMS:
            scenario = _scenario(world, robots)
            for method, exploring in methods(part, amount.quick).items():
                run = Run(ExplorationConfig(once=True, **exploring), over_model=world == DEM)
                cells.append(Cell(cell_id(world, robots, method), scenario, STRATEGY, amount.seeds, run))
    return trials_of(cells)


def _scenario(world: str, robots: int) -> Scenario:
    base = find_scenario("terrain" if world == DEM else world)
    scenario = with_settings(base, {**_ALL, "robots": robots})
    return with_settings(scenario, _PLAN if world in PLANS else _TERRAIN)
