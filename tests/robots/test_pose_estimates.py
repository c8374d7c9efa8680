"""Estimates of poses: drift, sightings and uncertain measurements, by hand and beside a slow reference."""

import math

import numpy as np
import pytest
from hypothesis import given

from entropy_explore_env.belief.map_update import RAY
from entropy_explore_env.robots.localization import (
    ESTIMATE,
    LOCALIZATION_PARAMS,
    advance_estimate,
    believed_point,
    believed_yaw,
    correct_estimate,
    pack_covariance,
    point_in_world,
    sighting_error,
    weigh_by_covariance,
)
from entropy_explore_env.robots.pose_covariance import keep_positive, within_half_turn
from tests.reference import localization as reference
from tests.reference.scenes import drawn, seeds

PLACE = (2.0, -1.0, 0.5)


def estimate_at(place=PLACE, yaw=0.3, error=(0.0, 0.0, 0.0, 0.0), covariance=None, seed=0):
    """An ESTIMATE; elements of arrays, as kernels take them."""
    estimate = np.zeros(1, ESTIMATE)
    estimate["place"], estimate["yaw"], estimate["error"] = place, yaw, error
    if covariance is not None:
        estimate["covariance"] = covariance
    estimate["drift_rng"] = seed
    return estimate[0]


def drift(**variances):
    params = np.zeros(1, LOCALIZATION_PARAMS)
    for name, variance in variances.items():
        params[name] = variance
    return params[0]


def random_covariance(rng, scale=1.0):
    root = rng.normal(size=(4, 4)) * scale * np.array([[1.0], [1.0], [0.5], [0.2]])
    return root @ root.T


@drawn(40)
@given(seeds)
def test_what_a_robot_means_is_where_it_believes_it_to_be(seed):
    rng = np.random.default_rng(seed)
    estimate = estimate_at(tuple(rng.normal(size=3)), 0.1, rng.normal(size=4))
    point = tuple(rng.normal(size=3) * 10.0)
    believed = believed_point(estimate, point)
    assert point_in_world(estimate, believed) == pytest.approx(point, abs=1e-12)
    turn = reference.turned(float(estimate["error"][3]))
    expected = estimate["place"] + estimate["error"][:3] + turn @ (np.array(point) - estimate["place"])
    assert believed == pytest.approx(expected, abs=1e-12)


def test_an_exact_estimate_leaves_all_as_it_is():
    point = (0.1, 1e9 / 3, -0.7)
    for estimate in (None, estimate_at()):
        assert believed_point(estimate, point) == point == point_in_world(estimate, point)
        assert believed_yaw(estimate, 0.1) == 0.1


def test_a_straight_drive_with_an_error_of_the_yaw_ends_where_trigonometry_says():
    """0.1 rad off, after 10 m along x: 10 sin 0.1 aside, 10 (1 - cos 0.1) short; σ of y is 10 σ of yaw."""
    covariance = np.diag([0.0, 0.0, 0.0, 0.04])
    estimate = estimate_at((0.0, 0.0, 0.5), 0.0, (0.0, 0.0, 0.0, 0.1), covariance)
    advance_estimate(estimate, drift(), (10.0, 0.0, 0.5), 0.0, 10.0)
    aside, along = 10.0 * math.sin(0.1), 10.0 * math.cos(0.1)
    assert estimate["error"] == pytest.approx([along - 10.0, aside, 0.0, 0.1])
    assert estimate["covariance"][3, :2] == pytest.approx([-0.04 * aside, 0.04 * along])
    assert estimate["covariance"][1, 1] == pytest.approx(0.04 * along**2)
    assert estimate["place"].tolist() == [10.0, 0.0, 0.5] and estimate["driven_m"] == 10.0


@drawn(30)
@given(seeds)
def test_a_motion_carries_the_covariance_as_the_reference_does(seed):
    rng = np.random.default_rng(seed)
    yaw, error, covariance = rng.uniform(-3, 3), rng.normal(size=4) * 0.3, random_covariance(rng)
    moved, turn = rng.normal(size=3), rng.uniform(-1, 1)
    estimate = estimate_at(PLACE, yaw, error, covariance, seed)
    believed = np.array([*PLACE, yaw]) + error
    rates = {"xy_per_m": 0.3, "z_per_m": 0.1, "yaw_per_m": 0.2, "yaw_per_rad": 0.7}
    place = tuple(np.array(PLACE) + reference.turned(yaw) @ moved)
    advance_estimate(estimate, drift(**rates), place, yaw + turn, 2.0)
    xy, heading = 0.3 * 2.0, 0.2 * 2.0 + 0.7 * abs(turn)
    _, wanted = reference.predicted(believed, covariance, moved, turn, [xy, xy, 0.1 * 2.0, heading])
    np.testing.assert_allclose(estimate["covariance"], wanted, rtol=1e-10, atol=1e-12)
    assert (estimate["covariance"] == estimate["covariance"].T).all()


@pytest.mark.parametrize("pieces", [1, 4])
def test_the_variance_of_drift_grows_with_the_distance_however_it_is_cut(pieces):
    """10,000 drives of 4 m there and back, and a turn of 1 rad."""
    rates = {"xy_per_m": 0.01, "z_per_m": 0.005, "yaw_per_rad": 0.09}
    ends = np.zeros((10_000, 4))
    for number in range(len(ends)):
        estimate = estimate_at(yaw=0.0, seed=number)
        for piece in range(1, pieces + 1):
            advance_estimate(estimate, drift(**rates), PLACE, piece / pieces, 4.0 * piece / pieces)
        ends[number] = estimate["error"]
    wanted = np.array([0.04, 0.04, 0.02, 0.09])
    assert np.diag(estimate["covariance"]) == pytest.approx(wanted)
    assert ends.var(axis=0) == pytest.approx(wanted, rel=0.05)  # 3.5 standard deviations
    assert np.abs(ends.mean(axis=0)) == pytest.approx(0.0, abs=4.0 * math.sqrt(0.09 / 10_000))
    assert np.abs(np.corrcoef(ends.T) - np.eye(4)).max() < 0.05


def test_the_yaw_s_error_stays_within_half_a_turn():
    assert within_half_turn(3.1) == 3.1 and within_half_turn(-math.pi) == -math.pi
    assert within_half_turn(3.3) == pytest.approx(3.3 - 2 * math.pi)
    estimate = estimate_at(error=(0.0, 0.0, 0.0, 3.0))
    for piece in range(1, 20):
        advance_estimate(estimate, drift(yaw_per_m=4.0), PLACE, 0.3, float(piece))
        assert abs(estimate["error"][3]) <= math.pi


def sighting(rng, estimate, landmark):
    """What the reference's sensor sees, and the same as our filter takes it."""
    truth = np.array([*estimate["place"], estimate["yaw"]])
    seen = reference.measured(truth, landmark) + rng.normal(size=3) * 0.05
    believed = truth + estimate["error"]
    return believed, seen, reference.turned(believed[3]) @ seen


@drawn(60)
@given(seeds)
def test_a_correction_is_that_of_the_reference(seed):
    rng = np.random.default_rng(seed)
    error, covariance = rng.normal(size=4) * 0.05, random_covariance(rng, 0.3)
    estimate = estimate_at(PLACE, rng.uniform(-3, 3), error, covariance)
    landmark = np.array(PLACE) + rng.normal(size=3) * 3.0
    believed, seen, as_turned = sighting(rng, estimate, landmark)
    expected = tuple(landmark - believed[:3])
    noise = reference.sighting_noise(seen, 0.05, 0.02, np.linalg.norm(expected))
    state, wanted = reference.corrected(believed, covariance, landmark, seen, noise)
    correct_estimate(estimate, tuple(as_turned), expected, 0.05, 0.02)
    after = np.array([*estimate["place"], estimate["yaw"]]) + estimate["error"]
    np.testing.assert_allclose(after, state, atol=1e-6)
    np.testing.assert_allclose(estimate["covariance"], wanted, atol=1e-6)
    h = reference.jacobian(believed, landmark)
    information = np.linalg.inv(covariance) + h.T @ np.linalg.inv(noise) @ h
    np.testing.assert_allclose(estimate["covariance"], np.linalg.inv(information), atol=1e-5)
    assert estimate["sightings"] == 1


def test_a_fiducial_seen_from_two_sides_says_where_the_robot_is():
    """Along each line of sight the place becomes as certain as the range: from one side only along it."""
    covariance = np.diag([1.0, 1.0, 1e-12, 1e-12])
    sides = []
    for yaw in (0.0, math.pi / 2):
        estimate = estimate_at((0.0, 0.0, 0.0), yaw, covariance=covariance)
        ahead = (4.0 * math.cos(yaw), 4.0 * math.sin(yaw), 0.0)
        correct_estimate(estimate, ahead, ahead, 0.1, 10.0)  # directions say next to nothing
        sides.append(estimate["covariance"].copy())
        covariance = estimate["covariance"].copy()
    one = 1.0 / (1.0 + 1.0 / 0.01)
    assert np.diag(sides[0])[:2] == pytest.approx([one, 1.0], rel=2e-3)
    assert np.diag(sides[1])[:2] == pytest.approx([one, one], rel=2e-3)


@drawn(40)
@given(seeds)
def test_covariances_stay_symmetric_and_positive(seed):
    rng = np.random.default_rng(seed)
    estimate = estimate_at(seed=seed)
    rates = drift(xy_per_m=10.0 ** rng.uniform(-8, 2), z_per_m=0.01, yaw_per_m=10.0 ** rng.uniform(-8, 0))
    driven = 0.0
    for _ in range(60):
        driven += rng.uniform(0.0, 3.0)
        place = tuple(rng.normal(size=3) * 4.0)
        advance_estimate(estimate, rates, place, rng.uniform(-3, 3), driven)
        for _ in range(rng.integers(0, 3)):
            away = rng.normal(size=3) * 5.0
            expected = tuple(away - estimate["error"][:3])
            seen = tuple(reference.turned(float(estimate["error"][3])) @ away)
            correct_estimate(estimate, seen, expected, 10.0 ** rng.uniform(-6, 0), 10.0 ** rng.uniform(-6, 0))
        covariance = estimate["covariance"]
        assert np.isfinite(covariance).all() and (covariance == covariance.T).all()
        assert np.linalg.eigvalsh(covariance).min() >= -1e-9 * max(np.trace(covariance), 1e-12)


def least_share(covariance):
    """The least eigenvalue, as a share of the trace; ≥ 0 where there is no uncertainty."""
    return np.linalg.eigvalsh(covariance).min() / max(np.trace(covariance), 1e-300)


def drawn_covariance(rng):
    """One of 1 to 4 independent errors, of any sizes."""
    root = rng.normal(size=(4, rng.integers(1, 5))) * 10.0 ** rng.uniform(-6, 6, (4, 1))
    covariance = root @ root.T
    return np.triu(covariance) + np.triu(covariance, 1).T


@drawn(100)
@given(seeds)
def test_a_covariance_stays_as_it_is(seed):
    """Also a singular one, whose eigenvalues are below 0 by rounding, and one with errors that are none."""
    rng = np.random.default_rng(seed)
    covariance = drawn_covariance(rng)
    known = rng.random(4) < 0.2
    covariance[known] = covariance[:, known] = 0.0
    kept = covariance.copy()
    keep_positive(kept)
    np.testing.assert_array_equal(kept, covariance)


@drawn(100)
@given(seeds)
def test_what_is_no_covariance_becomes_one(seed):
    """Rounding of what was there before, larger than what is left; variances stay, or become 0."""
    rng = np.random.default_rng(seed)
    noise = rng.normal(size=(4, 4)) * 10.0 ** rng.uniform(-3, 3)
    matrix = drawn_covariance(rng) + noise + noise.T
    kept = matrix.copy()
    keep_positive(kept)
    assert (kept == kept.T).all() and least_share(kept) >= -1e-7
    np.testing.assert_array_equal(np.diag(kept), np.maximum(np.diag(matrix), 0.0))


def test_the_last_of_an_uncertainty_is_no_negative_one():
    """Wheels slip, landmarks are sighted to 10 nm: of 200 m nothing is left but what rounding leaves."""
    rng = np.random.default_rng(0)
    estimate = estimate_at()
    rates = drift(xy_per_m=1e4)
    for step in range(200):
        advance_estimate(estimate, rates, PLACE, 2.0 * (step % 2), 2.0 * step)
        for _ in range(3):
            away = rng.normal(size=3) * np.array([1.0, 1.0, step % 2])
            expected = tuple(away - estimate["error"][:3])
            correct_estimate(estimate, tuple(away), expected, 10.0 ** rng.uniform(-9, 0), 1e-9)
            assert least_share(estimate["covariance"]) >= -1e-7
            assert np.abs(estimate["covariance"]).max() < 1e6


def test_errors_of_sightings_lie_along_and_across_the_line_of_sight():
    rng, away = np.array([5], np.uint64), (3.0, -4.0, 2.0)
    errors = np.array([sighting_error(away, 0.2, 0.01, rng) for _ in range(20_000)])
    ahead = np.array(away) / math.sqrt(29.0)
    across = errors - np.outer(errors @ ahead, ahead)
    assert (errors @ ahead).std() == pytest.approx(0.2, rel=0.03)
    assert math.sqrt((across**2).sum(axis=1).mean()) == pytest.approx(
        0.01 * math.sqrt(29.0) * math.sqrt(2), rel=0.03
    )
    straight_up = np.array([sighting_error((0.0, 0.0, 2.0), 0.2, 0.01, rng) for _ in range(5000)])
    assert straight_up.std(axis=0) == pytest.approx([0.02, 0.02, 0.2], rel=0.05)


@drawn(40)
@given(seeds)
def test_measurements_are_as_precise_as_the_place_of_their_points(seed):
    rng = np.random.default_rng(seed)
    covariance, packed = random_covariance(rng, 0.2), np.zeros(10)
    pack_covariance(covariance, packed)
    assert packed.tolist() == covariance[np.triu_indices(4)].tolist()
    rays, sigmas, edge_m = np.zeros(5, RAY), rng.uniform(0.05, 2.0, 5), 0.25
    directions = rng.normal(size=(5, 3))
    rays["direction"] = directions / np.linalg.norm(directions, axis=1)[:, None]
    rays["range_m"], rays["precision"] = rng.uniform(0.1, 10.0, 5), sigmas**-2.0
    weigh_by_covariance(rays, 4, packed, edge_m)
    for ray, sigma in zip(rays[:4], sigmas[:4], strict=True):
        yaw = 1.2
        seen = reference.turned(-yaw) @ ray["direction"] * ray["range_m"]
        spread = reference.point_covariance(covariance, yaw, seen)
        assert ray["precision"] ** -1.0 == pytest.approx(sigma**2 + np.trace(spread) / edge_m**2)
        along = ray["direction"] @ covariance[:3, :3] @ ray["direction"]
        assert ray["precision"] ** -1.0 >= (sigma**2 + along / edge_m**2) * (1.0 - 1e-9)
        # eq. 21, along any axis: two measurements of a point are as precise as both precisions together
        both = reference.merged(spread, 0.5 * spread)
        np.testing.assert_allclose(np.linalg.inv(both), 3.0 * np.linalg.inv(spread), rtol=1e-5)
    assert rays["precision"][4] == (sigmas**-2.0)[4]
    before = rays.copy()
    weigh_by_covariance(rays, 5, np.zeros(10), edge_m)
    assert (rays == before).all()
