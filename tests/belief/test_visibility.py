"""Cones of view and what they cover, against the slow reference and by hand."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from entropy_explore_env.belief.visibility import (
    CONE,
    cone_of,
    in_cone,
    mark_cones,
    visible_bits,
)
from entropy_explore_env.compilation.kernels import lean_kernel
from tests.reference import rochami
from tests.reference.scenes import (
    as_reference,
    drawn,
    random_belief,
    random_cover,
    seeds,
)

SIZE = (7, 11, 5)
NO_CONES = np.zeros(0, CONE)


@lean_kernel
def inside(cones, x, y, z):
    for cone in cones:
        if in_cone(cone, x - cone.apex[0], y - cone.apex[1], z - cone.apex[2]):
            return True
    return False


def test_cones_by_hand():
    cones = np.array([cone_of(np.array([1.0, 2.0, 3.0, math.pi / 2, 0.0]), 4.0, math.radians(30.0))])
    assert cones[0]["gaze"] == pytest.approx((0.0, 1.0, 0.0))
    for point, is_in in (
        ((1.0, 5.9, 3.0), True),
        ((1.0, 6.1, 3.0), False),  # too far
        ((1.0, 1.9, 3.0), False),  # behind
        ((2.0, 2.0 + math.sqrt(3.0) + 1e-6, 3.0), True),  # 30° aside
        ((2.0, 2.0 + math.sqrt(3.0) - 1e-3, 3.0), False),
        ((1.0, 3.0, 3.5), True),
        ((1.0, 3.0, 3.6), False),
        ((1.0, 2.0, 3.0), True),  # the apex
    ):
        assert inside(cones, *point) is is_in, point
    assert not inside(NO_CONES, 1.0, 2.0, 3.0)


@pytest.mark.parametrize("side", [1, -1])
def test_a_cone_that_is_wide_around_the_vertical_by_hand(side):
    """50° up or down from the middle of layer 2, ±80°: 30° beyond the level ahead, above 50° behind."""
    apex = (1.5, 5.5, 2.5, 0.0, -side * math.radians(50.0))
    cones = np.array([cone_of(np.array(apex), math.inf, math.radians(80.0))])
    marks = np.zeros(math.prod(SIZE), np.uint8)
    mark_cones(cones, SIZE, marks)
    columns = marks.reshape(SIZE)[:, 5]
    lowest = (2, 0, 0, -1, -1, -2, -2)  # above 1.2; the apex; above -0.6, -1.2, -1.7, -2.3 and -2.9
    for x, low in enumerate(lowest):
        assert columns[x].astype(bool).tolist() == [low <= side * layer for layer in range(-2, 3)], x


# --- What cones cover (RochaMI, eqs. 5 and 7-10)

KNOWN = 0.05**-2


def marked_bits(precision, marks):
    """Entropy that the marked voxels cover together (RochaMI, eq. 9)."""
    ratios = KNOWN / precision[marks > 0].astype(float)
    return 0.5 * np.log2(np.maximum(ratios, 1.0)).sum()


def covered(cones, belief, size=SIZE):
    """H(C⁰), I(C⁰; T⁰), H(T⁰), H(T) and the marks of all cones, the first of which is the robot's own."""
    mean, precision = belief[0].ravel(), belief[1].ravel()
    mine = np.array([cone_of(np.array([*c.apex, c.yaw, c.pitch]), c.radius, c.half_angle) for c in cones])
    marks = np.zeros(mean.size, np.uint8)
    mark_cones(mine[1:], size, marks)
    team = marked_bits(precision, marks)
    own, shared = visible_bits(mine[0], size, precision, KNOWN, marks)
    mark_cones(mine[:1], size, marks)
    return own, shared, team, marked_bits(precision, marks), marks


def random_cone(rng, size=SIZE):
    wide = rng.choice([rng.uniform(0.05, math.pi / 2), math.pi / 2, rng.uniform(0.05, math.pi), 0.0])
    return rochami.Cone(
        rng.uniform(-1.0, np.array(size) + 1.0),
        rng.uniform(-math.pi, math.pi),
        rng.choice([0.0, math.pi / 2, -math.pi / 2, rng.uniform(-1.5, 1.5)]),
        rng.choice([rng.uniform(0.0, 3.0), rng.uniform(0.0, 12.0), math.inf]),
        wide,
    )


def on_a_face(cone, voxel, margin=1e-6):
    """Whether rounding decides whether a voxel's centre is in a cone."""
    bigger, smaller = (
        cone._replace(radius=cone.radius + sign * margin, half_angle=cone.half_angle + sign * margin)
        for sign in (1, -1)
    )
    return rochami.inside(bigger, voxel) != rochami.inside(smaller, voxel)


@drawn(120)
@given(seeds)
def test_a_cone_marks_the_voxels_of_the_reference(seed):
    rng = np.random.default_rng(seed)
    size = SIZE if seed % 3 else (9, 6, 1)
    belief = random_belief(size, seed)
    cone = random_cone(rng, size)
    marks = covered([cone], belief, size=size)[-1]
    for number, voxel in enumerate(np.ndindex(*size)):
        if not on_a_face(cone, voxel):
            assert marks[number] == rochami.inside(cone, voxel), (cone, voxel)


@drawn(25)
@given(seeds, st.integers(1, 4))
def test_entropies_and_mutual_information_are_those_of_the_reference(seed, teammates):
    rng = np.random.default_rng(seed)
    belief = random_belief(SIZE, seed)
    belief[0][:] = random_cover(SIZE, 0.15, seed)
    cones = [random_cone(rng) for _ in range(1 + teammates)]
    inner = [c._replace(apex=rng.uniform(0.1, np.array(SIZE) - 0.1)) for c in cones]
    beliefs = as_reference(*belief)
    if any(on_a_face(cone, voxel) for cone in inner for voxel in beliefs):
        return
    seen = [rochami.visible(cone, beliefs) for cone in inner]
    others = set().union(*seen[1:])
    own, shared, team, everybody, _ = covered(inner, belief)
    sigma = KNOWN**-0.5
    assert own == pytest.approx(rochami.covered_bits(seen[0], beliefs, sigma), rel=1e-6, abs=1e-9)
    assert shared == pytest.approx(rochami.covered_bits(seen[0] & others, beliefs, sigma), rel=1e-6, abs=1e-9)
    assert team == pytest.approx(rochami.covered_bits(others, beliefs, sigma), rel=1e-6, abs=1e-9)
    assert everybody == pytest.approx(own + team - shared, rel=1e-6, abs=1e-9)  # eq. 10
    assert 0.0 <= shared <= min(own, team) + 1e-9


def test_overlap_of_known_voxels_is_not_attractive():
    """Voxels better known than σ_known have a negative differential entropy; the overlap counts 0."""
    belief = np.zeros(SIZE, np.float32), np.full(SIZE, 4.0 * KNOWN, np.float32)
    cone = rochami.Cone((3.5, 5.5, 2.5), 0.3, 0.1, 4.0, 0.8)
    assert covered([cone, cone], belief)[:4] == (0.0, 0.0, 0.0, 0.0)
    belief[1][3, 5, 2] = KNOWN / 16.0  # its own voxel: ½ log2 16 = 2 bits
    assert covered([cone, cone], belief)[:4] == pytest.approx((2.0, 2.0, 2.0, 2.0))
    away = cone._replace(yaw=0.3 + math.pi, pitch=-0.1, apex=(6.5, 9.5, 2.5))
    assert covered([cone, away], belief)[:4] == pytest.approx((2.0, 0.0, 0.0, 2.0))


def test_bits_of_many_voxels_of_which_little_is_known_are_summed_without_overflow():
    """Each voxel brings ½ log2 10³⁰ bits; the product of all 385 ratios is no float64."""
    everywhere = cone_of(np.array([3.5, 5.5, 2.5, 0.0, 0.0]), 20.0, math.pi)
    precision, marks = np.full(SIZE, 1e-30, np.float32).ravel(), np.zeros(385, np.uint8)
    marks[::7] = 1
    bits = 0.5 * math.log2(1e30)
    told = visible_bits(np.array([everywhere])[0], SIZE, precision, 1.0, marks)
    assert told == pytest.approx((385 * bits, 55 * bits), rel=1e-6)
