"""The strategy `gradient`: where it goes and looks, when it wanders, and what it reads."""

from __future__ import annotations

import numpy as np
import pytest

from baselines.strategies.protocol import random_viewpoint
from baselines.strategies.rules.gradient import GradientStrategy
from entropy_explore_env.missions.view import RobotView, view_of
from entropy_explore_env.robots.motion import MoveEnd
from entropy_explore_env.settings.grid import Grid
from tests.reference import rocha04
from tests.reference.scenes import (
    as_reference,
    free_box,
    put,
    random_belief,
    started,
    wander,
)
from tests.viewpoints.test_gradient_candidates import MIDDLE, SIZE, peak, steepest

POSE = (1.75, 2.75, 1.25, 0.4, -0.3)
"""The middle of the tiny box in metres, and a gaze."""


def prepared(scenario, field=None, seed=0):
    """Missions, robot 0 in the middle of the tiny box with this belief."""
    missions = started(scenario, seed)
    put(missions, 0, POSE if not scenario.planar else (*POSE[:4], 0.0))
    if field is not None:
        missions.mean[0, 0], missions.precision[0, 0] = field
    return missions


def chosen(view: RobotView, seed=3, motion_plane=None):
    strategy = GradientStrategy(motion_plane)
    strategy.reset(view.scenario, np.random.default_rng(seed))
    viewpoint = strategy.choose(view)
    return viewpoint


def test_the_strategy_goes_where_it_is_steep_in_metres_of_the_map():
    grid = Grid(SIZE, 0.5, (-4.0, 1.5, 0.25))
    missions = started(free_box(robots=1, grid=grid))
    put(missions, 0, (*(np.asarray(POSE[:3]) + grid.origin_m), 0.4, -0.3))
    mean, precision = random_belief(SIZE, 5)
    missions.mean[0, 0], missions.precision[0, 0] = mean, precision
    best = rocha04.choose(as_reference(mean, precision), MIDDLE, 2.0, SIZE)[0]  # reach 1 m
    viewpoint = chosen(view_of(missions, 0, 0))
    assert viewpoint[:3] == pytest.approx(grid.centre_of(np.asarray(best.voxel)))
    assert rocha04.gaze(*viewpoint[3:]) == pytest.approx(best.gaze, abs=1e-4)


@pytest.mark.parametrize("motion", ["free", "planar"])
def test_it_wanders_where_nothing_is_steep(motion):
    missions = prepared(free_box(robots=1, robot={"motion": motion}))
    view = view_of(missions, 0, 0)
    assert chosen(view).tolist() == random_viewpoint(view, np.random.default_rng(3)).tolist()
    missions.precision[0, 0, 3, 5, 2] /= 4.0
    assert chosen(view).tolist() != random_viewpoint(view, np.random.default_rng(3)).tolist()


@pytest.mark.parametrize("end", MoveEnd)
def test_it_wanders_after_a_move_that_was_blocked(end):
    missions = prepared(free_box(robots=1), peak((4, 5, 2)))
    missions.state.robots[0, 0]["move_end"] = end.code
    view = view_of(missions, 0, 0)
    wanders = chosen(view).tolist() == random_viewpoint(view, np.random.default_rng(3)).tolist()
    assert wanders == (end not in (MoveEnd.ARRIVED, MoveEnd.UNDER_WAY))


def test_free_robots_take_the_field_and_planar_ones_its_projection_unless_told():
    field = random_belief(SIZE, 11)
    for motion, motion_plane, projected in (
        ("free", None, False),
        ("free", True, True),
        ("planar", None, True),
        ("planar", False, False),
    ):
        view = view_of(prepared(free_box(robots=1, robot={"motion": motion}), field), 0, 0)
        expected = steepest(*field, MIDDLE, 2.0, *view.pose[3:], projected)
        viewpoint = chosen(view, motion_plane=motion_plane)
        assert expected is not None
        assert np.floor(viewpoint[:2] / 0.5).tolist() == list(expected[0][:2])
        assert viewpoint[3] == pytest.approx(expected[1][0])


@pytest.mark.parametrize("motion_plane", [None, False])
@pytest.mark.parametrize("changes", [{"robot": {"motion": "planar"}}, {"grid": Grid((9, 6, 1), 0.5)}])
def test_planar_robots_stay_level_and_in_their_plane(changes, motion_plane):
    missions = started(free_box(robots=2, **changes), seed=1)
    strategy = GradientStrategy(motion_plane)
    strategy.reset(missions.scenario, np.random.default_rng(0))
    height = missions.state.robots[0]["goal"][0, 2]
    steep = 0
    for _ in range(40):
        boxes = np.zeros((1, 2, 3))
        for robot in np.flatnonzero(missions.state.robots[0]["deciding"]):
            view = view_of(missions, 0, int(robot))
            viewpoint = strategy.choose(view)
            assert (viewpoint[2], viewpoint[4]) == (height, 0.0)
            steep += view.move_end is MoveEnd.ARRIVED
            boxes[0, robot] = view.action_for(viewpoint)
        missions.step(boxes, np.zeros((1, 2), np.int64))
    assert steep > 20
    assert (missions.state.robots[0]["goal"][:, 2] == height).all()
    assert (missions.state.robots[0]["goal"][:, 4] == 0.0).all()


def test_what_a_robot_cannot_know_does_not_change_its_choice():
    missions = started(free_box(robots=2, world="furnished"), seed=2)
    wander(missions, 20, 0)
    missions.state.robots[0]["move_end"] = MoveEnd.ARRIVED.code
    before = chosen(view_of(missions, 0, 0))
    rng = np.random.default_rng(0)
    missions.state.truth[:] = rng.random(missions.state.truth.shape) < 0.5
    missions.mean[0, 1], missions.precision[0, 1] = random_belief(SIZE, 1)
    missions.state.robots[0, 1]["goal"][:3] = (0.3, 0.3, 0.3)
    assert chosen(view_of(missions, 0, 0)).tolist() == before.tolist()
    missions.mean[0, 0], missions.precision[0, 0] = random_belief(SIZE, 1)
    assert chosen(view_of(missions, 0, 0)).tolist() != before.tolist()


def test_reach_in_metres_is_not_lost_to_rounding():
    """0.3 m over voxels of 0.1 m is 2.9999999999999996 voxels: the third voxel is within reach."""
    missions = started(free_box(robots=1, grid=Grid(SIZE, 0.1), robot={"reach_m": 0.3, "body_radius_m": 0.0}))
    put(missions, 0, (0.35, 0.55, 0.25, 0.0, 0.0))
    missions.precision[0, 0] = peak((6, 5, 2))[1]
    missions.state.mean[0, 0] = 0.0
    viewpoint = chosen(view_of(missions, 0, 0))
    assert viewpoint[:3] == pytest.approx((0.65, 0.55, 0.25))
