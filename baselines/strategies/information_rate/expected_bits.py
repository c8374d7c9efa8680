"""What scans at viewpoints are expected to bring, how soon, and whether the way there is free, by a belief.

For strategies that weigh many viewpoints; grid units, seconds, bits.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from entropy_explore_env.belief.paths.lattice import KNOWN_RATIO, Lattice, new_lattice
from entropy_explore_env.belief.raycast import OPEN, STOP_AT_COVERED, cast_ray, longest_crossing
from entropy_explore_env.belief.visibility import CONE, SIGHT, cone_of, expected_scan_bits
from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.missions.view import TeammateView
from entropy_explore_env.robots.motion import driving_time, turning_time
from entropy_explore_env.scenario import Scenario
from entropy_explore_env.settings import Grid, RangeSensor, RobotKind, centred_angles


def sees_all_around(sensor: RangeSensor) -> bool:
    """Whether a sensor's rays leave no gap around it, so that its yaw does not matter."""
    return sensor.field_of_view_rad[0] > 2.0 * math.pi - 1.5 * sensor.angular_step_rad


class Build(NamedTuple):
    """What a kind of robot is, for kernels."""

    yaws: np.ndarray
    """(columns,) radians from the gaze: rays that stand for the sensor's."""
    pitches: np.ndarray
    """(rows,) likewise."""
    sight: np.ndarray
    """(1,) SIGHT."""
    lattice: Lattice
    crossing: int
    """Voxels that its rays cross at most."""


def build_of(scenario: Scenario, kind: RobotKind, thinning: int = 2, blocking: float = 0.02) -> Build:
    """What kernels need of a kind of robot.

    Args:
        scenario: The task.
        kind: Of robot.
        thinning: Of the columns and rows of the sensor's rays every so many-th is imagined.
        blocking: Probability that an unknown voxel stops a ray.
    """
    grid, sensor, sight = scenario.grid, kind.sensor, np.zeros(1, SIGHT)
    for name in ("max_range_m", "min_range_m", "sigma_min", "sigma_slope_per_m", "voxels_behind"):
        sight[name] = getattr(sensor, name)
    sight["known"], sight["blocking"] = KNOWN_RATIO / scenario.sigma_prior**2, blocking
    step, edge = sensor.angular_step_rad, grid.voxel_size_m
    columns, rows = (max(n // thinning, 1) for n in (sensor.columns, sensor.rows))
    sight["rays"] = sensor.rays / (columns * rows)
    return Build(
        yaws=centred_angles(columns, step) * sensor.columns / columns,
        pitches=centred_angles(rows, step) * sensor.rows / rows,
        sight=sight,
        lattice=new_lattice(grid.shape, kind.robot.body_radius_m / edge, scenario.layer_of(kind.robot)),
        crossing=longest_crossing(*grid.shape, sensor.max_range_m / edge, sensor.voxels_behind + 1),
    )


def new_scratch(grid: Grid, builds: Sequence[Build]) -> tuple[np.ndarray, ...]:
    """Working space of the kernels below, and of `expected_scan_bits`, for robots of these kinds."""
    longest = max(build.crossing for build in builds) + sum(grid.shape)
    return (
        np.zeros(grid.voxels, np.float32),
        np.zeros(grid.voxels, np.int32),
        np.zeros(longest, np.int32),
        np.zeros(longest, np.int64),
    )


def announced_cone(grid: Grid, mate: TeammateView) -> np.void:
    """The CONE that a teammate announced, in grid units: V(Yˢ, r̂, α̂) (RochaMI)."""
    cones = np.zeros(1, CONE)
    depth = mate.depth_m / grid.voxel_size_m
    cones[0] = cone_of(grid.in_grid_units(mate.viewpoint), depth, mate.half_angle_rad)
    return cones[0]


@lean_kernel
def free_by_belief(
    mean: np.ndarray,
    size: tuple[int, int, int],
    start: np.ndarray,
    direction: tuple[float, float, float],
    length: float,
    radius: float,
    scratch: tuple[np.ndarray, ...],
) -> bool:
    """Whether a ball-shaped body meets nothing believed covered on a straight way, and no boundary.

    Looked at along the way of its centre and, for bodies larger than half a voxel, of four points at
    its sides.
    """
    crossed, entered = scratch[2], scratch[3]
    x, y, z = direction
    level = math.sqrt(x * x + y * y)
    side = (-y / level, x / level, 0.0) if level > 1e-9 else (1.0, 0.0, 0.0)
    over = (y * side[2] - z * side[1], z * side[0] - x * side[2], x * side[1] - y * side[0])
    wide = radius > 0.5 + 1e-9
    for point in range(5 if wide else 1):
        by_side = radius * (1.0 if point == 1 else -1.0 if point == 2 else 0.0)
        by_over = radius * (1.0 if point == 3 else -1.0 if point == 4 else 0.0)
        if point > 2 and size[2] == 1:
            continue
        begin = (
            start[0] + by_side * side[0] + by_over * over[0],
            start[1] + by_side * side[1] + by_over * over[1],
            start[2] + by_side * side[2] + by_over * over[2],
        )
        for axis in range(3):
            if not 0.0 <= begin[axis] <= size[axis]:
                return False
        way = length + (radius if wide and point == 0 else 0.0)
        _, _, end = cast_ray(mean, STOP_AT_COVERED, size, begin, direction, way, False, 0, crossed, entered)
        if end != OPEN:
            return False
    return True


@lean_kernel
def weigh_viewpoints(
    mean: np.ndarray,
    precision: np.ndarray,
    size: tuple[int, int, int],
    voxel_size_m: float,
    here: np.ndarray,
    drawn: np.ndarray,
    yaw_offsets: np.ndarray,
    pitch_offsets: np.ndarray,
    sight: np.ndarray,
    cones: np.ndarray,
    limits: tuple[float, float, float, float, float],
    anywhere: bool,
    scratch: tuple[np.ndarray, ...],
    bits: np.ndarray,
    seconds: np.ndarray,
) -> None:
    """Fill (K,) expected bits of a scan at each of (K, 5) viewpoints, and the seconds until it is taken."""
    max_speed_m_s, acceleration_m_s2, turn_rate_rad_s, scan_time_s, radius = limits
    for k in range(len(drawn)):
        viewpoint = drawn[k]
        x, y, z = viewpoint[0] - here[0], viewpoint[1] - here[1], viewpoint[2] - here[2]
        length = math.sqrt(x * x + y * y + z * z)
        drive_s = driving_time(length * voxel_size_m, max_speed_m_s, acceleration_m_s2)
        turn_s = turning_time(here[3], here[4], viewpoint[3], viewpoint[4], turn_rate_rad_s)
        seconds[k] = max(drive_s, turn_s) + scan_time_s
        bits[k] = 0.0
        if length > 1e-9 and not anywhere:
            direction = (x / length, y / length, z / length)
            if not free_by_belief(mean, size, here, direction, length, radius, scratch):
                continue
        bits[k] = expected_scan_bits(
            mean,
            precision,
            size,
            voxel_size_m,
            viewpoint,
            yaw_offsets,
            pitch_offsets,
            sight[0],
            cones,
            scratch,
        )
