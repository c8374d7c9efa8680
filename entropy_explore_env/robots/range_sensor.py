"""The range sensor: a ray bundle around the gaze, cast through the truth (Rocha04, eqs. 3-5, table 1).

Directions: p̂ = [cos θ cos φ, sin θ cos φ, -sin φ] with yaw θ counter-clockwise and pitch φ
downwards (REP-103). Positions in grid units come from the map frame by (p - origin)/vsz.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from entropy_explore_env.belief.map_update import RAY, Scan
from entropy_explore_env.belief.measurement_model import Return
from entropy_explore_env.belief.raycast import (
    OBSTACLE,
    OPEN,
    OPEN_END,
    STOP_AT_COVERED,
    Crossing,
    Line,
    RayEnd,
    cast_ray,
    longest_crossing,
    point,
)
from entropy_explore_env.compilation.kernels import inlined_kernel, lean_kernel, record_type
from entropy_explore_env.randomness import draw_gaussian
from entropy_explore_env.robots.measured_rays import trace_measurement, weigh_measurement
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.sensor import RangeSensor, centred_angles

_NOTHING, _FREE, _HIT = int(Return.NOTHING), int(Return.FREE), int(Return.HIT)
NEAREST = 1e-3
"""Noise makes no measurement shorter than this, in voxel edges."""
_UNREADABLE = 2.0
"""True coverage of a solid voxel that gives no return; 1 is that of others."""

SENSOR_PARAMS = record_type(
    [
        ("max_range_m", "f8"),
        ("min_range_m", "f8"),
        ("range_noise_m", "f8"),
        ("sigma_min", "f8"),
        ("sigma_slope_per_m", "f8"),
        ("sigma_exponent", "f8"),
        ("voxels_behind", "i8"),
        ("columns", "i8"),
        ("rows", "i8"),
    ],
)
"""The parameters of a RangeSensor, by the names of its fields and properties."""


class SensorModel(NamedTuple):
    """A RangeSensor for compiled code, or those of A robots: with an axis A, padded to the largest one."""

    yaw_offsets: np.ndarray
    """(columns,) float64, relative to the gaze."""
    pitch_offsets: np.ndarray
    """(rows,) float64."""
    params: np.ndarray
    """(1,) SENSOR_PARAMS, or (A,)."""


class SensorPose(NamedTuple):
    """Where a sensor is and looks."""

    start: tuple[float, float, float]
    """Grid units."""
    yaw: float
    pitch: float


class Scene(NamedTuple):
    """What a sensor scans: the true world, and the teammates' bodies in it."""

    occupied: np.ndarray
    """(V,) float32 `true_coverage`."""
    size: tuple[int, int, int]
    """(X, Y, Z) voxels."""
    voxel_size_m: float
    bodies: np.ndarray
    """(B, 4) float64: centre and radius in grid units of each body."""


def true_coverage(occupied: np.ndarray, unreadable: np.ndarray | None) -> np.ndarray:
    """Return (V,) float32, what rays are cast through: 0 free, 1 solid, 2 solid but unreadable."""
    coverage = occupied.ravel().astype(np.float32)
    if unreadable is not None:
        coverage[unreadable.ravel()] = _UNREADABLE
    return coverage


def sensor_model(sensor: RangeSensor) -> SensorModel:
    """Return what compiled code needs of the sensor's settings."""
    params, step = np.zeros(1, SENSOR_PARAMS), sensor.angular_step_rad
    for name in SENSOR_PARAMS.names or ():
        params[name] = getattr(sensor, name)
    return SensorModel(centred_angles(sensor.columns, step), centred_angles(sensor.rows, step), params)


def team_sensors(sensors: Sequence[RangeSensor]) -> SensorModel:
    """Return the SensorModel of a team, robot by robot."""
    models = [sensor_model(sensor) for sensor in sensors]
    columns, rows = (max(len(model[axis]) for model in models) for axis in (0, 1))
    yaws, pitches = np.zeros((len(models), columns)), np.zeros((len(models), rows))
    for robot, model in enumerate(models):
        yaws[robot, : len(model.yaw_offsets)] = model.yaw_offsets
        pitches[robot, : len(model.pitch_offsets)] = model.pitch_offsets
    return SensorModel(yaws, pitches, np.concatenate([model.params for model in models]))


@inlined_kernel
def sensor_of(sensors, robot):
    """Return the SensorModel of one robot of a team."""
    params = sensors.params[robot]
    return SensorModel(
        sensors.yaw_offsets[robot, : params.columns],
        sensors.pitch_offsets[robot, : params.rows],
        sensors.params[robot : robot + 1],
    )


@inlined_kernel
def first_rays(scan, count):
    """Return the working space of a scan of this many rays."""
    return Scan(
        scan.rays[:count],
        scan.utility[:count],
        scan.crossed,
        scan.entered,
        scan.coverage,
        scan.order[:count],
    )


def new_scan(grid: Grid, sensors: Sequence[RangeSensor], rays: int) -> Scan:
    """Return working space for up to `rays` rays of any of the sensors."""
    longest = max(
        longest_crossing(*grid.shape, sensor.max_range_m / grid.voxel_size_m, sensor.voxels_behind)
        for sensor in sensors
    )
    return Scan(
        rays=np.zeros(rays, RAY),
        utility=np.zeros(rays),
        crossed=np.zeros((rays, longest), np.int32),
        entered=np.zeros(longest, np.int64),
        coverage=np.zeros((rays, longest), np.float32),
        order=np.zeros(rays, np.int64),
    )


def scan_bytes(grid: Grid, sensors: Sequence[RangeSensor], rays: int) -> int:
    """Return the bytes of the arrays of `new_scan`."""
    one = new_scan(grid, sensors, 1)
    return rays * sum(array.nbytes for array in one) - (rays - 1) * one.entered.nbytes


@inlined_kernel
def point_rays(model, yaw, pitch, rays):
    """Direct the (R,) rays of a bundle around a gaze, column by column, top row first."""
    rows = len(model.pitch_offsets)
    for column in range(len(model.yaw_offsets)):
        turn = yaw + model.yaw_offsets[column]
        along, across = math.cos(turn), math.sin(turn)
        for row in range(rows):
            ray = rays[column * rows + row]
            if column == 0:
                angle = pitch + model.pitch_offsets[row]
                ray.cos_pitch = math.cos(angle)
                ray.direction[2] = -math.sin(angle)
            else:
                ray.cos_pitch = rays[row].cos_pitch
                ray.direction[2] = rays[row].direction[2]
            ray.direction[0], ray.direction[1] = along * ray.cos_pitch, across * ray.cos_pitch


@inlined_kernel
def body_distance(start, direction, bodies):
    """Return grid units to the first of the balls (B, 4) on a ray (see Scene); inf if there is none."""
    nearest = math.inf
    for body in range(len(bodies)):
        along, apart = 0.0, 0.0
        for axis in range(3):
            offset = bodies[body, axis] - start[axis]
            along += offset * direction[axis]
            apart += offset * offset
        inside = bodies[body, 3] * bodies[body, 3] - (apart - along * along)
        if along > 0.0 and inside > 0.0:
            nearest = min(nearest, max(along - math.sqrt(inside), 0.0))
    return nearest


@lean_kernel
def take_scan(scan, model, scene, pose, rng):
    """Cast the bundle through the true world: what the sensor measures.

    Args:
        scan: Scan; its rays and their crossings are filled in.
        rng: (1,) uint64 random state; drawn from only where range noise is on.
    """
    params, start = model.params[0], pose.start
    behind = max(params.voxels_behind, 1)  # the voxel that a ray ends at is among those behind its end
    point_rays(model, pose.yaw, pose.pitch, scan.rays)
    reach = params.max_range_m / scene.voxel_size_m
    for index in range(len(scan.rays)):
        ray = scan.rays[index]
        length, voxels, end = cast_ray(
            scene.occupied,
            scene.size,
            Line(start, point(ray.direction), reach),
            STOP_AT_COVERED,
            OPEN_END,
            behind,
            Crossing(scan.crossed[index], scan.entered),
        )
        no_return = end == OBSTACLE and ends_unreadable(scene.occupied, scan.crossed[index], voxels, behind)
        ray.voxels = voxels - 1 if end == OBSTACLE and params.voxels_behind == 0 else voxels
        moved = measure_ray(ray, params, scene, start, RayEnd(length, voxels, end), no_return, rng)
        if ray.returned == _NOTHING:
            continue
        if moved:
            trace_measurement(scan, index, params, scene.size, scene.voxel_size_m, start, scene.occupied)
        else:
            weigh_measurement(scan, index, params, scene.size, start, scan.entered)


@inlined_kernel
def measure_ray(ray, params, scene, start, end, no_return, rng):
    """Return what comes back along a ray that was cast through the true world, and from how far away.

    Args:
        ray: RAY; length, distance and Return are filled in.
        end: RayEnd.
        no_return: Whether it ended at a voxel that gives no return.

    Returns:
        Whether noise has moved its end: then the voxels that were crossed are not those of the measurement.
    """
    reach = params.max_range_m / scene.voxel_size_m
    ray.length, ray.range_m = end.length, end.length * scene.voxel_size_m
    error = params.range_noise_m * draw_gaussian(rng) if params.range_noise_m > 0.0 else 0.0
    ray.returned = _FREE if end.reason == OPEN else _HIT
    moved, direction = False, point(ray.direction)
    if no_return or (len(scene.bodies) > 0 and body_distance(start, direction, scene.bodies) < end.length):
        ray.returned = _NOTHING
        ray.range_m = 0.0
    elif end.reason != OPEN and error != 0.0:
        moved = True
        ray.length = min(max(end.length + error / scene.voxel_size_m, NEAREST), reach)
        ray.range_m = ray.length * scene.voxel_size_m
    if ray.returned == _HIT and ray.range_m < params.min_range_m:
        ray.returned = _NOTHING
        ray.range_m = 0.0
    return moved


@inlined_kernel
def ends_unreadable(occupied, crossed, n, behind):
    """Return whether the covered voxel that a ray ended at gives no return.

    It is the first covered one of the last `behind` of the `n` voxels noted, which are all behind the end.
    """
    for i in range(max(n - behind, 1), n):
        covered = occupied[np.uint32(crossed[i])]
        if covered > STOP_AT_COVERED:
            return covered >= _UNREADABLE
    return False


@lean_kernel
def visibility_parameters(rays, yaw, pitch):
    """Return the depth and half-angle of what a scan saw (RochaMI, eq. 4).

    Returns:
        (r̂, α̂, measurements): mean measured distance in metres, largest angle in radians between
        the gaze and a measured ray, and how many rays measured.
    """
    gaze_x, gaze_y, gaze_z = (
        math.cos(yaw) * math.cos(pitch),
        math.sin(yaw) * math.cos(pitch),
        -math.sin(pitch),
    )
    total, narrowest, measurements = 0.0, 1.0, 0
    for ray in rays:
        if ray.returned != _NOTHING:
            total += ray.range_m
            direction = ray.direction
            narrowest = min(narrowest, direction[0] * gaze_x + direction[1] * gaze_y + direction[2] * gaze_z)
            measurements += 1
    if measurements == 0:
        return 0.0, 0.0, 0
    return total / measurements, math.acos(max(narrowest, -1.0)), measurements
