"""Viewpoints drawn within reach fill it evenly, and the workspace where it is longer."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats

from baselines.strategies.protocol import random_viewpoint
from entropy_explore_env.missions.view import RobotView, view_of
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.scenario import Scenario
from tests.reference.scenes import free_box, put, started

HALL = Grid((21, 33, 17), 0.5, (-3.0, 2.0, 0.5))
DRAWS = 3000
ALPHA = 1e-3
"""The draws are always the same: a test below this level means that the rule changed."""


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
