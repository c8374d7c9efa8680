"""The strategy `gradient`: its choice by the equations and by hand, when it wanders, and what it reads."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from baselines.strategies.protocol import random_viewpoint
from baselines.strategies.rules import gradient
from baselines.strategies.rules.gradient import GradientStrategy
from entropy_explore_env.missions.view import RobotView, read_only, view_of
from entropy_explore_env.robots.motion import MoveEnd
from entropy_explore_env.settings.grid import Grid
from tests.reference import rocha04
from tests.reference.scenes import (
    SHAPES,
    as_reference,
    drawn,
    free_box,
    put,
    random_belief,
    seeds,
    started,
    wander,
)

SIZE = (7, 11, 5)
MIDDLE = (3.5, 5.5, 2.5)
POSE = (1.75, 2.75, 1.25, 0.4, -0.3)
"""The middle of the tiny box in metres, and a gaze."""


def steepest(mean, precision, position, reach, yaw=0.0, pitch=0.0, projected=False):
    """The chosen voxel and gaze (yaw, pitch), or None where there is no choice."""
    arrays = (read_only(np.ascontiguousarray(a, np.float32)) for a in (mean, precision))
    place, gaze = np.asarray(position, np.float64), np.array([yaw, pitch])
    found = gradient.steepest(*arrays, place, gaze, float(reach), projected)
    if found is None:
        return None
    voxel = np.floor(found[0])
    np.testing.assert_array_equal(found[0], voxel + 0.5)
    return tuple(voxel.astype(int).tolist()), found[1]


def slope(along_x=0.0, along_y=0.0, along_z=0.0, size=SIZE):
    """Mean and precision of a field whose entropy rises by these bits a voxel along the axes."""
    x, y, z = np.ogrid[tuple(slice(n) for n in size)]
    return np.zeros(size), 4.0 ** -(along_x * x + along_y * y + along_z * z)


def peak(voxel, size=SIZE, bits=3.0):
    """Mean and precision of a field that is flat but for one voxel, unknown by some bits more."""
    precision = np.ones(size)
    precision[voxel] = 4.0**-bits
    return np.zeros(size), precision


# --- the choice


@drawn(80)
@given(st.sampled_from(SHAPES), seeds, st.integers(0, 9), st.booleans(), st.booleans())
def test_the_choice_is_that_of_the_equations_up_to_the_edge_of_reach(size, seed, squared, projected, centred):
    """Reach √n: from the centre of a voxel, other centres lie exactly on the edge."""
    rng = np.random.default_rng(seed)
    mean, precision = random_belief(size, seed)
    position = rng.integers(0, size) + (0.5 if centred else rng.uniform(0.05, 0.95, 3))
    yaw, pitch = rng.uniform(-math.pi, math.pi), rng.choice([0.0, rng.uniform(-1.5, 1.5)])
    axes = rocha04.motion_axes(yaw, pitch) if projected else None
    reach = math.sqrt(squared)
    ranked = rocha04.choose(as_reference(mean, precision), position.tolist(), reach * (1 + 1e-9), size, axes)
    found = steepest(mean, precision, position, reach, yaw, pitch, projected)
    best = ranked[0].score if ranked else 0.0
    if best < 1e-9:  # nought, up to rounding
        assert found is None or best > 0.0
        return
    assert found is not None
    choice = next(choice for choice in ranked if choice.voxel == found[0])
    assert choice.score == pytest.approx(best, rel=1e-5)
    assert choice.gaze is not None
    assert rocha04.gaze(*found[1]) == pytest.approx(choice.gaze, abs=2e-4)


@pytest.mark.parametrize("reach", [1.0, 2.0, 3.2, 20.0])
@pytest.mark.parametrize("along", [(1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, 2.0), (1.0, 1.0, -1.0)])
def test_of_equal_voxels_the_first_in_c_order_is_taken(reach, along):
    found = steepest(*slope(*along), MIDDLE, reach)
    steep = [
        voxel
        for voxel in rocha04.candidates(MIDDLE, reach, SIZE)
        if all(index > 0 for index, part in zip(voxel, along, strict=True) if part)
    ]
    assert found is not None and found[0] == steep[0]


# --- the gaze: p̂ = [cosθ cosφ, sinθ cosφ, -sinφ], yaw counter-clockwise, pitch downwards


@pytest.mark.parametrize(
    ("along", "gaze"),
    [
        ((1, 0, 0), (0.0, 0.0)),
        ((-1, 0, 0), (math.pi, 0.0)),
        ((0, 1, 0), (math.pi / 2, 0.0)),
        ((0, -1, 0), (-math.pi / 2, 0.0)),
        ((1, 1, 0), (math.pi / 4, 0.0)),
        ((-1, 1, 0), (3 * math.pi / 4, 0.0)),
        ((1, 0, 1), (0.0, -math.pi / 4)),
        ((0, 1, -1), (math.pi / 2, math.pi / 4)),
        ((0, 0, 1), (0.4, -math.pi / 2)),
        ((0, 0, -1), (0.4, math.pi / 2)),
    ],
)
def test_it_looks_uphill_and_keeps_its_yaw_where_uphill_is_straight_up_or_down(along, gaze):
    found = steepest(*slope(*along), MIDDLE, 1.0, yaw=0.4, pitch=-0.3)
    assert found is not None and found[1] == pytest.approx(gaze, abs=1e-6)


# --- the motion plane


def test_a_level_plane_sees_no_vertical_gradient():
    assert steepest(*slope(0.0, 0.0, 1.0), MIDDLE, 2.0, yaw=1.0, projected=True) is None
    found = steepest(*slope(0.0, 1.0, 5.0), MIDDLE, 1.0, yaw=1.0, projected=True)
    assert found is not None and found[1] == pytest.approx((math.pi / 2, 0.0), abs=1e-6)


@pytest.mark.parametrize("yaw", [0.0, 0.7, -2.0])
def test_a_robot_that_looks_straight_up_moves_up_and_sidewards(yaw):
    """Its plane is spanned by z and its left: of a gradient straight ahead nothing is left."""
    ahead, left = (math.cos(yaw), math.sin(yaw), 0.0), (-math.sin(yaw), math.cos(yaw), 0.0)
    found = steepest(*slope(*left), MIDDLE, 1.0, yaw, -math.pi / 2, projected=True)
    assert found is not None and rocha04.gaze(*found[1]) == pytest.approx(left, abs=1e-5)
    found = steepest(*slope(ahead[0], ahead[1], 1.0), MIDDLE, 1.0, yaw, -math.pi / 2, projected=True)
    assert found is not None and rocha04.gaze(*found[1]) == pytest.approx((0, 0, 1), abs=1e-5)


# --- the strategy


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
