"""Ray insertion: scans of the 2004 bundle, taken in the empty room, fused into one map.

Both sides get the same sensor positions and end points, and both insert every ray voxel by voxel.
One pass before the clock starts makes OctoMap's nodes, so that only updates are timed.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from benchmarks.peers import OctoMapTree
from benchmarks.rows import Effort, Goal, Row, compared, interleave, timed
from entropy_explore_env.belief.map_update import PRIOR_MEAN, Scan, fuse_scan
from entropy_explore_env.belief.measurement_model import Return
from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.robots.measured_rays import trace_measurement
from entropy_explore_env.robots.range_sensor import (
    Scene,
    SensorPose,
    new_scan,
    sensor_model,
    take_scan,
)
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.scenarios import ROOM
from entropy_explore_env.settings.sensor import RangeSensor

FINE_GRID = Grid((103, 103, 43), 0.1, ROOM.grid.origin_m)
"""The room of 10.25 × 10.25 × 4.25 m in voxels of 0.1 m, rounded up."""

_HIT = int(Return.HIT)
_STEEPEST_RAD = math.pi / 4


class Measurements(NamedTuple):
    """Scans that are known: S of them, R rays each; map frame, metres."""

    positions_m: np.ndarray
    """(S, 3) float64."""
    ends_m: np.ndarray
    """(S, R, 3) float64."""


def measure_room(grid: Grid, sensor: RangeSensor, scans: int, seed: int = 0) -> Measurements:
    """Return scans of an empty room from random places, in random directions up to 45° up or down."""
    rng = np.random.default_rng(seed)
    starts = rng.uniform(0.5, np.asarray(grid.shape) - 0.5, (scans, 3))
    yaws = rng.uniform(-math.pi, math.pi, scans)
    pitches = rng.uniform(-_STEEPEST_RAD, _STEEPEST_RAD, scans)
    truth, model, rng_state = np.zeros(grid.voxels, np.float32), sensor_model(sensor), np.zeros(1, np.uint64)
    scene = Scene(truth, grid.shape, grid.voxel_size_m, np.zeros((0, 4)))
    scan = new_scan(grid, [sensor], sensor.rays)
    positions = np.asarray(grid.origin_m) + starts * grid.voxel_size_m
    ends = np.zeros((scans, sensor.rays, 3))
    for i in range(scans):
        x, y, z = starts[i].tolist()
        take_scan(scan, model, scene, SensorPose((x, y, z), yaws[i], pitches[i]), rng_state)
        ends[i] = positions[i] + scan.rays["direction"] * scan.rays["range_m"][:, None]
    return Measurements(positions, ends)


@lean_kernel
def fuse_measurements(
    scan: Scan,
    params: np.void,
    grid: tuple[tuple[int, int, int], float, np.ndarray],
    positions_m: np.ndarray,
    ends_m: np.ndarray,
    mean: np.ndarray,
    precision: np.ndarray,
) -> int:
    """Trace, weigh and fuse known measurements, with the library's own functions.

    Args:
        scan: Working space for R rays.
        params: SENSOR_PARAMS.
        grid: ((X, Y, Z) voxels, voxel edge in metres, (3,) origin in metres).
        positions_m: (S, 3) float64.
        ends_m: (S, R, 3) float64.
        mean: (V,) float32, expected coverage; changed in place.
        precision: (V,) float32, 1/σ²; changed in place.

    Returns:
        How many voxels the rays crossed.
    """
    size, voxel_size_m, origin_m = grid
    voxels = 0
    for i in range(len(positions_m)):
        here = positions_m[i]
        start = (
            (here[0] - origin_m[0]) / voxel_size_m,
            (here[1] - origin_m[1]) / voxel_size_m,
            (here[2] - origin_m[2]) / voxel_size_m,
        )
        for index in range(ends_m.shape[1]):
            ray, end = scan.rays[index], ends_m[i, index]
            x, y, z = end[0] - here[0], end[1] - here[1], end[2] - here[2]
            range_m = math.sqrt(x * x + y * y + z * z)
            ray.direction[0], ray.direction[1], ray.direction[2] = x / range_m, y / range_m, z / range_m
            ray.length = range_m / voxel_size_m
            ray.returned = _HIT
            trace_measurement(scan, index, params, size, voxel_size_m, start, mean)
            voxels += ray.voxels
            scan.order[index] = index
        fuse_scan(scan, ends_m.shape[1], mean, precision)
    return voxels


class Fusion:
    """Our side: one map, and the measurements that are fused into it."""

    def __init__(self, grid: Grid, sensor: RangeSensor, measurements: Measurements) -> None:
        """Start at the prior; one pass warms the map, the caches and the compiler."""
        self._measurements = measurements
        self._scan = new_scan(grid, [sensor], sensor.rays)
        self.mean = np.full(grid.voxels, PRIOR_MEAN, np.float32)
        self.precision = np.full(grid.voxels, ROOM.sigma_prior**-2, np.float32)
        self._params = sensor_model(sensor).params[0]
        self._grid = (grid.shape, grid.voxel_size_m, np.asarray(grid.origin_m, np.float64))
        self.voxels = self.fuse()

    def fuse(self) -> int:
        """Fuse the scans; returns how many voxels they crossed."""
        return fuse_measurements(
            self._scan, self._params, self._grid, *self._measurements, self.mean, self.precision
        )


def fusion_rows(effort: Effort) -> list[Row]:
    """Return rows of rays a second beside OctoMap, in coarse and in fine voxels."""
    return [fusion_row(grid, effort) for grid in (ROOM.grid, FINE_GRID)]


def fusion_row(grid: Grid, effort: Effort) -> Row:
    """Return the row of one grid."""
    sensor = ROOM.sensor
    measurements = measure_room(grid, sensor, effort.scans)
    fusion, tree = Fusion(grid, sensor, measurements), OctoMapTree(grid.voxel_size_m)

    def insert() -> None:
        tree.insert(measurements.positions_m, measurements.ends_m)

    insert()
    jobs = {"ours": lambda _: timed(fusion.fuse), "octomap": lambda _: timed(insert)}
    taken = interleave(jobs, effort.rounds)
    rays = math.prod(measurements.ends_m.shape[:2])
    ours, theirs = ([rays / each.cpu_s for each in taken[name]] for name in jobs)
    job = f"fusion, {sensor.rays}-ray scans, voxels of {grid.voxel_size_m:g} m"
    return compared(job, "octomap-python insertPointCloud", ours, theirs, "rays/s", Goal("≥", 5.0))
