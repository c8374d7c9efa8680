"""Rays that are walked two at a time cross the voxels that each of them crosses alone."""

import math

import numpy as np
import pytest

from entropy_explore_env.belief.measurement_model import Return
from entropy_explore_env.robots.measured_rays import trace_measurement, trace_measurements
from entropy_explore_env.robots.range_sensor import (
    Scene,
    SensorPose,
    measure_ranges,
    new_scan,
    sensor_model,
    take_scan,
    true_coverage,
)
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.sensor import RangeSensor

SIZE, EDGE_M = (7, 11, 5), 0.5
WIDE = RangeSensor((2.0 * math.pi, math.pi / 2), math.pi / 9, max_range_m=2.6)
ODD = RangeSensor((math.pi, math.pi / 3), math.pi / 15, voxels_behind=3)
NOISY = RangeSensor((math.pi, math.pi / 3), math.pi / 12, range_noise_m=0.3, voxels_behind=0)


def scene_of(rng, share=0.1):
    occupied = rng.random(SIZE) < share
    unreadable = occupied & (rng.random(SIZE) < 0.3)
    bodies = np.append(rng.uniform(0.0, SIZE), 0.7).reshape(1, 4)
    return Scene(true_coverage(occupied, unreadable), SIZE, EDGE_M, bodies)


def pose_of(rng, on_faces):
    start = np.array(SIZE) * rng.uniform(0.02, 0.98, 3)
    start = np.floor(start) if on_faces else start
    return SensorPose(tuple(start.tolist()), float(rng.uniform(-3, 3)), 0.0 if on_faces else 0.2)


@pytest.mark.parametrize("sensor", [WIDE, ODD, NOISY])
def test_ranges_are_those_of_a_scan_that_notes_its_voxels(sensor):
    rng, found = np.random.default_rng(3), set()
    scans = [new_scan(Grid(SIZE, EDGE_M), [sensor], sensor.rays) for _ in range(2)]
    for case in range(60):
        scene, pose, model = scene_of(rng), pose_of(rng, case % 5 == 0), sensor_model(sensor)
        states = np.full((2, 1), case, np.uint64)
        take_scan(scans[0], model, scene, pose, states[0])
        measure_ranges(scans[1], model, scene, pose, states[1])
        for name in ("direction", "length", "range_m", "returned"):
            np.testing.assert_array_equal(scans[0].rays[name], scans[1].rays[name])
        assert states[0] == states[1]
        found.update(scans[0].rays["returned"].tolist())
    assert found >= {Return.NOTHING, Return.HIT} and (Return.FREE in found) == (sensor is WIDE)


@pytest.mark.parametrize("sensor", [WIDE, ODD, NOISY])
def test_measurements_traced_together_are_those_traced_alone(sensor):
    """From a place beside the one that they were taken from, as robots that drift trace them."""
    rng, model = np.random.default_rng(4), sensor_model(sensor)
    alone, together = (new_scan(Grid(SIZE, EDGE_M), [sensor], sensor.rays) for _ in range(2))
    for case in range(60):
        scene, pose = scene_of(rng), pose_of(rng, case % 5 == 0)
        measure_ranges(alone, model, scene, pose, np.full(1, case, np.uint64))
        for name in ("direction", "length", "returned"):
            together.rays[name] = alone.rays[name]
        beside = np.clip(np.array(pose.start) + rng.normal(0.0, 0.6, 3), 0.0, np.array(SIZE) - 1e-9)
        start, params = tuple(beside.tolist()), model.params[0]
        measured = np.flatnonzero(alone.rays["returned"] != Return.NOTHING)
        for index in measured:
            trace_measurement(alone, index, params, SIZE, EDGE_M, start, scene.occupied)
        trace_measurements(together, params, SIZE, EDGE_M, start)
        for name in ("range_m", "precision", "voxels", "free"):
            np.testing.assert_array_equal(alone.rays[name][measured], together.rays[name][measured])
        for index in measured:
            voxels, free = alone.rays["voxels"][index], alone.rays["free"][index]
            np.testing.assert_array_equal(alone.crossed[index, :voxels], together.crossed[index, :voxels])
            np.testing.assert_array_equal(
                alone.coverage[index, free:voxels], together.coverage[index, free:voxels]
            )
