"""Ray insertion: scans of the 2004 bundle, taken in the empty room, fused into one map.

Both sides get the same sensor positions and end points, and both insert every ray voxel by voxel.
One pass before the clock starts makes OctoMap's nodes, so that only updates are timed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from benchmarks.peers import OctoMapTree
from benchmarks.rows import Effort, Goal, Row, compared, interleave, timed
from entropy_explore_env.belief.map_update import PRIOR_MEAN, Scan, fuse_scan
from entropy_explore_env.belief.measurement_model import Return, measurement_precision
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
GRIDS = (ROOM.grid, FINE_GRID)

_HIT = int(Return.HIT)
_FLOOR_SCANS = 8
_FLOOR_PASSES = 400
_STEEPEST_RAD = math.pi / 4


@dataclass(frozen=True)
class Measurements:
    """Scans that are known: S of them, R rays each; map frame, metres."""

    positions_m: np.ndarray
    """(S, 3) float64."""
    ends_m: np.ndarray
    """(S, R, 3) float64."""

    @property
    def rays(self) -> int:
        """How many rays there are in all."""
        return self.ends_m.shape[0] * self.ends_m.shape[1]


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


@lean_kernel
def fuse_floor(
    crossed: np.ndarray,
    ends: np.ndarray,
    gain: np.float32,
    mean: np.ndarray,
    precision: np.ndarray,
    passes: int,
) -> float:
    """Return the least that fusion has to do: two adds, one division and one product a voxel, nothing else.

    Args:
        crossed: (N,) int32 voxels of one scan's rays, one after the other.
        ends: (R,) int64, where each ray's voxels end in `crossed`.
        gain: Precision that is added.
        mean: (V,) float32, changed in place.
        precision: (V,) float32, changed in place.
        passes: How often; all but the first find everything in cache.

    Returns:
        Sum of the rays' products, so that none is optimised away.
    """
    total = 0.0
    for _ in range(passes):
        first = 0
        for end in ends:
            shrink = 1.0
            for i in range(first, end):
                voxel = np.uint32(crossed[i])
                after = precision[voxel] + gain
                share = precision[voxel] / after
                precision[voxel] = after
                mean[voxel] += share
                shrink *= share
            total += shrink
            first = end
    return total


class Fusion:
    """Our side: one map, and the measurements that are fused into it."""

    def __init__(self, grid: Grid, sensor: RangeSensor, measurements: Measurements) -> None:
        """Start at the prior; one pass warms the map, the caches and the compiler."""
        self.measurements = measurements
        self.scan = new_scan(grid, [sensor], sensor.rays)
        self.mean = np.full(grid.voxels, PRIOR_MEAN, np.float32)
        self.precision = np.full(grid.voxels, ROOM.sigma_prior**-2, np.float32)
        self._params = sensor_model(sensor).params[0]
        self._grid = (grid.shape, grid.voxel_size_m, np.asarray(grid.origin_m, np.float64))
        self.voxels = self.fuse()

    def fuse(self, first: int = 0, last: int | None = None) -> int:
        """Fuse some of the scans; returns how many voxels they crossed."""
        positions, ends = self.measurements.positions_m[first:last], self.measurements.ends_m[first:last]
        return fuse_measurements(
            self.scan, self._params, self._grid, positions, ends, self.mean, self.precision
        )


class Floor:
    """The floor: the voxels of a few scans, found beforehand, with everything in cache."""

    def __init__(self, fusion: Fusion, sensor: RangeSensor) -> None:
        """Note the voxels of each scan, ray after ray, and where each ray ends."""
        self._lists: list[tuple[np.ndarray, np.ndarray]] = []
        for number in range(_FLOOR_SCANS):
            fusion.fuse(number, number + 1)
            counts = fusion.scan.rays["voxels"]
            rays = [row[:count] for row, count in zip(fusion.scan.crossed, counts, strict=True)]
            self._lists.append((np.concatenate(rays), np.cumsum(counts)))
        self._mean, self._precision = fusion.mean.copy(), fusion.precision.copy()
        self._gain = np.float32(measurement_precision(3.0, sensor.sigma_min, sensor.sigma_slope_per_m, 1.0))
        self.voxels = _FLOOR_PASSES * sum(len(crossed) for crossed, _ in self._lists)
        self.run()

    def run(self) -> None:
        """Fuse one scan after the other, each many times."""
        for crossed, ends in self._lists:
            fuse_floor(crossed, ends, self._gain, self._mean, self._precision, _FLOOR_PASSES)


def fusion_rows(effort: Effort) -> list[Row]:
    """Return rows of rays a second beside OctoMap, and of nanoseconds a voxel beside the floor."""
    return [row for grid in GRIDS for row in grid_rows(grid, effort)]


def grid_rows(grid: Grid, effort: Effort) -> list[Row]:
    """Return both rows of one grid."""
    sensor = ROOM.sensor
    measurements = measure_room(grid, sensor, effort.scans)
    fusion, tree = Fusion(grid, sensor, measurements), OctoMapTree(grid.voxel_size_m)
    floor = Floor(fusion, sensor)

    def insert() -> None:
        tree.insert(measurements.positions_m, measurements.ends_m)

    insert()
    jobs = {"ours": fusion.fuse, "floor": floor.run, "octomap": insert}
    taken = interleave({name: lambda _, job=job: timed(job) for name, job in jobs.items()}, effort.rounds)
    seconds = {name: np.array([each.cpu_s for each in own]) for name, own in taken.items()}
    ours, theirs = ((measurements.rays / seconds[name]).tolist() for name in ("ours", "octomap"))
    ours_ns, floor_ns = (1e9 * seconds["ours"] / fusion.voxels), (1e9 * seconds["floor"] / floor.voxels)
    where = f"{sensor.rays}-ray scans, voxels of {grid.voxel_size_m:g} m"
    a_voxel = f"fusion a voxel, {where} ({fusion.voxels / measurements.rays:.1f} voxels a ray)"
    peer, least = "octomap-python insertPointCloud", "two adds, a division, a product, in cache"
    return [
        compared(f"fusion, {where}", peer, ours, theirs, "rays/s", Goal("≥", 5.0)),
        compared(a_voxel, least, ours_ns.tolist(), floor_ns.tolist(), "ns", Goal("≤", 6.0)),
    ]
