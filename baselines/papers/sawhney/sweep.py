"""The experiment of Sawhney 2009 as cells: world, team size, metric and allocation of each point.

β of V - βt goes with the units of V and t. The paper's β ∈ [1, 70] count its own terrain points; here a point
is taken to be 0.05 m² of plan, and 4 m³ over terrain (m² of ground times the height factor): so the paper's
numbers sweep 0.05 … 3.5 m²/s and 4 … 280 m³/s, from well below to well above what a robot discovers a second.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any

from baselines.experiments.experiment import Amount
from baselines.experiments.mission import Surroundings
from baselines.experiments.trials import Cell, CellTrial, trials_of
from baselines.papers.sawhney.mission import Run
from baselines.papers.sawhney.terrain_model import height_map
from baselines.strategies.metrics import Coordinated, ExplorationConfig, Metric, Nearest
from entropy_explore_env.errors import SettingError
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
MAP_TEAM, MAP_STARTS = 3, 5
MAP_METHODS = ("ptv", "beta-1", "beta-10", "beta-40", "finish", "nearest", "coordinated")
"""Of plans from files: real ones have racks, clutter, and gaps that no robot gets through."""
HEIGHT_MAPS = (".tif", ".tiff")
"""How names of height maps' files end."""
CHANGED_TEAM = 3
"""Team size at which one thing is changed at a time."""

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


@dataclass(frozen=True)
class Change:
    """One change: settings of the scenario, of the ExplorationConfig, or of its FrontierConfig."""

    text: str
    settings: dict[str, Any] = field(default_factory=dict)
    exploring: dict[str, Any] = field(default_factory=dict)
    frontiers: dict[str, Any] = field(default_factory=dict)


_SCAN_SHORT = Change("a scan takes 0.5 s", {"sensor": {"scan_time_s": 0.5}})
_SCAN_LONG = Change("a scan takes 8 s", {"sensor": {"scan_time_s": 8.0}})
_UNPROMISED = Change("nothing is promised", exploring={"promises": False})
CHANGES: dict[str, dict[str, Change]] = {
    "plans": {
        "scan-short": _SCAN_SHORT,
        "scan-long": _SCAN_LONG,
        "range": Change("the sensor sees twice as far", {"sensor": {"max_range_m": 6.0}}),
        "bodies": Change("bodies of 0.2 m", {"robot": {"body_radius_m": 0.2}}),
        "unpromised": _UNPROMISED,
    },
    "terrains": {
        "scan-short": _SCAN_SHORT,
        "scan-long": _SCAN_LONG,
        "range": Change("the sensor sees half as far", {"sensor": {"max_range_m": 10.0}}),
        "level": Change("unexplored ground is taken to be level", frontiers={"unexplored_ground": "level"}),
        "corners": Change("UAVs stop and scan at every corner", {"robot": {"navigator": "straight"}}),
        "unpromised": _UNPROMISED,
    },
}
"""What is changed in plans, and over terrain."""
CHANGED_METHODS = ("ptv", "beta-5", "beta-20")
CHANGED_IN = {"plans": PLANS, "terrains": TERRAINS}
QUICK_CHANGED_IN = {"plans": ("office",), "terrains": ("terrain",)}


def part_of(world: str) -> str:
    """`plans` or `terrains`."""
    return "plans" if world in PLANS else "terrains"


def methods(part: str, quick: bool) -> dict[str, dict[str, Any]]:
    """Return each method's fields of ExplorationConfig, by its name."""
    betas = (*(QUICK_BETAS if quick else BETAS), *FARTHER_BETAS[part])
    frontiers = {"frontiers": FrontierConfig(visibility="naive")}
    found: dict[str, dict[str, Any]] = {
        "ptv": {},
        "sync": {"allocation": "synchronous"},
        **{f"beta-{beta}": {"metric": Metric(beta * POINT[part])} for beta in betas},
        "naive": frontiers,
        "finish": {"metric": Metric(bonus=BONUS[part])},
        "nearest": {"metric": Nearest(), "promises": False},
        "coordinated": {"metric": Coordinated()},
    }
    if part == "terrains":
        found["no-height"] = {"frontiers": FrontierConfig(gamma=None)}
    return found


def cell_id(world: str, robots: int, method: str, change: str | None = None) -> str:
    """Return the name of a cell."""
    return f"{world}/n{robots}/{method}" + ("" if change is None else f"-{change}")


def experiment(amount: Amount) -> list[CellTrial]:
    """Return all missions: a quick run has fewer team sizes and β, and no model of real ground.

    World files that end as height maps do take the place of that model; others are plans.
    """
    grounds = [str(file) for file in amount.worlds if file.suffix in HEIGHT_MAPS]
    plans = [file for file in amount.worlds if file.suffix not in HEIGHT_MAPS]
    if len(grounds) > 1:
        raise SettingError("worlds", " ".join(grounds), "one height map at most")
    seeds, quick, cells = amount.seeds, amount.quick, list[Cell]()
    for world in (*PLANS, *TERRAINS, *((DEM,) if grounds or not quick else ())):
        part = part_of(world)
        ground = height_map(grounds[0]) if grounds and world == DEM else None
        for robots in QUICK_TEAMS[part] if quick else TEAMS:
            for method, exploring in methods(part, quick).items():
                cells.append(_cell(world, robots, method, exploring, seeds, file=ground))
    for file, method in product(plans, MAP_METHODS):
        exploring = methods("plans", False)[method]
        cell = _cell(PLANS[0], MAP_TEAM, method, exploring, min(seeds, MAP_STARTS), file={"path": str(file)})
        cells.append(replace(cell, id=cell_id(f"map-{file.stem}", MAP_TEAM, method)))
    for part, changes in CHANGES.items():
        worlds = (QUICK_CHANGED_IN if quick else CHANGED_IN)[part]
        for name, world, method in product(changes, worlds, CHANGED_METHODS):
            change = changes[name]
            exploring = {**methods(part, False)[method], **change.exploring}
            frontiers = exploring.get("frontiers", FrontierConfig())
            exploring["frontiers"] = replace(frontiers, **change.frontiers)
            cells.append(_cell(world, CHANGED_TEAM, method, exploring, seeds, change.settings, name))
    return trials_of(cells)


def _cell(
    world: str,
    robots: int,
    method: str,
    exploring: dict[str, Any],
    seeds: int,
    settings: dict[str, Any] | None = None,
    change: str | None = None,
    file: dict[str, Any] | None = None,
) -> Cell:
    """Return a cell; in a world file, if there is one, else over the model if that is its world."""
    run = Run(ExplorationConfig(**{"once": True, **exploring}), over_model=world == DEM and file is None)
    where = None if file is None else Surroundings(worlds=json.dumps({"world": file}))
    name, scenario = cell_id(world, robots, method, change), _scenario(world, robots, settings or {})
    return Cell(name, scenario, STRATEGY, seeds, run, where)


def _scenario(world: str, robots: int, settings: dict[str, Any]) -> Scenario:
    base = find_scenario("terrain" if world == DEM else world)
    scenario = with_settings(base, {**_ALL, "robots": robots})
    scenario = with_settings(scenario, _PLAN if world in PLANS else _TERRAIN)
    return with_settings(scenario, settings)
