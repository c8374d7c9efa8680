"""A mission above the cliff: which columns of its elevation map are known, scan by scan."""

from __future__ import annotations

import numpy as np

from baselines.experiments.mission import run_mission
from baselines.experiments.outcome import Record
from baselines.strategies import make_strategy
from baselines.strategies.next_best_view.plateau_rule import PlateauRule
from entropy_explore_env.belief.elevation import elevation_map
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.missions.view import view_of
from entropy_explore_env.reports.metrics import mission_figures
from entropy_explore_env.robots.motion import MoveEnd


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
    """(X, Y) bool, columns of the elevation map of the only rover that are known."""
    view = view_of(env.missions, 0, 0)
    scenario = view.scenario
    sigma_min = view.kind.sensor.sigma_min
    found = elevation_map(view.mean, view.precision, scenario.grid, scenario.sigma_prior, sigma_min)
    return found.known


def plateau_of(occupied: np.ndarray) -> np.ndarray:
    """(X, Y) bool, the highest columns of a world of columns (X, Y, Z)."""
    heights = occupied.sum(axis=2)
    return np.asarray(heights == heights.max())
