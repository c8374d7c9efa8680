"""Models of a robot's scans and drives, the seconds until a scan is taken, and whether a line is free.

Grid units. In all functions `belief` is a Belief, `drive` a DriveModel, `size` the voxels along each axis and
`scratch` a ScanScratch.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from entropy_explore_env.belief.paths.lattice import KNOWN_RATIO, Lattice, longest_edge, new_lattice
from entropy_explore_env.belief.raycast import (
    NONE_BEHIND,
    OPEN,
    OPEN_END,
    STOP_AT_COVERED,
    Crossing,
    Line,
    cast_ray,
    distance_between,
    longest_crossing,
    point,
)
from entropy_explore_env.belief.voxel_index import flat_index
from entropy_explore_env.compilation.kernels import inlined_kernel, lean_kernel
from entropy_explore_env.robots.motion import driving_time, turning_time
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.robot_kind import RobotKind
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.settings.sensor import RangeSensor, centred_angles
from entropy_explore_env.viewpoints.expected_scan import ScanModel, ScanScratch, new_scan_scratch

STRAIGHTENED = 0.96
"""Length of a path after string pulling, as a share of the sum of its steps."""


_CELLS_WITHIN = 20
"""Number of cells within reach from which on paths are searched in cells of several voxels."""


class DriveModel(NamedTuple):
    """How long drives and the scans at their ends take."""

    max_speed_m_s: float
    acceleration_m_s2: float
    turn_rate_rad_s: float
    scan_time_s: float
    body_radius: float
    """Voxel edges."""


class RobotModel(NamedTuple):
    """A kind of robot, as its viewpoints are evaluated."""

    scan: ScanModel
    drive: DriveModel
    lattice: Lattice
    """Its steps between voxel centres."""
    longest_ray: int
    """Largest number of voxels that one of its rays crosses."""


def sees_all_around(sensor: RangeSensor) -> bool:
    """Return whether a sensor's rays leave no gap around it, so that its yaw does not matter."""
    return sensor.field_of_view_rad[0] > 2.0 * math.pi - 1.5 * sensor.angular_step_rad


def places_within(grid: Grid, reach_m: float) -> float:
    """Return the largest distance, in voxel edges, at which places are compared for one drive."""
    return float(min(reach_m / grid.voxel_size_m, 0.25 * max(grid.shape)))


def cell_edge(scenario: Scenario, kind: RobotKind) -> int:
    """Return the edge, in voxels, of the cells in which paths to viewpoints are searched.

    It is 1 but for robots that fly and plan in grids whose voxels are small for their reach: the larger the
    body is, the longer edges may be.
    """
    grid, robot = scenario.grid, kind.robot
    if scenario.layer_of(robot) is not None or robot.navigator != "planned":
        return 1
    cells = int(places_within(grid, robot.reach_m) / _CELLS_WITHIN)
    return max(1, min(longest_edge(robot.planning_radius_m / grid.voxel_size_m), cells))


def robot_model(
    scenario: Scenario,
    kind: RobotKind,
    thinning: int = 2,
    stop_probability: float = 0.02,
    gap_probability: float | None = None,
) -> RobotModel:
    """Return the model of a kind of robot.

    Args:
        scenario: The mission's settings.
        kind: The kind.
        thinning: One in this many columns, and rows, of the sensor's rays is imagined.
        stop_probability: Probability that an unknown voxel stops a ray.
        gap_probability: Probability that one beside a covered voxel does; None = `stop_probability`.
    """
    grid, sensor, robot = scenario.grid, kind.sensor, kind.robot
    step, edge = sensor.angular_step_rad, grid.voxel_size_m
    columns, rows = (max(n // thinning, 1) for n in (sensor.columns, sensor.rows))
    known_precision = float(KNOWN_RATIO / scenario.sigma_prior**2)
    scan = ScanModel(
        yaws=centred_angles(columns, step) * sensor.columns / columns,
        pitches=centred_angles(rows, step) * sensor.rows / rows,
        sensor_rays=float(sensor.rays / (columns * rows)),
        voxel_size_m=float(edge),
        max_range_m=float(sensor.max_range_m),
        min_range_m=float(sensor.min_range_m),
        sigma_min=float(sensor.sigma_min),
        sigma_slope_per_m=float(sensor.sigma_slope_per_m),
        sigma_exponent=float(sensor.sigma_exponent),
        voxels_behind=int(sensor.voxels_behind),
        known_precision=known_precision,
        stop_probability=float(stop_probability),
        gap_probability=float(stop_probability if gap_probability is None else gap_probability),
        pose_variance=np.zeros(2),
        wanted_precision=known_precision if scenario.ending.by_seen else math.inf,
    )
    drive = DriveModel(
        max_speed_m_s=float(robot.max_speed_m_s),
        acceleration_m_s2=float(robot.acceleration_m_s2),
        turn_rate_rad_s=float(robot.turn_rate_rad_s),
        scan_time_s=float(sensor.scan_time_s),
        body_radius=float(robot.planning_radius_m / edge),
    )
    return RobotModel(
        scan,
        drive,
        lattice=new_lattice(grid.shape, robot.planning_radius_m / edge, scenario.layer_of(robot)),
        longest_ray=longest_crossing(*grid.shape, sensor.max_range_m / edge, sensor.voxels_behind + 1),
    )


def new_scratch(grid: Grid, models: Sequence[RobotModel]) -> ScanScratch:
    """Return memory to evaluate viewpoints of robots of these kinds."""
    longest = max(model.longest_ray for model in models) + sum(grid.shape)
    return new_scan_scratch(grid.voxels, longest, max(len(model.scan.pitches) for model in models))


@lean_kernel
def line_is_free(belief, start, finish, body_radius, scratch):
    """Return whether a ball-shaped body meets nothing believed covered on a straight line, and no boundary.

    The line leads from a place (3,) to another. It is tested along the line of the body's centre and, for
    bodies larger than half a voxel, of four points at its sides.
    """
    size, begin = belief.size, point(start)
    x, y, z = finish[0] - begin[0], finish[1] - begin[1], finish[2] - begin[2]
    length = math.sqrt(x * x + y * y + z * z)
    if length <= 1e-9:
        return True
    x, y, z = x / length, y / length, z / length
    level = math.sqrt(x * x + y * y)
    side = (-y / level, x / level, 0.0) if level > 1e-9 else (1.0, 0.0, 0.0)
    over = (y * side[2] - z * side[1], z * side[0] - x * side[2], x * side[1] - y * side[0])
    wide = body_radius > 0.5 + 1e-9
    for number in range(5 if wide else 1):
        by_side = body_radius * (1.0 if number == 1 else -1.0 if number == 2 else 0.0)
        by_over = body_radius * (1.0 if number == 3 else -1.0 if number == 4 else 0.0)
        if number > 2 and size[2] == 1:
            continue
        beside = (
            begin[0] + by_side * side[0] + by_over * over[0],
            begin[1] + by_side * side[1] + by_over * over[1],
            begin[2] + by_side * side[2] + by_over * over[2],
        )
        for axis in range(3):
            if not 0.0 <= beside[axis] <= size[axis]:
                return False
        line = Line(beside, (x, y, z), length + (body_radius if wide and number == 0 else 0.0))
        crossing = Crossing(scratch.crossed, scratch.entered)
        _, _, end = cast_ray(belief.mean, size, line, STOP_AT_COVERED, OPEN_END, NONE_BEHIND, crossing)
        if end != OPEN:
            return False
    return True


@inlined_kernel
def _seconds(drive, length_m, hops, here, at):
    """Return the seconds until a scan at the end of a path in equal hops, with a scan after each."""
    drive_s = hops * driving_time(length_m, drive.max_speed_m_s, drive.acceleration_m_s2)
    drive_s += (hops - 1) * drive.scan_time_s
    turn_s = turning_time(here[3], here[4], at[3], at[4], drive.turn_rate_rad_s)
    return max(drive_s, turn_s) + drive.scan_time_s


@lean_kernel
def straight_seconds(belief, voxel_size_m, drive, here, at, scratch):
    """Return the seconds until the scan at a viewpoint (5,) is taken, on a straight line from `here` (5,).

    It is inf where the line is not free by the belief.
    """
    if not line_is_free(belief, here, at, drive.body_radius, scratch):
        return math.inf
    return _seconds(drive, distance_between(here, at) * voxel_size_m, 1, here, at)


@lean_kernel
def travel_seconds(drive, voxel_size_m, here, at, cost, reach):
    """Return the seconds until the scan at a viewpoint (5,) is taken, on a path from `here` (5,).

    The path's cost is that of its steps, in voxel edges; seconds are inf where that is. A hop is no longer
    than `reach` voxel edges, with a scan after each; inf allowed.
    """
    straight = distance_between(here, at)
    length = 0.0
    if straight > 1e-9:
        length = max(straight, STRAIGHTENED * cost)
    if math.isinf(length):
        return math.inf
    hops = max(math.ceil(length / reach - 1e-9), 1)
    return _seconds(drive, length / hops * voxel_size_m, hops, here, at)


@lean_kernel
def voxel_at(size, at):
    """Return the number of the voxel of a place in the workspace, grid units."""
    x, y, z = indices_at(size, at)
    return flat_index(size, x, y, z)


@inlined_kernel
def indices_at(size, at):
    """Return the indices (x, y, z) of the voxel of a place in the workspace, grid units."""
    x = min(max(int(at[0]), 0), size[0] - 1)
    y = min(max(int(at[1]), 0), size[1] - 1)
    z = min(max(int(at[2]), 0), size[2] - 1)
    return x, y, z
