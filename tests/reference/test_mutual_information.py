"""The strategy `mutual-information` against the slow reference of eq. 13."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from baselines.strategies.neighbourhood import (
    INTERFERENCE,
    MATE,
    Body,
    Factors,
    Team,
    best_candidate,
)
from entropy_explore_env.belief.fields import Belief
from entropy_explore_env.belief.visibility import CONE, cone_of, mark_cones
from entropy_explore_env.viewpoints.gradient_candidates import gradient_candidates
from tests.reference import rochami
from tests.reference.scenes import as_reference, drawn, random_belief, ray_space, seeds

SIZE = (7, 11, 5)
OUR_BALL = np.zeros((1, 3), np.int64)
"""A body that touches only the voxel it is in."""


def ours(belief, position, radius, cone, mates, weights, planar):
    """Candidates, and which is the best."""
    mean, precision = belief
    layer = int(position[2]) if planar else None
    known = weights.sigma_known**-2
    candidates = gradient_candidates(precision, known, np.asarray(position), radius, layer)
    marks = np.zeros(mean.size, np.uint8)
    heard = np.zeros(len(mates), MATE)
    for place, mate in enumerate(mates):
        heard[place]["begin"], heard[place]["end"] = mate.begin, mate.end
        heard[place]["touching"] = weights.touching
        if mate.cone is not None:
            c = mate.cone
            cone_of_mate = _cone(c.apex, c.yaw, c.pitch, c.radius, c.half_angle)
            mark_cones(np.array([cone_of_mate], CONE), SIZE, marks)
    if len(candidates) == 0:
        return candidates, -1
    assert weights.interference == INTERFERENCE or not mates
    factors = Factors(weights.kappa, weights.scale_bits, known)
    most = candidates["steepness"] / candidates["steepness"].max()
    most = most - weights.kappa * candidates["distance"] / radius
    order = np.argsort(-most, kind="stable")
    own = _cone((0.0, 0.0, 0.0), 0.0, 0.0, *cone)
    best = best_candidate(
        candidates,
        order,
        Belief(mean.ravel(), precision.ravel(), SIZE),
        Body(tuple(map(float, position)), radius, 0.0, OUR_BALL, ray_space(SIZE, behind=1)),
        Team(heard, marks),
        own,
        factors,
    )
    return candidates, best


def _cone(apex, yaw, pitch, radius, half_angle):
    cones = np.zeros(1, CONE)
    cones[0] = cone_of(np.array([*apex, yaw, pitch]), radius, half_angle)
    return cones[0]


@drawn(15)
@given(seeds, st.booleans(), st.integers(0, 3), st.sampled_from([0.0, 0.2, 1.0]))
def test_the_choice_is_the_best_of_equation_13(seed, planar, teammates, kappa):
    rng = np.random.default_rng(seed)
    mean, precision = random_belief(SIZE, seed)
    mean[:] = np.where(rng.random(SIZE) < 0.15, 0.9, 0.5 * rng.random(SIZE))
    position = rng.uniform(0.3, np.array(SIZE) - 0.3)
    beliefs = as_reference(mean, precision)
    mates = [
        rochami.Mate(
            rng.uniform(0, SIZE),
            end := rng.uniform(0, SIZE),
            rochami.Cone(
                end,
                rng.uniform(-3, 3),
                0.0 if planar else rng.uniform(-1, 1),
                rng.uniform(1, 5),
                rng.uniform(0.2, 1.5),
            ),
        )
        for _ in range(teammates)
    ]
    cone = (rng.uniform(1.0, 5.0), rng.uniform(0.2, 1.5))
    weights = rochami.Weights(kappa, 40.0, 0.5, 0.05, 0.6)
    radius = rng.uniform(1.0, 4.0)
    values = rochami.values(beliefs, SIZE, position, radius, cone, mates, weights, planar)
    candidates, best = ours((mean, precision), position, radius, cone, mates, weights, planar)
    if best < 0:
        assert not values
        return
    chosen = candidates[best]
    voxel = tuple(int(x) for x in chosen["place"])
    assert values[voxel] == pytest.approx(max(values.values()), abs=1e-6)
    slope = rochami.bounded_gradient(beliefs, voxel, 0.05, planar)
    gaze = np.array(rochami.rocha04.gaze(chosen["yaw"], chosen["pitch"]))
    assert gaze * math.hypot(*slope) == pytest.approx(slope, abs=1e-5)  # eq. 11
