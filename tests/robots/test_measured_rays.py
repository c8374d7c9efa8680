"""Measurements that are traced again from where they were taken cross the voxels that the scan crossed."""

import math

import numpy as np
import pytest

from entropy_explore_env.belief.measurement_model import Return
from entropy_explore_env.robots.measured_rays import trace_measurements
from entropy_explore_env.robots.range_sensor import (
    Scene,
    SensorPose,
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


def pose_of(rng):
    start = np.array(SIZE) * rng.uniform(0.02, 0.98, 3)
    return SensorPose(tuple(start.tolist()), float(rng.uniform(-3, 3)), 0.2)


@pytest.mark.parametrize("sensor", [WIDE, ODD, NOISY])
def test_measurements_traced_again_are_those_of_the_scan(sensor):
    rng, model, found = np.random.default_rng(4), sensor_model(sensor), set()
    taken, traced = (new_scan(Grid(SIZE, EDGE_M), [sensor], sensor.rays) for _ in range(2))
    for case in range(60):
        scene, pose = scene_of(rng), pose_of(rng)
        take_scan(taken, model, scene, pose, np.full(1, case, np.uint64))
        for name in ("direction", "length", "returned"):
            traced.rays[name] = taken.rays[name]
        anything = rng.random(math.prod(SIZE)).astype(np.float32)
        trace_measurements(traced, model.params[0], SIZE, EDGE_M, pose.start, anything)
        measured = np.flatnonzero(taken.rays["returned"] != Return.NOTHING)
        for name in ("range_m", "precision", "voxels", "free"):
            np.testing.assert_array_equal(taken.rays[name][measured], traced.rays[name][measured])
        for index in measured:
            voxels, free = taken.rays["voxels"][index], taken.rays["free"][index]
            np.testing.assert_array_equal(taken.crossed[index, :voxels], traced.crossed[index, :voxels])
            np.testing.assert_array_equal(
                taken.coverage[index, free:voxels], traced.coverage[index, free:voxels]
            )
        found.update(taken.rays["returned"].tolist())
    assert found >= {Return.NOTHING, Return.HIT} and (Return.FREE in found) == (sensor is WIDE)
