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
from entropy_explore_env.belief.fields import Belief
from entropy_explore_env.belief.map_update import PRIOR_MEAN, Scan
from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.robots.given_scans import aim_at_points, fuse_given
from entropy_explore_env.robots.range_sensor import (
    Scene,
    SensorModel,
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
def fuse_scans(
    scan: Scan,
    model: SensorModel,
    scans: Measurements,
    starts: np.ndarray,
    edge_m: float,
    ranges_m: np.ndarray,
    belief: Belief,
) -> None:
    """Fuse the points of scans into a belief, with the library's own functions.

    The working space `scan` has R rays, as `ranges_m`, (R,) float64; `starts`, (S, 3) float64, are the
    places of the scans in grid units.
    """
    for i in range(len(starts)):
        frame = belief.size, edge_m, (starts[i, 0], starts[i, 1], starts[i, 2])
        aim_at_points(scan.rays, scans.positions_m[i], scans.ends_m[i], ranges_m)
        fuse_given(scan, model, frame, (0.0, 0.0), ranges_m, False, belief.mean, belief.precision)


class Fusion:
    """Our side: one map, and the measurements that are fused into it."""

    def __init__(self, grid: Grid, sensor: RangeSensor, measurements: Measurements) -> None:
        """Start at the prior; one pass warms the map, the caches and the compiler."""
        mean, precision = np.full((2, grid.voxels), PRIOR_MEAN, np.float32)
        precision[:] = ROOM.sigma_prior**-2
        self.belief = Belief(mean, precision, grid.shape)
        starts = (measurements.positions_m - grid.origin_m) / grid.voxel_size_m
        scan, ranges_m = new_scan(grid, [sensor], sensor.rays), np.zeros(sensor.rays)
        scans = measurements, starts, grid.voxel_size_m
        self._given = scan, sensor_model(sensor), *scans, ranges_m, self.belief
        self.fuse()

    def fuse(self) -> None:
        """Fuse the scans."""
        fuse_scans(*self._given)


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
