"""A canvas with what it takes to plan in it: the scenario in its grid, models of robots, paths, scans."""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import numpy as np

from entropy_explore_env.belief.fields import Belief
from entropy_explore_env.belief.paths.lattice import NO_FLY_NOWHERE
from entropy_explore_env.belief.paths.search import Search
from entropy_explore_env.errors import SettingError
from entropy_explore_env.explorer.canvas import Canvas
from entropy_explore_env.missions.records import WAYPOINTS
from entropy_explore_env.missions.rules import rules_of
from entropy_explore_env.robots.given_scans import aim_at_points, fuse_given
from entropy_explore_env.robots.motion import driving_time, turning_time
from entropy_explore_env.robots.navigator import Navigator, new_navigators, plan_path
from entropy_explore_env.robots.range_sensor import first_rays, new_scan, sensor_model
from entropy_explore_env.robots.rotations import turned_by
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.viewpoints.evaluation import RobotModel, new_scratch, robot_model
from entropy_explore_env.viewpoints.expected_scan import expected_bits

_POINTS_AT_ONCE = 4096


class Fused(NamedTuple):
    """What a scan brought."""

    total_bits: float
    bits: np.ndarray
    """(R,) of each ray."""
    depth_m: float
    """r̂, mean measured distance."""
    half_angle_rad: float
    """α̂, largest angle of a measured ray from the gaze."""


class Outlook(NamedTuple):
    """What is expected of a viewpoint."""

    path: np.ndarray
    """(N, 3) points to drive to, in the canvas's frame."""
    bits: float
    seconds: float


class Workspace:
    """Plans and scans in a canvas; poses are in the canvas's frame, and inside it.

    Attributes:
        canvas: The belief.
        scenario: The task, in the canvas's grid.
        rules: The scenario for compiled code.
        search: What the strategy has by this name: a Search is used between its decisions, as memory.
    """

    def __init__(self, canvas: Canvas, scenario: Scenario) -> None:
        """Take a canvas and a task in its grid."""
        self.canvas, self.scenario, self.rules = canvas, scenario, rules_of(scenario)
        self.search: object = None
        self._sensors = [sensor_model(kind.sensor) for kind in scenario.kinds]

    @cached_property
    def _models(self) -> list[RobotModel]:
        return [robot_model(self.scenario, kind, thinning=1) for kind in self.scenario.kinds]

    @cached_property
    def _navigators(self) -> dict[int, Navigator]:
        lent = self.search if isinstance(self.search, Search) else None
        return new_navigators(self.scenario, lent)

    def _kind_number(self, robot: int) -> int:
        return robot % len(self.scenario.kinds)

    def voxel_of(self, pose: np.ndarray) -> tuple[int, int, int] | None:
        """Return the indices of the voxel of a pose; None = it is outside."""
        x, y, z = (int(index) for index in self.canvas.grid.voxel_of(pose[:3]))
        shape = self.canvas.grid.shape
        inside = 0 <= x < shape[0] and 0 <= y < shape[1] and 0 <= z < shape[2]
        return (x, y, z) if inside else None

    def placed(self, robot: int, pose: np.ndarray, name: str) -> np.ndarray:
        """Return a pose of the map frame in the canvas's; that of a robot that stays in a plane lies in it.

        Raises:
            SettingError: It is outside the canvas; `name` says whose pose it is.
        """
        canvas, plane_m = self.canvas, self.scenario.plane_m(robot)
        placed = turned_by(pose, -canvas.yaw_rad)
        if plane_m is not None:
            placed[2] = plane_m
        if self.voxel_of(placed) is None:
            low = np.asarray(canvas.grid.origin_m)
            high = low + canvas.grid.size_m
            turned = f", turned by {canvas.yaw_rad:g} rad" if canvas.yaw_rad else ""
            allowed = (
                f"a place on the map, from {low.round(3).tolist()} to {high.round(3).tolist()} m{turned}"
            )
            raise SettingError(name, pose.tolist(), allowed)
        return placed

    def is_wall(self, pose: np.ndarray) -> bool:
        """Return whether the voxel of a pose was measured, and is believed covered."""
        voxel, canvas = self.voxel_of(pose), self.canvas
        if voxel is None:
            return True
        return bool(canvas.mean[voxel] > 0.5 and canvas.precision[voxel] > canvas.prior_precision)

    def beside_unknown(self) -> bool:
        """Return whether some voxel that is believed free shares a face with one that was never measured."""
        unknown = ~self.canvas.known
        free = ~unknown & (self.canvas.mean <= 0.5)
        for axis in range(3):
            here, beside = np.moveaxis(free, axis, 0), np.moveaxis(unknown, axis, 0)
            if (here[:-1] & beside[1:]).any() or (here[1:] & beside[:-1]).any():
                return True
        return False

    def fuse_ranges(self, robot: int, pose: np.ndarray, ranges_m: np.ndarray) -> Fused:
        """Fuse the ranges (R,) of all rays of a robot's sensor into the belief."""
        kind = self._kind_number(robot)
        scan = new_scan(self.canvas.grid, [self.scenario.kinds[kind].sensor], len(ranges_m))
        return self._fuse(scan, kind, pose, ranges_m, by_rays=True)

    def fuse_points(self, robot: int, pose: np.ndarray, points_m: np.ndarray) -> Fused:
        """Fuse hits at points (N, 3) into the belief."""
        kind, parts = self._kind_number(robot), []
        rays = min(max(len(points_m), 1), _POINTS_AT_ONCE)
        scan = new_scan(self.canvas.grid, [self.scenario.kinds[kind].sensor], rays)
        for first in range(0, len(points_m), rays):
            some = np.ascontiguousarray(points_m[first : first + rays], np.float64)
            ranges_m, part = np.zeros(len(some)), first_rays(scan, len(some))
            aim_at_points(part.rays, pose, some, ranges_m)
            parts.append(self._fuse(part, kind, pose, ranges_m, by_rays=False))
        if not parts:
            return Fused(0.0, np.zeros(0), 0.0, 0.0)
        deepest = max(part.half_angle_rad for part in parts)
        total_bits, bits = sum(part.total_bits for part in parts), [part.bits for part in parts]
        return Fused(total_bits, np.concatenate(bits), parts[-1].depth_m, deepest)

    def _fuse(self, scan, kind: int, pose: np.ndarray, ranges_m: np.ndarray, by_rays: bool) -> Fused:  # noqa: ANN001 - a Scan
        """Fuse the ranges of a scan's rays."""
        grid, at = self.canvas.grid, self.canvas.grid.in_grid_units(pose)
        frame = grid.shape, float(grid.voxel_size_m), (float(at[0]), float(at[1]), float(at[2]))
        gaze, belief = (float(pose[3]), float(pose[4])), self._belief
        total_bits, depth_m, half_rad = fuse_given(
            scan, self._sensors[kind], frame, gaze, ranges_m, np.bool_(by_rays), belief.mean, belief.precision
        )
        return Fused(float(total_bits), scan.utility.copy(), float(depth_m), float(half_rad))

    @property
    def _belief(self) -> Belief:
        canvas = self.canvas
        return Belief(canvas.mean.reshape(-1), canvas.precision.reshape(-1), canvas.grid.shape)

    def outlook(self, robot: int, pose: np.ndarray, viewpoint: np.ndarray) -> Outlook:
        """Return the path of a robot to a viewpoint, and what is expected of it."""
        number, grid, belief = self._kind_number(robot), self.canvas.grid, self._belief
        model, here, at = self._models[number], grid.in_grid_units(pose), grid.in_grid_units(viewpoint)
        within = np.clip(at[:3], 0.0, np.asarray(grid.shape, np.float64))
        path = within[None]
        if number in self._navigators:
            corners = np.zeros((WAYPOINTS, 3))
            start, goal = tuple(here[:3].tolist()), tuple(at[:3].tolist())
            count, _ = plan_path(
                self._navigators[number], belief.mean, belief.precision, NO_FLY_NOWHERE, start, goal, corners
            )
            path = corners[:count]
        ends = np.vstack([here[None, :3], path])
        length_m = float(np.linalg.norm(np.diff(ends, axis=0), axis=1).sum()) * grid.voxel_size_m
        drive = model.drive
        drive_s = driving_time(length_m, drive.max_speed_m_s, drive.acceleration_m_s2)
        turn_s = turning_time(pose[3], pose[4], viewpoint[3], viewpoint[4], drive.turn_rate_rad_s)
        scratch = new_scratch(grid, [model])
        bits = expected_bits(belief, model.scan, np.array([*within, *viewpoint[3:]]), scratch)
        seconds = max(float(drive_s), float(turn_s)) + drive.scan_time_s
        return Outlook(np.asarray(grid.origin_m) + path * grid.voxel_size_m, float(bits), seconds)
