"""The strategy `random`, and that what strategies choose comes through the action space whole."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats

from baselines.strategies import STRATEGIES, make_strategy
from baselines.strategies.protocol import choose_all, random_viewpoint
from baselines.strategies.rules.random_walk import RandomWalk
from entropy_explore_env.errors import SettingError
from entropy_explore_env.missions.action import action_space, decode_action
from entropy_explore_env.missions.simulation import Missions
from entropy_explore_env.missions.view import RobotView, view_of
from entropy_explore_env.scenario import Scenario
from entropy_explore_env.settings import Grid
from tests.reference.scenes import free_box, put, started

HALL = Grid((21, 33, 17), 0.5, (-3.0, 2.0, 0.5))
DRAWS = 3000
ALPHA = 1e-3
"""The draws are always the same: a test below this level means that the rule changed."""
ROUNDING = 2.0**-22


def view_in(scenario: Scenario, pose) -> RobotView:
    missions = started(scenario)
    put(missions, 0, pose)
    return view_of(missions, 0, 0)


def many(view: RobotView, draws: int = DRAWS) -> np.ndarray:
    rng = np.random.default_rng(1)
    return np.stack([random_viewpoint(view, rng) for _ in range(draws)])


def is_uniform(values: np.ndarray, low: float, high: float) -> bool:
    assert values.min() >= low and values.max() <= high
    return stats.kstest((values - low) / (high - low), "uniform").pvalue > ALPHA


def test_viewpoints_fill_the_ball_of_reach_and_gazes_the_sphere():
    pose = np.array([2.0, 10.0, 4.5, 1.0, 0.2])
    drawn = many(view_in(free_box(robots=1, grid=HALL, robot={"reach_m": 1.5}), pose))
    way = drawn[:, :3] - pose[:3]
    length = np.linalg.norm(way, axis=1)
    assert is_uniform((length / 1.5) ** 3, 0.0, 1.0)
    assert is_uniform(way[:, 2] / length, -1.0, 1.0)
    assert is_uniform(np.arctan2(way[:, 1], way[:, 0]), -math.pi, math.pi)
    assert is_uniform(drawn[:, 3], -math.pi, math.pi)
    assert is_uniform(np.sin(drawn[:, 4]), -1.0, 1.0)
    assert np.abs(np.corrcoef(np.column_stack([way, drawn[:, 3:]]).T) - np.eye(5)).max() < 0.07


@pytest.mark.parametrize(
    ("grid", "motion"), [(HALL, "planar"), (Grid((21, 33, 1), 0.5, (-3.0, 2.0, 0.5)), "free")]
)
def test_planar_robots_fill_the_disc_and_look_level(grid, motion):
    height = 1.25 if motion == "planar" else 0.75
    pose = np.array([2.0, 10.0, height, 1.0, 0.0])
    scenario = free_box(
        robots=1, grid=grid, robot={"reach_m": 1.5, "motion": motion, "sensor_height_m": 0.75}
    )
    drawn = many(view_in(scenario, pose))
    way = drawn[:, :2] - pose[:2]
    assert is_uniform((np.linalg.norm(way, axis=1) / 1.5) ** 2, 0.0, 1.0)
    assert is_uniform(np.arctan2(way[:, 1], way[:, 0]), -math.pi, math.pi)
    assert is_uniform(drawn[:, 3], -math.pi, math.pi)
    assert (drawn[:, 2] == height).all() and (drawn[:, 4] == 0.0).all()


def test_next_to_walls_viewpoints_stay_inside_and_fill_what_is_left_of_the_ball():
    corner = np.add(HALL.origin_m, (0.25, 0.25, 3.0))
    pose = np.array([*corner, 0.0, 0.0])
    drawn = many(view_in(free_box(robots=1, grid=HALL, robot={"reach_m": 1.0}), pose))
    way = drawn[:, :3] - corner
    assert (way[:, :2] > -0.25).all() and (np.linalg.norm(way, axis=1) <= 1.0).all()
    ball = np.random.default_rng(2).uniform(-1.0, 1.0, (200_000, 3))
    ball = ball[((ball**2).sum(axis=1) <= 1.0) & (ball[:, :2] > -0.25).all(axis=1)]
    for axis in range(3):
        assert float(stats.ks_2samp(way[:, axis], ball[:, axis])[1]) > ALPHA  # type: ignore[arg-type]


def test_where_reach_is_infinite_viewpoints_fill_the_workspace():
    """Actions say places from the first voxel's centre to the last one's: between these they are uniform."""
    drawn = many(view_in(free_box(robots=1, grid=HALL, robot={"reach_m": math.inf}), (2.0, 10.0, 4.5, 0, 0)))
    low, high = np.asarray(HALL.origin_m), np.asarray(HALL.origin_m) + HALL.size_m
    assert ((drawn[:, :3] > low) & (drawn[:, :3] < high)).all()
    between = drawn[((drawn[:, :3] >= low + 0.25) & (drawn[:, :3] <= high - 0.25)).all(axis=1)]
    for axis in range(3):
        assert is_uniform(between[:, axis], low[axis] + 0.25, high[axis] - 0.25)


@pytest.mark.parametrize("reach_m", [20.0, 200.0])
def test_a_reach_longer_than_the_workspace_fills_it_too(reach_m):
    view = view_in(free_box(robots=1, robot={"reach_m": reach_m}), (1.75, 2.75, 1.25, 0.0, 0.0))
    drawn = many(view, 500)
    for axis, width in enumerate((3.5, 5.5, 2.5)):
        assert is_uniform(drawn[:, axis], 0.0, width)


def test_each_view_gets_a_viewpoint_of_its_own_from_the_stream():
    missions = started(free_box(robots=3))
    views = [view_of(missions, 0, robot) for robot in range(3)]
    walk = RandomWalk()
    walk.reset(missions.scenario, np.random.default_rng(4))
    ours, rng = [walk.choose(view) for view in views], np.random.default_rng(4)
    assert [a.tolist() for a in ours] == [random_viewpoint(view, rng).tolist() for view in views]
    walk.reset(missions.scenario, np.random.default_rng(4))
    assert [walk.choose(view).tolist() for view in views[:2]] == [a.tolist() for a in ours[:2]]


def test_strategies_by_name():
    assert {"random", "gradient"} <= set(STRATEGIES)
    for name in STRATEGIES:
        assert callable(make_strategy(name).choose)
        assert make_strategy(name) is not make_strategy(name)
    with pytest.raises(SettingError, match=r"strategy = 'dance'.*random"):
        make_strategy("dance")


# --- through the action space


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
                rules.params[robot], rules.actions, view.pose, boxes[0, robot], numbers[0, robot], meant
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
