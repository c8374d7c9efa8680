"""The range sensor: its bundle of rays, what comes back along them, and what that says of voxels."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from entropy_explore_env.belief.map_update import fuse_scan
from entropy_explore_env.belief.measurement_model import Return
from entropy_explore_env.robots.measured_rays import trace_measurement
from entropy_explore_env.robots.range_sensor import (
    Scene,
    SensorPose,
    body_distance,
    new_scan,
    sensor_model,
    take_scan,
    true_coverage,
    visibility_parameters,
)
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.sensor import RangeSensor
from tests.reference import rocha04
from tests.reference.scenes import SHAPES, as_reference, drawn, flat_index, random_belief, random_cover, seeds

SIZE = (7, 11, 5)
COARSE = RangeSensor((math.pi / 2, math.pi / 3), math.pi / 12)


def scan_of(truth, start, yaw=0.0, pitch=0.0, sensor=COARSE, voxel_size_m=0.5, bodies=(), seed=1):
    """What a sensor measures in a world; start and bodies in grid units."""
    grid = Grid(truth.shape, voxel_size_m)
    scan = new_scan(grid, [sensor], sensor.rays)
    balls = np.array(bodies, np.float64).reshape(-1, 4)
    scene = Scene(truth.ravel(), truth.shape, voxel_size_m, balls)
    take_scan(scan, sensor_model(sensor), scene, pose_at(start, yaw, pitch), np.array([seed], np.uint64))
    return scan


def pose_at(start, yaw, pitch):
    return SensorPose(tuple(np.asarray(start, np.float64).tolist()), float(yaw), float(pitch))


def directions_of(sensor, yaw, pitch):
    """(R, 3) unit vectors of the rays of a scan."""
    return scan_of(np.zeros(SIZE, np.float32), (3.5, 5.5, 2.5), yaw, pitch, sensor).rays["direction"].copy()


def voxels_on(scan, index):
    return scan.crossed[index, : scan.rays[index]["voxels"]].tolist()


@pytest.mark.parametrize(
    ("view", "step", "columns", "rows"),
    [
        ((0.0, 0.0), 0.1, 1, 1),
        ((math.pi / 2, math.pi / 4), math.pi / 4, 3, 2),
        ((2 * math.pi, 0.0), math.pi / 2, 4, 1),  # a full turn: no second ray straight behind
        ((2 * math.pi, math.pi), math.pi / 2, 4, 3),
        ((3 * math.pi / 2, math.pi), math.pi / 2, 4, 3),
        ((2 * math.pi, 0.0), 7.0, 1, 1),
    ],
)
def test_how_many_rays_a_field_of_view_has(view, step, columns, rows):
    sensor = RangeSensor(view, step)
    assert (sensor.columns, sensor.rows) == (columns, rows)
    directions = np.round(directions_of(sensor, 0.3, 0.0), 9)
    level = directions[np.abs(directions[:, 2]) < 0.9]
    assert len(np.unique(level, axis=0)) == len(level)


@drawn(40)
@given(st.floats(-math.pi, math.pi), st.floats(-math.pi / 2, math.pi / 2))
def test_rays_point_where_yaw_and_pitch_say(yaw, pitch):
    """Column by column from the right, in each the topmost first."""
    yaws, pitches = (np.arange(7) - 3) * math.pi / 12, (np.arange(5) - 2) * math.pi / 12
    expected = [rocha04.gaze(yaw + a, pitch + b) for a in yaws for b in pitches]
    np.testing.assert_allclose(directions_of(COARSE, yaw, pitch), expected, atol=1e-12)


@drawn(60)
@given(
    st.sampled_from(SHAPES),
    seeds,
    st.sampled_from([0.25, 0.1]),
    st.sampled_from([math.inf, 0.6]),
    st.integers(0, 2),
)
def test_a_scan_is_what_the_reference_measures(size, seed, voxel_size_m, max_range_m, behind):
    rng = np.random.default_rng(seed)
    truth, start = random_cover(size, 0.15, seed), rng.uniform(0.1, 0.9, 3) + rng.integers(0, size)
    yaw, pitch = rng.uniform(-math.pi, math.pi), rng.uniform(-1.2, 1.2) * (size[2] > 1)
    view = (COARSE.field_of_view_rad[0], COARSE.field_of_view_rad[1] * (size[2] > 1))
    sensor = RangeSensor(view, math.pi / 12, max_range_m, 0.05, 0.02, voxels_behind=behind)
    scan = scan_of(truth, start, yaw, pitch, sensor, voxel_size_m)
    longest = max_range_m / voxel_size_m
    for index, ray in enumerate(scan.rays):
        assume(rocha04.is_generic(start, ray["direction"], size, longest))
        theirs = rocha04.trace(lambda v: truth[v] > 0.5, start, ray["direction"], size, longest, behind)
        assert ray["returned"] == (Return.FREE if theirs.end == rocha04.OPEN else Return.HIT)
        assert ray["range_m"] == pytest.approx(theirs.length * voxel_size_m, rel=1e-9)
        assert voxels_on(scan, index) == flat_index(theirs.voxels, size)
        sigma = rocha04.measured_sigma(theirs.length * voxel_size_m, 0.05, 0.02)
        assert ray["precision"] == pytest.approx(sigma**-2, rel=1e-9)
        coverage = np.where(
            np.arange(ray["voxels"]) < ray["free"], 0.0, scan.coverage[index, : ray["voxels"]]
        )
        centres = [rocha04.centre_distance(start, voxel) for voxel in theirs.voxels]
        means = [rocha04.measured_mean(away, theirs.length, 1.0) for away in centres]
        free = theirs.end == rocha04.OPEN
        assert coverage == pytest.approx(np.zeros(len(means)) if free else means, abs=1e-6)


@drawn(60)
@given(st.sampled_from(SHAPES), seeds, st.floats(0.0, 2.5), st.sampled_from([0.0, 0.4]))
def test_returns_nearer_than_the_least_range_measure_nothing(size, seed, min_range_m, noise_m):
    """Judged by the measured distance; the noise of other rays is the same."""
    rng = np.random.default_rng(seed)
    truth, start = random_cover(size, 0.15, seed), rng.uniform(0.1, 0.9, 3) + rng.integers(0, size)
    gaze = (rng.uniform(-math.pi, math.pi), 0.0)
    view = (COARSE.field_of_view_rad[0], COARSE.field_of_view_rad[1] * (size[2] > 1))
    settings = {"range_noise_m": noise_m, "max_range_m": 3.0}
    before = scan_of(truth, start, *gaze, RangeSensor(view, math.pi / 12, **settings))
    scan = scan_of(truth, start, *gaze, RangeSensor(view, math.pi / 12, **settings, min_range_m=min_range_m))
    maps = [random_belief(size, seed) for _ in range(2)]
    for each, (mean, precision) in zip((scan, before), maps, strict=True):
        each.order[:] = np.arange(len(each.rays))
        if each is before:
            for ray in each.rays:
                if rocha04.is_blind(ray["returned"] == Return.HIT, ray["range_m"], min_range_m):
                    ray["returned"], ray["range_m"] = Return.NOTHING, 0.0
        fuse_scan(each, len(each.rays), mean.ravel(), precision.ravel())
    for name in ("returned", "range_m"):
        np.testing.assert_array_equal(scan.rays[name], before.rays[name])
    for ours, theirs in zip(*maps, strict=True):
        np.testing.assert_array_equal(ours, theirs)


def test_a_blind_sensor_learns_nothing_from_a_near_wall_and_free_space_from_a_far_one():
    """A wall 0.75 m ahead in voxels of 0.5 m, from the middle of one: nearer than 0.8 m, not than 0.7 m."""
    truth = np.zeros(SIZE, np.float32)
    truth[2] = 1.0
    for min_range_m, returned in ((0.8, Return.NOTHING), (0.75, Return.HIT), (0.7, Return.HIT)):
        sensor = RangeSensor((0.0, 0.0), 0.1, min_range_m=min_range_m)
        scan = scan_of(truth, (0.5, 5.5, 2.5), sensor=sensor)
        assert scan.rays[0]["returned"] == returned
        mean = np.full(SIZE, 0.5, np.float32)
        precision = np.full(SIZE, 1e-3, np.float32)
        scan.order[0] = 0
        bits = fuse_scan(scan, 1, mean.ravel(), precision.ravel())
        learned = mean[:3, 5, 2].round(3).tolist()
        if returned == Return.NOTHING:
            assert (bits, scan.rays[0]["range_m"], learned) == (0.0, 0.0, [0.5, 0.5, 0.5])
        else:
            assert bits > 0.0 and learned[0] < 0.01 < 0.9 < learned[2], "free also before the least range"


@drawn(40)
@given(st.sampled_from(SHAPES), seeds)
def test_a_fused_scan_is_the_reference_s_map_and_utility(size, seed):
    rng = np.random.default_rng(seed)
    truth, start = random_cover(size, 0.1, seed), rng.uniform(0.1, 0.9, 3) + rng.integers(0, size)
    sensor = RangeSensor((1.2, 0.8 * (size[2] > 1)), 0.2, 1.9, 0.07, 0.01)
    scan = scan_of(truth, start, rng.uniform(-3, 3), 0.2 * (size[2] > 1), sensor, 0.5)
    assume(all(rocha04.is_generic(start, ray["direction"], size, 3.8) for ray in scan.rays))
    mean, precision = random_belief(size, seed)
    beliefs = as_reference(mean, precision)
    scan.order[:] = rng.permutation(len(scan.rays))
    scan.rays["returned"][scan.order[2]] = Return.NOTHING
    total = fuse_scan(scan, len(scan.order), mean.ravel(), precision.ravel())
    expected = np.zeros(len(scan.rays))
    for index in scan.order:
        ray = scan.rays[index]
        if ray["returned"] != Return.NOTHING:
            theirs = rocha04.trace(lambda v: truth[v] > 0.5, start, ray["direction"], size, 3.8, 1)
            expected[index] = rocha04.integrate(
                beliefs,
                theirs.voxels,
                start,
                theirs.length * 0.5,
                theirs.end != rocha04.OPEN,
                rocha04.Sensor(0.5, 0.07, 0.01),
            )
    assert scan.utility == pytest.approx(expected, rel=1e-5, abs=1e-5)
    assert total == pytest.approx(expected.sum(), rel=1e-6)
    np.testing.assert_allclose(mean.ravel(), [beliefs[v][0] for v in np.ndindex(*size)], atol=5e-6)
    sigmas = [beliefs[v][1] for v in np.ndindex(*size)]
    np.testing.assert_allclose(precision.ravel() ** -0.5, sigmas, rtol=1e-5)


@drawn(60)
@given(seeds, st.integers(1, 4))
def test_the_first_body_on_a_ray(seed, count):
    rng = np.random.default_rng(seed)
    start, bodies = rng.uniform(0, 5, 3), np.zeros((4, 4))
    bodies[:count, :3] = rng.uniform(0, 8, (count, 3))
    bodies[:count, 3] = np.minimum(
        rng.uniform(0.2, 2.0, count), 0.9 * np.linalg.norm(bodies[:count, :3] - start, axis=1)
    )
    for direction in rng.normal(size=(8, 3)):
        direction /= np.linalg.norm(direction)
        expected = min(
            rocha04.distance_to_ball(start, direction, body[:3], body[3]) for body in bodies[:count]
        )
        first = body_distance(tuple(start.tolist()), tuple(direction.tolist()), bodies[:count])
        assert first == pytest.approx(expected, rel=1e-7, abs=1e-7)


def scene_with_a_teammate():
    """Eleven voxels along y, looking along y from y = 1.5: a ball of radius 0.4 at y = 6.5, wall at 11."""
    return np.zeros(SIZE, np.float32), (3.5, 1.5, 2.5), [(3.5, 6.5, 2.5, 0.4)]


def test_a_body_in_front_of_the_wall_leaves_no_measurement():
    truth, start, bodies = scene_with_a_teammate()
    narrow = RangeSensor((math.pi / 18, 0.0), math.pi / 36)  # three rays, 5° apart
    scan = scan_of(truth, start, math.pi / 2, 0.0, narrow, bodies=bodies)
    # The ball's half-angle is asin(0.4 / 5) = 4.6°: it hides the middle ray only.
    assert scan.rays["returned"].tolist() == [Return.HIT, Return.NOTHING, Return.HIT]
    mean, precision = np.full(SIZE, 0.5, np.float32), np.ones(SIZE, np.float32)
    scan.order[:] = [0, 1, 2]
    fuse_scan(scan, 3, mean.ravel(), precision.ravel())
    assert (precision[3, 8:, 2] == 1.0).all()  # what only the middle ray crosses: 5° are ½ voxel there
    assert scan.utility[1] == 0.0 == scan.rays["range_m"][1]  # nothing of what stands behind the body


def test_a_body_behind_an_obstacle_hides_nothing():
    truth, start, bodies = scene_with_a_teammate()
    truth[3, 5, 2] = 1.0
    one = RangeSensor((0.0, 0.0), 0.1)
    scan = scan_of(truth, start, math.pi / 2, 0.0, one, bodies=bodies)
    assert (scan.rays["returned"][0], scan.rays["range_m"][0]) == (Return.HIT, 0.5 * 3.5)
    # … nor one beyond the sensor's range, nor one behind the sensor.
    short = RangeSensor((0.0, 0.0), 0.1, max_range_m=2.0)
    scan = scan_of(np.zeros(SIZE, np.float32), start, math.pi / 2, 0.0, short, bodies=bodies)
    assert (scan.rays["returned"][0], scan.rays["range_m"][0]) == (Return.FREE, 2.0)
    scan = scan_of(np.zeros(SIZE, np.float32), start, -math.pi / 2, 0.0, one, bodies=bodies)
    assert (scan.rays["returned"][0], scan.rays["range_m"][0]) == (Return.HIT, 0.75)


def test_range_noise_has_the_asked_standard_deviation_and_leaves_free_rays_alone():
    many = RangeSensor((2 * math.pi, math.pi / 2), math.pi / 60, range_noise_m=0.01)
    truth, start = np.zeros(SIZE, np.float32), (3.5, 5.5, 2.5)
    clean = scan_of(truth, start, sensor=RangeSensor((2 * math.pi, math.pi / 2), math.pi / 60))
    noisy = scan_of(truth, start, sensor=many, seed=5)
    errors = noisy.rays["range_m"] - clean.rays["range_m"]
    assert len(errors) > 3000
    assert abs(errors.mean()) < 4 * 0.01 / math.sqrt(len(errors))
    assert errors.std() == pytest.approx(0.01, rel=0.06)
    assert (noisy.rays["direction"] == clean.rays["direction"]).all()
    again = scan_of(truth, start, sensor=many, seed=6)
    assert (again.rays["range_m"] != noisy.rays["range_m"]).all()
    short = RangeSensor((2 * math.pi, math.pi / 2), math.pi / 60, max_range_m=2.0, range_noise_m=0.01)
    bounded = scan_of(truth, start, sensor=short, seed=5)
    assert (bounded.rays["range_m"] <= 2.0).all()
    free = bounded.rays["returned"] == Return.FREE
    assert 0 < free.sum() < len(free)
    assert (bounded.rays["range_m"][free] == 2.0).all()


@drawn(40)
@given(seeds)
def test_a_noisy_measurement_says_what_its_noisy_distance_says(seed):
    rng = np.random.default_rng(seed)
    truth, start = random_cover(SIZE, 0.1, seed), rng.uniform(0.1, 0.9, 3) + rng.integers(0, SIZE)
    sensor = RangeSensor((1.2, 0.8), 0.2, range_noise_m=0.3)
    scan = scan_of(truth, start, rng.uniform(-3, 3), 0.2, sensor, 0.5, seed=seed)
    for index, ray in enumerate(scan.rays):
        assert ray["range_m"] > 0.0
        length = ray["range_m"] / 0.5
        assume(rocha04.is_generic(start, ray["direction"], SIZE, length))
        theirs = rocha04.trace(lambda v: False, start, ray["direction"], SIZE, length, 1, hit_at_longest=True)
        assert voxels_on(scan, index) == flat_index(theirs.voxels, SIZE)
        assert ray["precision"] == pytest.approx(rocha04.measured_sigma(length * 0.5, 0.08, 0.006) ** -2)


@pytest.mark.parametrize("voxel_size_m", [0.5, 0.25, 0.1, 0.08, 0.3])
def test_a_measurement_retold_influences_the_voxels_that_it_influenced_first(voxel_size_m):
    """As a delayed message does: only direction, length and Return are told."""
    sensor = RangeSensor((2 * math.pi, math.pi / 2), math.pi / 36)
    truth, start = random_cover(SIZE, 0.1, 1), np.array([3.4, 5.3, 2.6])
    scan = scan_of(truth, start, 0.3, 0.1, sensor, voxel_size_m)
    grid = Grid(SIZE, voxel_size_m)
    told = new_scan(grid, [sensor], sensor.rays)
    for name in ("direction", "length", "returned"):
        told.rays[name] = scan.rays[name]
    params, place = sensor_model(sensor).params[0], tuple(start.tolist())
    for index in range(sensor.rays):
        trace_measurement(told, index, params, SIZE, voxel_size_m, place, truth.ravel())
        assert voxels_on(told, index) == voxels_on(scan, index)
        assert told.rays[index]["free"] == scan.rays[index]["free"]
        assert told.coverage[index] == pytest.approx(scan.coverage[index], abs=1e-6)


def test_visibility_parameters():
    """r̂ is the mean of the measured distances, α̂ the largest angle of a measured ray (RochaMI, eq. 4)."""
    sensor = RangeSensor((0.6, 0.4), 0.2)
    rays = scan_of(np.zeros(SIZE, np.float32), (3.5, 5.5, 2.5), 0.7, 0.0, sensor).rays
    rays["returned"], rays["range_m"] = Return.HIT, np.arange(12.0)
    depth, half_angle, count = visibility_parameters(rays, 0.7, 0.0)
    assert (depth, count) == (5.5, 12)
    assert half_angle == pytest.approx(math.acos(math.cos(0.3) * math.cos(0.2)))
    rays["returned"] = Return.NOTHING
    assert visibility_parameters(rays, 0.7, 0.0) == (0.0, 0.0, 0)
    rays["returned"][[4, 7]] = Return.FREE, Return.HIT  # middle row, 0.1 to the right and to the left
    depth, half_angle, count = visibility_parameters(rays, 0.7, 0.0)
    assert (depth, count) == (5.5, 2)
    assert half_angle == pytest.approx(0.1)
    one = scan_of(np.zeros(SIZE, np.float32), (3.5, 5.5, 2.5), 2.0, 0.3, RangeSensor((0.0, 0.0), 0.1))
    assert visibility_parameters(one.rays, 2.0, 0.3)[1] == pytest.approx(0.0, abs=1e-7)


@drawn(60)
@given(st.sampled_from(SHAPES), seeds, st.sampled_from([math.inf, 0.6]), st.integers(0, 2))
def test_rays_that_end_at_what_gives_no_return_measure_nothing(size, seed, max_range_m, behind):
    rng = np.random.default_rng(seed)
    truth, start = random_cover(size, 0.15, seed), rng.uniform(0.1, 0.9, 3) + rng.integers(0, size)
    yaw, pitch = rng.uniform(-math.pi, math.pi), rng.uniform(-1.2, 1.2) * (size[2] > 1)
    unreadable = (truth > 0.5) & (rng.random(size) < 0.5)
    view = (COARSE.field_of_view_rad[0], COARSE.field_of_view_rad[1] * (size[2] > 1))
    sensor = RangeSensor(view, math.pi / 12, max_range_m, 0.05, 0.02, voxels_behind=behind)
    readable = scan_of(truth, start, yaw, pitch, sensor)
    scan = scan_of(true_coverage(truth > 0.5, unreadable).reshape(size), start, yaw, pitch, sensor)
    longest = max_range_m / 0.5
    for index, ray in enumerate(scan.rays):
        assume(rocha04.is_generic(start, ray["direction"], size, longest))
        theirs = rocha04.trace(lambda v: truth[v] > 0.5, start, ray["direction"], size, longest, 1)
        hit = theirs.end == rocha04.HIT and unreadable[theirs.voxels[-1]]
        if hit:
            assert (ray["returned"], ray["range_m"]) == (Return.NOTHING, 0.0)
        else:
            assert ray == readable.rays[index]
            assert voxels_on(scan, index) == voxels_on(readable, index)


def test_true_coverage_tells_free_solid_and_unreadable_voxels_apart():
    occupied = np.array([[[False, True, True]]])
    assert true_coverage(occupied, None).tolist() == [0.0, 1.0, 1.0]
    assert true_coverage(occupied, np.array([[[False, False, True]]])).tolist() == [0.0, 1.0, 2.0]
