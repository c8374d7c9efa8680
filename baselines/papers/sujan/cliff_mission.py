"""A mission above the cliff, what is kept of it, and figures of its record."""

from __future__ import annotations

import math

import numpy as np

from baselines.experiments.experiment import Records
from baselines.experiments.mission import run_mission
from baselines.experiments.rows import Record
from baselines.strategies import make_strategy
from baselines.strategies.next_best_view.ground_map import measured
from baselines.strategies.next_best_view.plateau_rule import PlateauRule
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.missions.view import view_of
from entropy_explore_env.reports.metrics import mission_figures
from entropy_explore_env.robots.motion import MoveEnd
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.settings.scenarios import CLIFF

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
FEW, MORE = 10, 20
"""Steps after which the paper shows methods 5 and 3 (fig. 25)."""
START_M = (2.0625, 6.0625)
"""On the plateau, some 3 m from the edge."""


def cell_id(method: int) -> str:
    """Return the name of the cell of a method."""
    return f"cliff-{method}"


def scenario_of(steps: int) -> Scenario:
    """Return `cliff` for some steps after the first looks; a drive leads wherever the rover wants."""
    ending = {"max_cycles": LOOKS + steps, "time_limit_s": 1e6}
    return with_settings(CLIFF, {"robot": {"reach_m": math.inf}, "ending": ending})


def start_of(scenario: Scenario) -> list[float]:
    """Return the pose at which all missions start; map frame."""
    height_m = scenario.plane_m(0)
    assert height_m is not None  # rovers keep theirs
    return [*START_M, height_m, 0.0, 0.0]


def record_mapping(env: EntropyExploreEnv, strategy: str, seed: int) -> Record:
    """Run the mission.

    Returns:
        The mission's figures, and, before the first scan and after each, `columns`, how many columns are
        known, and `interest_unreadable` and `interest_readable`, the mean interest in those below the cliff
        (eq. 9); `expected` and `obtained`, new columns of each look that was chosen for its information;
        `edge_stops`, drives that the edge ended.
    """
    made = make_strategy(strategy)
    assert isinstance(made, PlateauRule)
    columns: list[int] = [0]
    interest: list[tuple[float, float]] = [(1.0, 1.0)]
    edge_stops = 0

    def note(env: EntropyExploreEnv) -> None:
        nonlocal edge_stops
        robot = env.missions.state.robots[0, 0]
        if robot["scans"] < len(columns):
            return
        edge_stops += int(robot["move_end"] == MoveEnd.EDGE.code)
        columns.append(int(known_columns(env).sum()))
        world = env.missions.worlds[0]
        assert world is not None and world.unreadable is not None
        dark, below = world.unreadable.any(axis=2), ~plateau_of(world.occupied)
        weights = made.ground_of(0).interest
        interest.append((float(weights[dark].mean()), float(weights[below & ~dark].mean())))

    run_mission(env, made, seed, note)
    return {
        **mission_figures(env.missions, 0),
        "columns": columns,
        "interest_unreadable": [round(dark, 5) for dark, _ in interest],
        "interest_readable": [round(lit, 5) for _, lit in interest],
        "expected": [round(look.expected, 2) for look in made.ground_of(0).looks],
        "obtained": [look.obtained for look in made.ground_of(0).looks],
        "edge_stops": edge_stops,
    }


def known_columns(env: EntropyExploreEnv) -> np.ndarray:
    """Return (X, Y) bool, columns of the elevation map of the only rover that are known."""
    return measured(view_of(env.missions, 0, 0)).known


def plateau_of(occupied: np.ndarray) -> np.ndarray:
    """Return (X, Y) bool, the highest columns of a world of columns (X, Y, Z)."""
    heights = occupied.sum(axis=2)
    return np.asarray(heights == heights.max())


def new_columns(records: Records, method: int) -> np.ndarray:
    """Return (N, STEPS + 1) columns mapped since the first looks, after each step; at its end it stays."""
    rows = []
    for record in records[cell_id(method)]:
        counts = np.asarray(record["columns"], float)[: LOOKS + STEPS + 1]
        counts = np.pad(counts, (0, LOOKS + STEPS + 1 - len(counts)), mode="edge")
        rows.append(counts[LOOKS:] - counts[LOOKS])
    return np.stack(rows)


def looks_of(records: Records, method: int, field: str, steps: int) -> np.ndarray:
    """Return (N, S) `expected` or `obtained` new columns of the first chosen looks; 0 past the last one."""
    rows = [np.asarray(record[field], float)[:steps] for record in records[cell_id(method)]]
    return np.stack([np.pad(row, (0, steps - len(row))) for row in rows])


def interest_in(records: Records, part: str, steps: int) -> np.ndarray:
    """Return method 5's (N,) mean interest in `unreadable` or `readable` columns below, after steps."""
    rows = [record[f"interest_{part}"] for record in records[cell_id(5)]]
    return np.array([row[min(LOOKS + steps, len(row) - 1)] for row in rows])


def steps_needed(records: Records) -> np.ndarray:
    """Return (N,) steps of method 5 until it has mapped what method 3 has after MORE, over MORE."""
    wanted = new_columns(records, 3)[:, MORE]
    reached = new_columns(records, 5) >= wanted[:, None]
    steps = np.where(reached.any(axis=1), reached.argmax(axis=1), STEPS)
    return np.asarray(steps / MORE)
