"""What strategies choose comes through the action space whole."""

from __future__ import annotations

import math

import numpy as np
import pytest

from baselines.strategies import STRATEGIES, make_strategy
from baselines.strategies.protocol import choose_all
from entropy_explore_env.missions.action import action_space, decode_action
from entropy_explore_env.missions.simulation import Missions
from entropy_explore_env.missions.view import view_of
from entropy_explore_env.settings.grid import Grid
from tests.reference.scenes import free_box, started

ROUNDING = 2.0**-22


def same_direction(first: np.ndarray, second: np.ndarray) -> bool:
    """Whether two gazes (yaw, pitch) are the same up to rounding."""
    turn = (first[0] - second[0] + math.pi) % (2 * math.pi) - math.pi
    return abs(turn) < 4 * ROUNDING and abs(first[1] - second[1]) < 4 * ROUNDING


def centre_offset(grid: Grid, place: np.ndarray) -> float:
    """How far a place (2,) or (3,) is from its voxel's centre, in voxels, along its worst axis."""
    voxels = (place - np.asarray(grid.origin_m)[: len(place)]) / grid.voxel_size_m
    return float(np.abs(voxels % 1.0 - 0.5).max())


def acted(missions: Missions, strategy_name: str, steps: int):
    """Run a strategy; yields of every choice the view, the viewpoint and what the action says."""
    scenario, rules = missions.scenario, missions.rules
    space = action_space(scenario)
    discrete = scenario.action.kind == "discrete"
    strategy = make_strategy(strategy_name)
    strategy.reset(scenario, missions.strategy_generator(0))
    robots = scenario.robots
    for _ in range(steps):
        boxes = np.zeros((1, robots, *(space.shape or (5,))))
        numbers = np.zeros((1, robots), np.int64)
        deciding = np.flatnonzero(missions.state.robots[0]["deciding"])
        views = [view_of(missions, 0, int(robot)) for robot in deciding]
        for robot, view, viewpoint in zip(deciding, views, choose_all(strategy, views), strict=True):
            action = view.action_for(viewpoint)
            assert space.contains(action)
            boxes[0, robot], numbers[0, robot] = (0.0, action) if discrete else (action, 0)
            meant = np.full(5, np.nan)
            decode_action(
                rules.params[robot],
                rules.actions,
                view.pose.copy(),
                boxes[0, robot],
                numbers[0, robot],
                meant,
            )
            yield view, viewpoint, meant
        missions.step(boxes, numbers)


SPACES = {
    "free": {},
    "planar": {"robot": {"motion": "planar"}},
    "flat": {"grid": Grid((9, 6, 1), 0.5, (-7.0, 3.0, 1.0))},
    "furnished": {"grid": Grid((14, 22, 10), 0.25, (1.0, -2.0, 0.3)), "world": "furnished"},
    "endless": {"robot": {"reach_m": math.inf}},
}


@pytest.mark.parametrize(
    ("strategy", "changes"),
    [pytest.param(name, SPACES[space], id=f"{name}-{space}") for name in STRATEGIES for space in SPACES],
)
def test_viewpoints_come_through_continuous_actions_up_to_rounding(strategy, changes):
    missions = started(free_box(robots=2, **changes), seed=3)
    reach_m = min(missions.scenario.robot.reach_m, float(missions.grid.size_m.max()))
    for _, viewpoint, meant in acted(missions, strategy, 60):
        assert meant[:3] == pytest.approx(viewpoint[:3], abs=ROUNDING * reach_m)
        assert same_direction(meant[3:], viewpoint[3:])


@pytest.mark.parametrize("space", [space for space in SPACES if space != "endless"])
def test_the_gradient_s_voxels_come_through_discrete_actions_exactly(space):
    """From the centre of a voxel to that of another within reach."""
    missions = started(free_box(robots=1, action={"kind": "discrete"}, **SPACES[space]), seed=3)
    axes, compared = (2 if missions.scenario.planar else 3), 0
    for view, viewpoint, meant in acted(missions, "gradient", 60):
        places = (view.pose[:axes], viewpoint[:axes])
        if all(centre_offset(missions.grid, place) < 1e-9 for place in places):  # else it wanders
            compared += 1
            assert meant[:3] == pytest.approx(viewpoint[:3], abs=1e-12)
    assert compared > 30
