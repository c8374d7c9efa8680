"""The bits that a scan is expected to bring, against a scan, and by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from entropy_explore_env.belief.fields import Belief
from entropy_explore_env.belief.map_update import fuse_scan
from entropy_explore_env.belief.raycast import longest_crossing
from entropy_explore_env.belief.visibility import CONE, cone_of, mark_cones
from entropy_explore_env.prediction.crop import UNPREDICTED
from entropy_explore_env.robots.range_sensor import Scene, SensorPose, new_scan, sensor_model, take_scan
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.scenarios import BOX
from entropy_explore_env.settings.sensor import RangeSensor
from entropy_explore_env.viewpoints.evaluation import new_scratch, robot_model
from entropy_explore_env.viewpoints.expected_scan import (
    ScanModel,
    expected_bits,
    fill_bits,
    new_scan_scratch,
)
from tests.reference.scenes import (
    drawn,
    random_cover,
    seeds,
)

SIZE = (7, 11, 5)
MODEL = robot_model(BOX, BOX.kinds[0], 1, 0.1)
NO_CONES = np.zeros(0, CONE)
SENSOR = RangeSensor((math.pi / 3, math.pi / 4), math.pi / 24, sigma_min=0.1, sigma_slope_per_m=0.05)


def model(stop_probability=0.0, known_precision=0.0, rays=1.0, sensor=SENSOR, pose_variance=(0.0, 0.0)):
    offsets = sensor_model(sensor)
    return ScanModel(
        offsets.yaw_offsets,
        offsets.pitch_offsets,
        rays,
        0.5,
        sensor.max_range_m,
        sensor.min_range_m,
        sensor.sigma_min,
        sensor.sigma_slope_per_m,
        sensor.sigma_exponent,
        sensor.voxels_behind,
        known_precision,
        stop_probability,
        stop_probability,
        np.array(pose_variance, float),
    )


def expected(mean, precision, viewpoint, scan, cones=NO_CONES, solid=None):
    longest = longest_crossing(*SIZE, math.inf, scan.voxels_behind)
    scratch = new_scan_scratch(mean.size, longest, len(scan.pitches), solid is not None)
    if solid is not None:
        scratch.solid[:] = solid.ravel()
    belief = Belief(mean.ravel(), precision.ravel(), SIZE)
    mark_cones(cones, SIZE, scratch.left)
    bits = expected_bits(belief, scan, np.array(viewpoint, float), scratch)
    assert not scratch.added.any()
    return bits


@drawn(40)
@given(
    seeds,
    st.floats(-math.pi, math.pi),
    st.floats(-1.2, 1.2),
    st.integers(0, 1),
    st.sampled_from([2.0, math.inf]),
    st.sampled_from([0.0, 1.1]),
)
def test_a_scan_brings_what_was_expected_where_the_belief_is_right_about_obstacles(
    seed, yaw, pitch, behind, reach, min_range_m
):
    rng = np.random.default_rng(seed)
    view = (SENSOR.field_of_view_rad, SENSOR.angular_step_rad, reach, 0.1, 0.05)
    sensor = RangeSensor(*view, voxels_behind=behind, min_range_m=min_range_m)
    truth = random_cover(SIZE, 0.1, seed)
    precision = rng.uniform(0.01, 50.0, SIZE).astype(np.float32)
    start = rng.uniform(0.5, np.array(SIZE) - 0.5)
    viewpoint = (*start, yaw, pitch)
    hoped = expected(truth, precision, viewpoint, model(sensor=sensor))
    scan = new_scan(Grid(SIZE, 0.5), [sensor], sensor.rays)
    rng_state = np.zeros(1, np.uint64)
    scene = Scene(truth.ravel(), SIZE, 0.5, np.zeros((0, 4)))
    take_scan(scan, sensor_model(sensor), scene, SensorPose(tuple(start.tolist()), yaw, pitch), rng_state)
    scan.order[:] = np.arange(sensor.rays)
    brought = fuse_scan(scan, sensor.rays, truth.ravel().copy(), precision.ravel().copy())
    assert hoped == pytest.approx(brought, rel=2e-4)


def test_one_ray_by_hand():
    """Along x from the middle of voxel 1: voxels 1 … 6, 2.75 m to the wall, σ = 0.1 + 0.05 · 2.75."""
    one = RangeSensor((0.0, 0.0), 0.1, sigma_min=0.1, sigma_slope_per_m=0.05)
    mean, precision = np.zeros(SIZE, np.float32), np.full(SIZE, 4.0, np.float32)
    viewpoint = (1.5, 5.5, 2.5, 0.0, 0.0)
    gain = 1.0 / 0.2375**2
    bits = expected(mean, precision, viewpoint, model(sensor=one))
    assert bits == pytest.approx(6 * 0.5 * math.log2(1 + gain / 4.0), rel=1e-5)
    # Unknown voxels let half of it through: the first gets all, the second a half, the third a quarter.
    half = expected(mean, precision, viewpoint, model(0.5, known_precision=5.0, sensor=one))
    assert half == pytest.approx(sum(0.5 * math.log2(1 + gain * 0.5**i / 4.0) for i in range(6)), rel=1e-5)
    twice = expected(mean, precision, viewpoint, model(rays=2.0, sensor=one))
    assert twice == pytest.approx(6 * 0.5 * math.log2(1 + 2 * gain / 4.0), rel=1e-5)
    mean[4, 5, 2] = 0.9  # stops it after 1.25 m, one voxel behind counts
    near = 1.0 / (0.1 + 0.05 * 1.25) ** 2
    stopped = expected(mean, precision, viewpoint, model(sensor=one))
    assert stopped == pytest.approx(4 * 0.5 * math.log2(1 + near / 4.0), rel=1e-5)


def test_a_ray_stops_as_predicted_where_nothing_is_known():
    """Voxels 1 … 6 along x, of which 3 is known: a prediction of it does not count."""
    one = RangeSensor((0.0, 0.0), 0.1, sigma_min=0.1, sigma_slope_per_m=0.05)
    mean, precision = np.zeros(SIZE, np.float32), np.full(SIZE, 4.0, np.float32)
    precision[3, 5, 2] = 20.0
    scan, viewpoint = model(0.5, known_precision=5.0, sensor=one), (1.5, 5.5, 2.5, 0.0, 0.0)
    solid = np.full(SIZE, UNPREDICTED, np.float32)
    solid[2:5, 5, 2] = 0.25, 1.0, 0.75
    gain, shares = 1.0 / 0.2375**2, (1.0, 0.5, 0.5 * 0.75, 0.5 * 0.75, 0.5 * 0.75 * 0.25)
    bits = [gain * share / (20.0 if n == 2 else 4.0) for n, share in enumerate((*shares, shares[-1] * 0.5))]
    found = expected(mean, precision, viewpoint, scan, solid=solid)
    assert found == pytest.approx(sum(0.5 * math.log2(1 + each) for each in bits), rel=1e-5)
    unpredicted = np.full(SIZE, UNPREDICTED, np.float32)
    as_before = expected(mean, precision, viewpoint, scan)
    assert expected(mean, precision, viewpoint, scan, solid=unpredicted) == as_before
    solid[2, 5, 2] = 1.0  # nothing beyond it
    seen = expected(mean, precision, viewpoint, scan, solid=solid)
    assert seen == pytest.approx(0.5 * math.log2(1 + gain / 4.0) + 0.5 * math.log2(1 + gain * 0.5 / 4.0))


@drawn(30)
@given(seeds, st.sampled_from([1, 2, 4, 8]), st.floats(1e-6, 1e6))
def test_several_scans_bring_what_one_with_as_many_rays_brings(seed, most, precise):
    """Also where products of ratios leave a float64, and where a part is left to teammates."""
    rng = np.random.default_rng(seed)
    mean, precision = random_cover(SIZE, 0.1, seed), rng.uniform(0.01, 5.0, SIZE).astype(np.float32) / precise
    viewpoint = (*rng.uniform(0.5, np.array(SIZE) - 0.5), rng.uniform(-3.0, 3.0), rng.uniform(-1.0, 1.0))
    cones = np.array([cone_of(np.array(viewpoint), 4.0, 0.3)])
    longest = longest_crossing(*SIZE, math.inf, 0)
    scratch = new_scan_scratch(mean.size, longest, len(model().pitches))
    scratch.scans[0] = most
    mark_cones(cones, SIZE, scratch.left)
    belief = Belief(mean.ravel(), precision.ravel(), SIZE)
    filled = fill_bits(belief, model(), np.array(viewpoint, float), scratch)
    assert filled == 1 + math.log2(most) and not scratch.added.any()
    single = [expected(mean, precision, viewpoint, model(rays=2.0**n), cones) for n in range(filled)]
    assert scratch.bits[:filled] == pytest.approx(single, rel=1e-5)


@pytest.mark.parametrize(("stop_probability", "sigma_min"), [(1.0, 0.1), (0.0, 1e25)])
def test_no_voxel_is_touched_twice_where_rays_bring_nothing(stop_probability, sigma_min):
    """Thousands of crossings by rays of which nothing is left, or whose precision float32 does not hold."""
    fine = RangeSensor((math.pi / 3, math.pi / 4), math.pi / 96, sigma_min=0.1)
    scan = model(stop_probability, known_precision=5.0, sensor=fine)._replace(sigma_min=sigma_min)
    voxels = math.prod(SIZE)
    scratch = new_scan_scratch(voxels, longest_crossing(*SIZE, math.inf, scan.voxels_behind), fine.rows)
    belief = Belief(np.zeros(voxels, np.float32), np.full(voxels, 4.0, np.float32), SIZE)
    viewpoint = np.array([1.5, 5.5, 2.5, 0.3, 0.0])
    scratch = scratch._replace(touched=np.full(20 * voxels, -1, np.int32))
    expected_bits(belief, scan, viewpoint, scratch)
    assert (scratch.touched[voxels + 1 :] == -1).all()
    assert not scratch.added.any()


def test_voxels_left_to_teammates_count_nothing():
    mean, precision = np.zeros(SIZE, np.float32), np.full(SIZE, 0.01, np.float32)
    viewpoint = (1.5, 5.5, 2.5, 0.0, 0.0)
    all_of_it = expected(mean, precision, viewpoint, model())
    everywhere = np.array([cone_of(np.array([3.5, 5.5, 2.5, 0.0, 0.0]), 100.0, math.pi)])
    assert expected(mean, precision, viewpoint, model(), everywhere) == 0.0
    beside = np.array([cone_of(np.array([1.5, 5.5, 2.5, math.pi, 0.0]), 100.0, 0.1)])
    assert expected(mean, precision, viewpoint, model(), beside) == pytest.approx(all_of_it, rel=0.05)
    short = np.array([cone_of(np.array([1.5, 5.5, 2.5, 0.0, 0.0]), 2.0, math.pi / 2)])
    assert 0.0 < expected(mean, precision, viewpoint, model(), short) < all_of_it


def test_what_an_uncertain_pose_adds_to_the_variance_of_a_ray():
    """One ray along x, 3.5 edges to the wall: σ² + 0.2 + 3.5² · 0.01; straight up its yaw does not matter."""
    one = RangeSensor((0.0, 0.0), math.pi / 24, sigma_min=0.1, sigma_slope_per_m=0.0, voxels_behind=0)
    mean, precision = np.zeros(SIZE), np.ones(SIZE)
    level, upwards = (3.5, 5.5, 2.5, 0.0, 0.0), (3.5, 5.5, 2.5, 0.0, -math.pi / 2)
    for at, voxels, off in ((level, 4, 0.2 + 3.5**2 * 0.01), (upwards, 3, 0.2)):
        scan = model(sensor=one, pose_variance=(0.2, 0.01))
        added = 1.0 / (0.1**2 + off)
        found = expected(mean.astype(np.float32), precision.astype(np.float32), at, scan)
        assert found == pytest.approx(voxels * 0.5 * math.log2(1.0 + added), rel=1e-5)


def row_belief(mean_of_second, known=True):
    """A row of 9 voxels along x: known and free but for the third, with its own mean."""
    size = (9, 1, 1)
    mean, precision = np.zeros(9, np.float32), np.full(9, 100.0, np.float32)
    mean[2] = mean_of_second
    if not known:
        precision[2] = 1.0 / 900.0
    return Belief(mean, precision, size), size


def one_ray(size):
    scan = MODEL.scan._replace(
        yaws=np.zeros(1), pitches=np.zeros(1), sensor_rays=1.0, max_range_m=4.5, voxels_behind=0
    )
    return MODEL._replace(scan=scan), np.array([[0.5, 0.5, 0.5, 0.0, 0.0]])


def imagined(belief, viewpoints, gap, model, size):
    scratch, scan = new_scratch(Grid(size, 0.5), [model]), model.scan._replace(gap_probability=gap)
    return [expected_bits(belief, scan, viewpoint, scratch) for viewpoint in viewpoints]


@pytest.mark.parametrize(("mean", "beyond"), [(0.0, 1.0), (0.1, 0.8), (0.5, 0.0)])
def test_a_partly_covered_voxel_stops_a_ray_with_twice_its_coverage(mean, beyond):
    """By hand: 3 voxels with the whole gain, 6 with what gets through."""
    belief, size = row_belief(mean)
    model, viewpoint = one_ray(size)
    gain = (model.scan.sigma_min + model.scan.sigma_slope_per_m * 4.25) ** -2
    expected = 1.5 * math.log2(1.0 + gain / 100.0) + 3.0 * math.log2(1.0 + beyond * gain / 100.0)
    assert imagined(belief, viewpoint, 0.9, model, size)[0] == pytest.approx(expected, rel=1e-5)


def test_an_unknown_voxel_beside_a_covered_one_hides_what_lies_behind():
    size = (9, 3, 1)
    mean, precision = np.zeros(size, np.float32), np.full(size, 100.0, np.float32)
    mean[4, 0, 0] = mean[4, 2, 0] = 1.0  # a wall, in which the middle was not hit
    precision[4, 1, 0] = 1.0 / 900.0
    precision[5:] = 1.0 / 900.0
    belief = Belief(mean.reshape(-1), precision.reshape(-1), size)
    model, viewpoint = one_ray(size)
    viewpoint[0, 1] = 1.5
    open_wall, closed = (imagined(belief, viewpoint, gap, model, size)[0] for gap in (0.1, 1.0))
    mean[4, 0, 0] = mean[4, 2, 0] = 0.0
    no_wall = imagined(belief, viewpoint, 1.0, model, size)[0]
    assert no_wall == pytest.approx(open_wall, rel=1e-6)
    gain = (model.scan.sigma_min + model.scan.sigma_slope_per_m * 4.25) ** -2
    known, unknown = 0.5 * math.log2(1.0 + gain / 100.0), 0.5 * math.log2(1.0 + gain * 900.0)
    assert closed == pytest.approx(4 * known + unknown, rel=1e-5)
