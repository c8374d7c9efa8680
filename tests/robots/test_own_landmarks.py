"""Landmarks of a robot's own map: eq. 17, and what sighting them again says, beside slow references."""

import math

import numpy as np
import pytest
from hypothesis import given

from entropy_explore_env.belief.fields import Belief, occupancy_probability
from entropy_explore_env.missions.landmarks import landmark_score
from entropy_explore_env.robots.landmarks import (
    LANDMARK,
    added_since,
    correct_by_landmark,
    foresee_landmark,
    is_covariance,
)
from entropy_explore_env.robots.localization import ESTIMATE
from tests.reference import localization as reference
from tests.reference.scenes import drawn, seeds
from tests.robots.test_pose_estimates import random_covariance

PRIOR = np.float32(30.0**-2)
KNOWN = np.float32(400.0)
SIGMAS = (0.05, 0.02)


def plan(*rows):
    """Mean and precision of a plan: # covered, . free, a space unknown."""
    cells = np.array([list(row) for row in rows])[:, :, None]
    mean = np.where(cells == "#", 1.0, np.where(cells == ".", 0.0, 0.5)).astype(np.float32)
    return mean, np.where(cells == " ", PRIOR, KNOWN).astype(np.float32)


def score(mean, precision, voxel):
    belief = Belief(mean.ravel(), precision.ravel(), mean.shape)
    return landmark_score(belief, PRIOR, np.int64(np.ravel_multi_index(voxel, mean.shape)))


POST = ["........."] * 4 + ["....#...."] + ["........."] * 4
WALL = ["........."] * 4 + ["#########"] + ["         "] * 4
CORNER = ["........."] * 4 + ["....#####"] + ["....#    "] * 4


def test_corners_and_posts_are_better_than_walls():
    post, corner, flat = (score(*plan(*rows), (4, 4, 0)) for rows in (POST, CORNER, WALL))
    assert post == pytest.approx(1.0 + abs(2.0 * 48.0 / 49.0 - 1.0), abs=0.02)  # well known, free all around
    assert flat == pytest.approx(1.0 / 3.0 + (1.0 - 2.0 * 3.0 / 9.0) / 3.0, abs=0.02)  # 15 of 49: it falls
    assert flat < 0.5 < 0.6 < corner < post
    assert score(*plan(*POST), (2, 4, 0)) == 0.0  # free
    assert score(*plan(*WALL), (7, 4, 0)) == 0.0  # unknown


@drawn(40)
@given(seeds)
def test_scores_are_the_reference_s(seed):
    rng = np.random.default_rng(seed)
    shape = [(7, 11, 5), (13, 9, 1)][seed % 2]
    mean = rng.choice([0.0, 0.3, 1.0], shape).astype(np.float32)
    precision = rng.choice([PRIOR, np.float32(9.0), KNOWN], shape)
    voxel = tuple(int(rng.integers(0, size)) for size in shape)
    wanted = reference.landmark_score(
        mean.astype(float), precision.astype(float), float(PRIOR), voxel, occupancy_probability
    )
    assert score(mean, precision, voxel) == pytest.approx(wanted, abs=1e-12)


def situation(rng, added):
    """(ESTIMATE, LANDMARK) elements, with Σ = F Σ₀ Fᵀ + `added`, (4, 4), and how far it has moved."""
    estimate, landmark = np.zeros(1, ESTIMATE), np.zeros(1, LANDMARK)
    before = random_covariance(rng, 0.3)
    seen_from, here = rng.uniform(0, 5, 3), rng.uniform(0, 5, 3)
    carry = np.eye(4)
    carry[0, 3], carry[1, 3] = -(here - seen_from)[1], (here - seen_from)[0]
    estimate["place"], estimate["error"] = here - 0.1, [0.1, 0.1, 0.1, 0.05]
    estimate["covariance"] = carry @ before @ carry.T + added
    landmark["seen_from"], landmark["believed"] = seen_from, rng.uniform(0, 5, 3)
    landmark["covariance"], landmark["used"] = before, True
    return estimate[0], landmark[0], (here - seen_from)[:2]


@drawn(40)
@given(seeds)
def test_sighting_a_landmark_again_is_a_filter_with_the_pose_of_then_as_more_state(seed):
    rng = np.random.default_rng(seed)
    estimate, landmark, moved = situation(rng, random_covariance(rng, 0.3))
    landmark["sightings"] = sightings = int(rng.integers(0, 3))
    believed, seen_from = landmark["believed"].copy(), landmark["seen_from"].copy()
    expected = believed - estimate["place"] - estimate["error"][:3]
    seen = expected + rng.normal(size=3) * 0.1
    far, first = (np.linalg.norm(believed - place) for place in (estimate["place"] + 0.1, seen_from))
    often = 1.0 + sightings
    across = max(np.linalg.norm(seen), far) * SIGMAS[1]
    again = often * max(SIGMAS[0], first * SIGMAS[1]) ** 2
    axes = reference.sight_frame(seen)
    noise = axes.T @ np.diag([SIGMAS[0] ** 2 + again, across**2 + again, across**2 + again]) @ axes
    wanted, step = reference.clone_corrected(
        estimate["covariance"].copy(),
        landmark["covariance"].copy(),
        moved,
        believed,
        seen_from,
        seen,
        expected,
        noise,
    )
    before = estimate["error"].copy()
    assert correct_by_landmark(estimate, landmark, tuple(seen), SIGMAS, np.empty((2, 4, 4)))
    np.testing.assert_allclose(estimate["covariance"], wanted, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(before - estimate["error"], step, rtol=1e-6, atol=1e-9)
    assert landmark["sightings"] == sightings + 1


@pytest.mark.parametrize("seed", range(4))
def test_what_is_foreseen_is_what_a_sighting_as_expected_takes_back(seed):
    estimate, landmark, _ = situation(np.random.default_rng(seed), 0.3 * np.eye(4))
    here = estimate["place"] + estimate["error"][:3]
    away = tuple(landmark["believed"] - here)
    foreseen, error = estimate["covariance"].copy(), estimate["error"].copy()
    before, sightings = foreseen.copy(), int(landmark["sightings"])
    foresee_landmark(foreseen, landmark, tuple(here), away, SIGMAS, np.empty((2, 4, 4)))
    assert landmark["sightings"] == sightings and np.trace(foreseen) < np.trace(before)
    assert correct_by_landmark(estimate, landmark, away, SIGMAS, np.empty((2, 4, 4)))
    np.testing.assert_allclose(foreseen, estimate["covariance"], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(estimate["error"], error, atol=1e-9)


def test_who_has_not_moved_since_learns_nothing_from_its_own_landmark():
    estimate, landmark, _ = situation(np.random.default_rng(1), np.zeros((4, 4)))
    estimate["covariance"] = landmark["covariance"]
    estimate["place"] = landmark["seen_from"] - estimate["error"][:3]
    seen = landmark["believed"] - landmark["seen_from"] + 0.3
    before = estimate.copy()
    correct_by_landmark(estimate, landmark, tuple(seen), SIGMAS, np.empty((2, 4, 4)))
    np.testing.assert_allclose(estimate["covariance"], before["covariance"], atol=1e-9)
    np.testing.assert_allclose(estimate["error"], before["error"], atol=1e-9)


def test_a_landmark_that_is_known_less_well_than_the_pose_now_is_left_out():
    estimate, landmark, _ = situation(np.random.default_rng(2), np.zeros((4, 4)))
    estimate["covariance"] = 0.25 * estimate["covariance"]
    before = estimate.copy()
    here = tuple(estimate["place"] + estimate["error"][:3])
    assert not added_since(landmark, here, estimate["covariance"], np.empty((2, 4, 4)))
    assert not correct_by_landmark(estimate, landmark, (1.0, 0.5, 0.2), SIGMAS, np.empty((2, 4, 4)))
    assert (estimate["covariance"] == before["covariance"]).all() and landmark["sightings"] == 0


@drawn(60)
@given(seeds)
def test_covariances_are_told_from_other_matrices(seed):
    rng = np.random.default_rng(seed)
    values = rng.uniform(0.1, 2.0, 4) * rng.choice([0.0, 1.0, 1.0, -1.0], 4)
    turn = np.linalg.qr(rng.normal(size=(4, 4)))[0]
    matrix = turn @ np.diag(values) @ turn.T
    wanted = bool((values >= 0.0).all())
    assert is_covariance(0.5 * (matrix + matrix.T), 3.0 * np.eye(4), np.empty((4, 4))) == wanted


def test_a_planar_robot_s_height_is_no_obstacle():
    assert is_covariance(np.diag([1.0, 2.0, 0.0, 0.1]), np.diag([1.0, 2.0, 0.0, 0.1]), np.empty((4, 4)))
    assert not is_covariance(np.diag([1.0, -0.1, 0.0, 0.1]), np.eye(4), np.empty((4, 4)))
    assert math.isfinite(reference.landmark_score(*(np.ones((3, 4, 1)),) * 2, 0.5, (1, 1, 0), lambda m, q: m))


def test_an_error_of_the_yaw_stays_within_half_a_turn():
    """It is 3.1 rad off, and sees the landmark 0.3 rad to the right of where it expects it: 3.4 rad off."""
    estimate, landmark = np.zeros(1, ESTIMATE)[0], np.zeros(1, LANDMARK)[0]
    estimate["error"][3], estimate["covariance"][3, 3] = 3.1, 1.0
    landmark["believed"][0], landmark["used"] = 2.0, True
    seen = (2.0 * math.cos(0.3), -2.0 * math.sin(0.3), 0.0)
    assert correct_by_landmark(estimate, landmark, seen, SIGMAS, np.zeros((2, 4, 4)))
    assert estimate["error"][3] == pytest.approx(3.4 - 2.0 * math.pi, abs=0.02)
