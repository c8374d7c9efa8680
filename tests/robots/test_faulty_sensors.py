"""Scans that a faulty sensor spoils, by hand: lost rays, distances that are measured wrong."""

import numpy as np
import pytest

from entropy_explore_env.belief.measurement_model import Return
from entropy_explore_env.robots.faults import FAULT_PARAMS, drop_scan, spoil_scan
from entropy_explore_env.robots.range_sensor import Scene, SensorPose, new_scan, sensor_model, take_scan
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.sensor import RangeSensor

GRID = Grid((7, 11, 5), 0.5)
SENSOR = RangeSensor(field_of_view_rad=(0.6, 0.2), angular_step_rad=0.1, voxels_behind=1)
HERE = SensorPose((1.5, 2.5, 2.5), np.pi / 2, 0.0)


def scanned(wall=8, sensor=SENSOR):
    """A scan towards a wall at y = `wall` voxels, 5.5 voxels (2.75 m) ahead of the sensor."""
    solid = np.zeros(GRID.shape, np.float32)
    solid[:, wall:] = 1.0
    model, scene = sensor_model(sensor), Scene(solid.ravel(), GRID.shape, GRID.voxel_size_m, np.zeros((0, 4)))
    scan = new_scan(GRID, [sensor], sensor.rays)
    take_scan(scan, model, scene, HERE, np.zeros(1, np.uint64))
    return scan, model.params[0], scene


def spoiled(seed=0, sensor=SENSOR, **settings):
    """How many rays were lost, the scan, and its distances before."""
    fault = np.zeros(1, FAULT_PARAMS)
    fault["range_factor"] = 1.0
    for name, value in settings.items():
        fault[name] = value
    scan, params, scene = scanned(sensor=sensor)
    before = scan.rays["range_m"].copy()
    rng = np.array([seed], np.uint64)
    lost = spoil_scan(scan, fault[0], params, scene, HERE.start, rng)
    return lost, scan, before, int(rng[0])


def test_a_sensor_without_faults_measures_what_it_measures():
    lost, scan, before, rng = spoiled(seed=5)
    assert (lost, rng) == (0, 5) and (scan.rays["range_m"] == before).all()
    assert (scan.rays["returned"] == int(Return.HIT)).any()


def test_rays_that_measured_nothing_are_neither_lost_nor_scaled():
    scan, params, scene = scanned()
    fault = np.zeros(1, FAULT_PARAMS)
    fault["range_factor"], fault["lost_rays"] = 2.0, 1.0
    scan.rays["returned"][::2], scan.rays["range_m"][::2] = int(Return.NOTHING), 0.0
    lost = spoil_scan(scan, fault[0], params, scene, HERE.start, np.array([3], np.uint64))
    assert lost == len(scan.rays) // 2
    assert (scan.rays["range_m"] == 0.0).all() and (scan.rays["returned"] == int(Return.NOTHING)).all()


@pytest.mark.parametrize(
    ("factor", "bias_m"), [(1.1, 0.0), (1.0, -0.3), (0.9, 0.25), (0.1, -1e6), (10.0, 0.0)]
)
def test_distances_of_hits_are_scaled_and_shifted_and_the_ray_is_that_of_the_wrong_distance(factor, bias_m):
    _, scan, before, rng = spoiled(range_factor=factor, range_bias_m=bias_m)
    hits = scan.rays["returned"] == int(Return.HIT)
    assert hits.all() and rng == 0
    expected = np.maximum(before * factor + bias_m, 1e-3 * GRID.voxel_size_m)
    assert scan.rays["range_m"] == pytest.approx(expected)
    middle = len(scan.rays) // 2
    ahead = 2.5 + expected[middle] / GRID.voxel_size_m  # the middle ray runs along y
    last = scan.crossed[middle][scan.rays[middle]["voxels"] - 1]
    y = np.unravel_index(last, GRID.shape)[1]
    if ahead < GRID.shape[1]:
        assert 0 <= y - int(ahead) <= 1  # the voxel of the hit, and the one behind
    else:
        assert y == GRID.shape[1] - 1


def test_the_wrong_distance_is_within_the_sensor_s_range_and_not_too_near():
    far = RangeSensor(field_of_view_rad=(0.6, 0.2), angular_step_rad=0.1, max_range_m=3.2)
    _, scan, before, _ = spoiled(sensor=far, range_factor=1.5)
    assert scan.rays["range_m"] == pytest.approx(np.where(before > 0, 3.2, 0.0))
    near = RangeSensor(field_of_view_rad=(0.6, 0.2), angular_step_rad=0.1, min_range_m=1.0)
    _, scan, _, _ = spoiled(sensor=near, range_factor=0.3)
    assert (scan.rays["returned"] == int(Return.NOTHING)).all() and (scan.rays["range_m"] == 0.0).all()


def test_rays_are_lost_with_their_probability_each_on_its_own():
    assert spoiled(lost_rays=1.0)[0] == SENSOR.rays
    shares = []
    for seed in range(200):
        lost, scan, before, _ = spoiled(seed, lost_rays=0.25)
        gone = scan.rays["returned"] == int(Return.NOTHING)
        assert gone.sum() == lost and (scan.rays["range_m"][~gone] == before[~gone]).all()
        assert (scan.rays["range_m"][gone] == 0.0).all()
        shares.append(gone)
    assert np.mean(shares) == pytest.approx(0.25, abs=0.03)
    assert np.abs(np.mean(shares, axis=0) - 0.25).max() < 0.15


def test_a_blind_sensor_measures_nothing():
    scan, _, _ = scanned()
    drop_scan(scan)
    assert (scan.rays["returned"] == int(Return.NOTHING)).all() and (scan.rays["range_m"] == 0.0).all()
