"""The steepest voxel within reach: by the equations, and by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from baselines.strategies.rules import gradient
from entropy_explore_env.belief.fields import entropy_gradient
from entropy_explore_env.missions.view import read_only
from tests.reference import rocha04
from tests.reference.scenes import (
    SHAPES,
    as_reference,
    drawn,
    random_belief,
    seeds,
)

SIZE = (7, 11, 5)
MIDDLE = (3.5, 5.5, 2.5)


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


# --- the field


@drawn(20)
@given(st.sampled_from(SHAPES), seeds)
def test_the_gradient_adds_up_to_the_difference_of_entropies_and_is_nought_at_the_first_voxels(size, seed):
    _, precision = random_belief(size, seed)
    voxel_size_m = 0.3
    field = np.array([entropy_gradient(precision, *voxel, voxel_size_m) for voxel in np.ndindex(*size)])
    field = field.reshape(*size, 3)
    entropy = np.array([rocha04.entropy_bits(p**-0.5) for p in precision.astype(float).ravel()]).reshape(size)
    for axis in range(3):
        along, bits = np.moveaxis(field[..., axis], axis, 0), np.moveaxis(entropy, axis, 0)
        assert (along[0] == 0.0).all()
        np.testing.assert_allclose(along.sum(axis=0) * voxel_size_m, bits[-1] - bits[0], atol=1e-4)


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


@pytest.mark.parametrize(
    "offset", [(2, 0, 0), (-2, 0, 0), (0, 2, 0), (0, -2, 0), (0, 0, 2), (0, 0, -2), (1, -2, 2)]
)
def test_a_voxel_at_the_edge_of_reach_is_a_candidate_and_one_beyond_is_not(offset):
    target = tuple(int(at + step) for at, step in zip(MIDDLE, offset, strict=True))
    field, away = peak(target), math.hypot(*offset)
    for reach in (away, away * (1 - 1e-7), away + 0.3):
        found = steepest(*field, MIDDLE, reach)
        assert found is not None and found[0] == target
    found = steepest(*field, MIDDLE, away * (1 - 1e-3))
    assert found is None or found[0] != target


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
