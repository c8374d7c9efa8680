"""The range sensor: a ray bundle around the gaze, cast through the truth (Rocha04, eqs. 3-5, table 1).

Directions: p̂ = [cos θ cos φ, sin θ cos φ, -sin φ] with yaw θ counter-clockwise and pitch φ
downwards (REP-103). Positions in grid units come from the map frame by (p - origin)/vsz.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from entropy_explore_env.belief.map_update import fuse_ray
from entropy_explore_env.belief.measurement_model import measured_coverage, measurement_precision
from entropy_explore_env.belief.raycast import (
    NEVER_STOP,
    OPEN,
    STOP_AT_COVERED,
    cast_ray,
    longest_crossing,
)
from entropy_explore_env.compilation.kernels import inlined_kernel, lean_kernel
from entropy_explore_env.randomness import draw_gaussian
from entropy_explore_env.settings import Grid, RangeSensor, centred_angles


class Return(enum.IntEnum):
    """What came back along a ray."""

    NOTHING = 0
    """A teammate's body was in the way, or the return was too near for the sensor: no measurement."""
    FREE = 1
    """No return within the sensor's range: all that the ray crossed is free."""
    HIT = 2
    """The distance of an obstacle or of the workspace's boundary."""


_NOTHING, _FREE, _HIT = int(Return.NOTHING), int(Return.FREE), int(Return.HIT)
_NEAREST = 1e-3
"""Noise makes no measurement shorter than this, in voxel edges."""


RAY = np.dtype(
    [
        ("direction", "f8", (3,)),  # unit vector, map frame
        ("length", "f8"),  # measured distance in grid units
        ("range_m", "f8"),  # the same in metres; 0 if nothing was measured
        ("returned", "i8"),  # a Return
        ("measured", "f8"),  # precision of the measured coverage
        ("free", "i8"),  # leading voxels that measure coverage 0
        ("voxels", "i8"),  # voxels on the ray
    ],
    align=True,
)
"""One ray of a scan, as it is worked on."""

SENSOR_NUMBERS = np.dtype(
    [
        ("max_range_m", "f8"),
        ("min_range_m", "f8"),
        ("noise_m", "f8"),
        ("sigma_min", "f8"),
        ("sigma_slope_per_m", "f8"),
        ("voxels_behind", "i8"),
        ("columns", "i8"),
        ("rows", "i8"),
    ],
    align=True,
)
"""The numbers of a RangeSensor."""


class Scan(NamedTuple):
    """Working space of one scan, or of one batch of received measurements; R rays, L voxels a ray."""

    rays: np.ndarray
    """(R,) RAY."""
    utility: np.ndarray
    """(R,) float64 bits that the measurement brought to the map that fused it last (Rocha04, eq. 27)."""
    crossed: np.ndarray
    """(R, L) int32 voxels on the ray."""
    coverage: np.ndarray
    """(R, L) float32 measured coverage, from index `free` on."""
    entered: np.ndarray
    """(L,) int64 ticks at which the latest ray entered its voxels."""
    way: np.ndarray
    """(W,) int32 voxels on the longest drive."""
    way_entered: np.ndarray
    """(W,) int64 ticks at which a drive enters them."""
    order: np.ndarray
    """(R,) int64 rays in the order in which they are fused or sent."""
    bodies: np.ndarray
    """(A, 4) float64 teammates' bodies: centre and radius in grid units."""


class SensorModel(NamedTuple):
    """A RangeSensor for compiled code."""

    yaw_offsets: np.ndarray
    """(columns,) float64, relative to the gaze."""
    pitch_offsets: np.ndarray
    """(rows,) float64."""
    numbers: np.ndarray
    """(1,) SENSOR_NUMBERS."""


class TeamSensors(NamedTuple):
    """The RangeSensors of A robots for compiled code, padded to the largest one."""

    yaw_offsets: np.ndarray
    """(A, columns) float64, relative to the gaze."""
    pitch_offsets: np.ndarray
    """(A, rows) float64."""
    numbers: np.ndarray
    """(A,) SENSOR_NUMBERS."""


def sensor_model(sensor: RangeSensor) -> SensorModel:
    """What compiled code needs of the sensor's settings."""
    numbers = np.zeros(1, SENSOR_NUMBERS)
    numbers["max_range_m"], numbers["noise_m"] = sensor.max_range_m, sensor.range_noise_m
    numbers["min_range_m"] = sensor.min_range_m
    numbers["sigma_min"], numbers["sigma_slope_per_m"] = sensor.sigma_min, sensor.sigma_slope_per_m
    numbers["voxels_behind"] = sensor.voxels_behind
    numbers["columns"], numbers["rows"] = sensor.columns, sensor.rows
    step = sensor.angular_step_rad
    return SensorModel(centred_angles(sensor.columns, step), centred_angles(sensor.rows, step), numbers)


def team_sensors(sensors: Sequence[RangeSensor]) -> TeamSensors:
    """What compiled code needs of the sensors of a team, robot by robot."""
    models = [sensor_model(sensor) for sensor in sensors]
    columns, rows = (max(len(model[axis]) for model in models) for axis in (0, 1))
    yaws, pitches = np.zeros((len(models), columns)), np.zeros((len(models), rows))
    for robot, model in enumerate(models):
        yaws[robot, : len(model.yaw_offsets)] = model.yaw_offsets
        pitches[robot, : len(model.pitch_offsets)] = model.pitch_offsets
    return TeamSensors(yaws, pitches, np.concatenate([model.numbers for model in models]))


@inlined_kernel
def sensor_of(sensors, robot):
    """The SensorModel of one robot of a team."""
    numbers = sensors.numbers[robot]
    return SensorModel(
        sensors.yaw_offsets[robot, : numbers.columns],
        sensors.pitch_offsets[robot, : numbers.rows],
        sensors.numbers[robot : robot + 1],
    )


@inlined_kernel
def first_rays(scan, count):
    """The working space of a scan of so many rays."""
    return Scan(
        scan.rays[:count],
        scan.utility[:count],
        scan.crossed,
        scan.coverage,
        scan.entered,
        scan.way,
        scan.way_entered,
        scan.order[:count],
        scan.bodies,
    )


def new_scan(
    grid: Grid, sensors: Sequence[RangeSensor], rays: int, robots: int, reach_m: float = 0.0
) -> Scan:
    """Working space for up to `rays` rays of any of the sensors, and for drives of at most `reach_m`."""
    longest = max(
        longest_crossing(*grid.shape, sensor.max_range_m / grid.voxel_size_m, sensor.voxels_behind)
        for sensor in sensors
    )
    farthest = longest_crossing(*grid.shape, reach_m / grid.voxel_size_m, 1)
    return Scan(
        rays=np.zeros(rays, RAY),
        utility=np.zeros(rays),
        crossed=np.zeros((rays, longest), np.int32),
        coverage=np.zeros((rays, longest), np.float32),
        entered=np.zeros(longest, np.int64),
        way=np.zeros(farthest, np.int32),
        way_entered=np.zeros(farthest, np.int64),
        order=np.zeros(rays, np.int64),
        bodies=np.zeros((robots, 4)),
    )


@inlined_kernel
def point_rays(model, yaw, pitch, rays):
    """Direct the (R,) rays of a bundle around a gaze, column by column, top row first."""
    rows = len(model.pitch_offsets)
    for column in range(len(model.yaw_offsets)):
        turn = yaw + model.yaw_offsets[column]
        along, across = math.cos(turn), math.sin(turn)
        for row in range(rows):
            direction = rays[column * rows + row].direction
            if column == 0:
                angle = pitch + model.pitch_offsets[row]
                level, down = math.cos(angle), math.sin(angle)
                rays[row].measured = level
                rays[row].range_m = down
            else:
                level, down = rays[row].measured, rays[row].range_m
            direction[0], direction[1], direction[2] = along * level, across * level, -down


@lean_kernel
def in_view(model, yaw, pitch, start, body):
    """Whether a body may be hit by a ray of the bundle around a gaze; True rather too often.

    A ray's angle from the gaze is at most the bundle's half diagonal in yaw and pitch.

    Args:
        model: The SensorModel.
        yaw: Of the gaze, radians.
        pitch: Of the gaze, radians.
        start: (x, y, z), the sensor in grid units.
        body: (4,) float64 centre and radius in grid units.
    """
    x, y, z = body[0] - start[0], body[1] - start[1], body[2] - start[2]
    distance = math.sqrt(x * x + y * y + z * z)
    if distance <= body[3]:
        return True
    half = math.sqrt(model.yaw_offsets[-1] ** 2 + model.pitch_offsets[-1] ** 2)
    widest = half + math.asin(body[3] / distance)
    ahead = (x * math.cos(yaw) + y * math.sin(yaw)) * math.cos(pitch) - z * math.sin(pitch)
    return widest >= math.pi or ahead >= distance * math.cos(widest) - 1e-9


@inlined_kernel
def body_distance(start, direction, bodies, count):
    """Distance in grid units to the first of `count` balls (x, y, z, radius) on a ray; inf if none."""
    nearest = math.inf
    for body in range(count):
        along, apart = 0.0, 0.0
        for axis in range(3):
            offset = bodies[body, axis] - start[axis]
            along += offset * direction[axis]
            apart += offset * offset
        inside = bodies[body, 3] * bodies[body, 3] - (apart - along * along)
        if along > 0.0 and inside > 0.0:
            nearest = min(nearest, max(along - math.sqrt(inside), 0.0))
    return nearest


@inlined_kernel
def weigh_measurement(scan, index, numbers, size, start):
    """Measured coverage (eq. 4) and its precision (eq. 5) for a ray whose crossing is filled in."""
    ray = scan.rays[index]
    ray.measured = measurement_precision(ray.range_m, numbers.sigma_min, numbers.sigma_slope_per_m)
    ray.free = ray.voxels
    if ray.returned == _HIT:
        ray.free = measured_coverage(
            start,
            ray.length,
            size,
            scan.crossed[index],
            scan.entered,
            ray.voxels,
            scan.coverage[index],
        )


@inlined_kernel
def trace_measurement(scan, index, numbers, size, voxel_size_m, start, coverage):
    """Voxels and measured coverage of a measurement whose distance is known.

    Args:
        scan: Holds direction, length and Return of the ray; the rest is filled in.
        index: Which ray.
        numbers: SENSOR_NUMBERS.
        size: (X, Y, Z) voxels.
        voxel_size_m: Edge of a voxel.
        start: (x, y, z), the sensor in grid units.
        coverage: (V,) float32, any map of the workspace; it does not matter what it holds.
    """
    ray = scan.rays[index]
    ray.range_m = ray.length * voxel_size_m
    _, ray.voxels, _ = cast_ray(
        coverage,
        NEVER_STOP,
        size,
        start,
        ray.direction,
        ray.length,
        ray.returned == _HIT,
        numbers.voxels_behind,
        scan.crossed[index],
        scan.entered,
    )
    weigh_measurement(scan, index, numbers, size, start)


@lean_kernel
def take_scan(scan, model, truth, size, voxel_size_m, start, yaw, pitch, bodies, chance):
    """Cast the bundle through the true world: what the sensor measures.

    Args:
        scan: Its rays and their crossings are filled in.
        model: The SensorModel.
        truth: (V,) float32 true coverage.
        size: (X, Y, Z) voxels.
        voxel_size_m: Edge of a voxel.
        start: (x, y, z), the sensor in grid units.
        yaw: Of the gaze, radians.
        pitch: Of the gaze, radians, downwards.
        bodies: How many of `scan.bodies` stand in the way.
        chance: (1,) uint64 random state; drawn from only where range noise is on.
    """
    numbers = model.numbers[0]
    point_rays(model, yaw, pitch, scan.rays)
    reach = numbers.max_range_m / voxel_size_m
    for index in range(len(scan.rays)):
        ray = scan.rays[index]
        length, ray.voxels, end = cast_ray(
            truth,
            STOP_AT_COVERED,
            size,
            start,
            ray.direction,
            reach,
            False,
            numbers.voxels_behind,
            scan.crossed[index],
            scan.entered,
        )
        ray.length = length
        ray.range_m = length * voxel_size_m
        error = numbers.noise_m * draw_gaussian(chance) if numbers.noise_m > 0.0 else 0.0
        ray.returned = _FREE if end == OPEN else _HIT
        if bodies > 0 and body_distance(start, ray.direction, scan.bodies, bodies) < length:
            ray.returned = _NOTHING
            ray.range_m = 0.0
        elif end == OPEN or error == 0.0:
            weigh_measurement(scan, index, numbers, size, start)
        else:
            ray.length = min(max(length + error / voxel_size_m, _NEAREST), reach)
            trace_measurement(scan, index, numbers, size, voxel_size_m, start, truth)
        if ray.returned == _HIT and ray.range_m < numbers.min_range_m:
            ray.returned = _NOTHING
            ray.range_m = 0.0


@lean_kernel
def fuse_scan(scan, count, mean, precision):
    """Fuse measurements into a belief, ray by ray (Rocha04, eqs. 17-18, 27 and 29).

    Args:
        scan: With crossings filled in; its `utility` is filled with the bits of each ray.
        count: How many rays of `scan.order`, in this order; those that measured nothing bring 0.
        mean: (V,) float32 expected coverage, changed in place.
        precision: (V,) float32 1/σ², changed in place.

    Returns:
        Bits taken from the map's entropy in all.
    """
    total = 0.0
    for i in range(count):
        index = scan.order[i]
        ray = scan.rays[index]
        scan.utility[index] = 0.0
        if ray.returned != _NOTHING:
            scan.utility[index] = fuse_ray(
                mean, precision, scan.crossed[index], scan.coverage[index], ray.free, ray.voxels, ray.measured
            )
            total += scan.utility[index]
    return total


@lean_kernel
def visibility_parameters(rays, yaw, pitch):
    """Depth and half-angle of what a scan saw (RochaMI, eq. 4).

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
