"""What one robot knows, as rules and planners read it: the missions' `RobotView` has this form.

Frontiers and the planner lie below missions and also serve robots outside of them: they need this form alone.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Protocol

import numpy as np

from entropy_explore_env.belief.fields import Belief
from entropy_explore_env.belief.visibility import CONE, cone_of
from entropy_explore_env.robots.motion import MoveEnd, driving_time
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.robot_kind import RobotKind
from entropy_explore_env.settings.scenario import Scenario


class TeammateKnowledge(Protocol):
    """What a robot last heard of a teammate; times are -1 s where it heard nothing.

    Attributes:
        heard_s: When the last message was sent that arrived.
        pose: (5,) the teammate's pose then, map frame.
        announced_s: When the last announcement was sent that arrived.
        viewpoint: (5,) the announced viewpoint, map frame.
        depth_m: Mean measured distance of the teammate's latest scan then.
        half_angle_rad: Largest angle of a measured ray from its gaze.
        silent: Whether the teammate counts as silent now.
    """

    @property
    def heard_s(self) -> float: ...
    @property
    def pose(self) -> np.ndarray: ...
    @property
    def announced_s(self) -> float: ...
    @property
    def viewpoint(self) -> np.ndarray: ...
    @property
    def depth_m(self) -> float: ...
    @property
    def half_angle_rad(self) -> float: ...
    @property
    def silent(self) -> bool: ...


class ScanKnowledge(Protocol):
    """A robot's latest scan.

    Attributes:
        utility_bits: (R,) bits that each ray took from the robot's own map.
    """

    @property
    def utility_bits(self) -> np.ndarray: ...


class RobotKnowledge(Protocol):
    """What one robot knows at one of its decisions; map frame, metres, radians.

    Attributes:
        robot: Number of the robot.
        scenario: The public settings.
        kind: Its body and its sensor.
        planar: Whether it stays in its plane.
        level: Whether it never looks up or down.
        time_s: Simulated time.
        under_way: Whether it decides while it drives.
        since_scan_m: Distance driven since its latest scan.
        pose: (5,) x, y, z, yaw, pitch, as it believes.
        covariance: (4, 4) of x, y, z and yaw; zeros where the pose is exact.
        mean: (X, Y, Z) float32, expected coverage.
        precision: (X, Y, Z) float32, 1/σ² of it.
        depth_m: Mean measured distance of its latest scan.
        half_angle_rad: Largest angle of a measured ray of its latest scan from the gaze.
        scan: Its latest scan.
        move_end: Why its latest drive ended.
        ceiling: (X, Y) int32, lowest layer of the no-fly zone; None = there is none.
        teammates: Number of a teammate → what was heard of it.
    """

    @property
    def robot(self) -> int: ...
    @property
    def scenario(self) -> Scenario: ...
    @property
    def kind(self) -> RobotKind: ...
    @property
    def planar(self) -> bool: ...
    @property
    def level(self) -> bool: ...
    @property
    def time_s(self) -> float: ...
    @property
    def under_way(self) -> bool: ...
    @property
    def since_scan_m(self) -> float: ...
    @property
    def pose(self) -> np.ndarray: ...
    @property
    def covariance(self) -> np.ndarray: ...
    @property
    def mean(self) -> np.ndarray: ...
    @property
    def precision(self) -> np.ndarray: ...
    @property
    def depth_m(self) -> float: ...
    @property
    def half_angle_rad(self) -> float: ...
    @property
    def scan(self) -> ScanKnowledge: ...
    @property
    def move_end(self) -> MoveEnd: ...
    @property
    def ceiling(self) -> np.ndarray | None: ...
    @property
    def teammates(self) -> Mapping[int, TeammateKnowledge]: ...


_DRAWS = 64
"""Places that are drawn until one lies within reach."""
_LOST_AFTER = 2.0
"""A silent robot counts as under way for this many times a drive along all sides of the workspace."""


def belief_of(view: RobotKnowledge) -> Belief:
    """Return the belief of a view's robot."""
    return Belief(view.mean.reshape(-1), view.precision.reshape(-1), view.scenario.grid.shape)


def voxel_of(view: RobotKnowledge, pose: np.ndarray) -> int:
    """Return the number of the voxel of a pose (3,) or (5,), map frame; the nearest one for poses outside."""
    grid = view.scenario.grid
    indices = np.clip(grid.voxel_of(pose[:3]), 0, np.array(grid.shape) - 1)
    return int(np.ravel_multi_index(tuple(indices), grid.shape))


def teammates_that_share(view: RobotKnowledge) -> Mapping[int, TeammateKnowledge]:
    """Return the teammates whose scans may reach the robot: none that is silent.

    Where the channel carries no scans there are none: what others see the robot has to see itself.
    """
    if view.scenario.channel.burst == 0:
        return {}
    return {mate: seen for mate, seen in view.teammates.items() if not seen.silent}


def under_way(view: RobotKnowledge, mate: TeammateKnowledge, robot: int) -> bool:
    """Whether a teammate, by what was heard of it, is on its way to the viewpoint that it announced.

    It is until a scan from there is heard, or until so much time has passed that it must have arrived: then
    it is out of the channel's range, or its messages were lost. Scans that are taken during a drive do not
    count.
    """
    if mate.announced_s < 0.0:
        return False
    kind, size_m = view.scenario.kind_of(robot), view.scenario.grid.size_m
    if mate.heard_s <= mate.announced_s:
        drive_s = driving_time(float(sum(size_m)), kind.robot.max_speed_m_s, kind.robot.acceleration_m_s2)
        return view.time_s - mate.announced_s <= _LOST_AFTER * drive_s + kind.sensor.scan_time_s
    if math.isinf(kind.sensor.scan_every_m):
        return False
    apart_m = float(np.linalg.norm(mate.pose[:3] - mate.viewpoint[:3]))
    return apart_m > view.scenario.grid.voxel_size_m


def stays(view: RobotKnowledge, mate: TeammateKnowledge) -> bool:
    """Whether a teammate waits: the viewpoint that it announced is where it was before."""
    apart_m = float(np.linalg.norm(mate.pose[:3] - mate.viewpoint[:3]))
    return apart_m < 0.5 * view.scenario.grid.voxel_size_m


def announced_cone(grid: Grid, mate: TeammateKnowledge) -> np.void:
    """Return the CONE that a teammate announced, in grid units: V(Yˢ, r̂, α̂) (RochaMI)."""
    cones = np.zeros(1, CONE)
    depth = mate.depth_m / grid.voxel_size_m
    cones[0] = cone_of(grid.in_grid_units(mate.viewpoint), depth, mate.half_angle_rad)
    return cones[0]


def random_viewpoint(view: RobotKnowledge, rng: np.random.Generator) -> np.ndarray:
    """Return a viewpoint (5,) drawn uniformly within a robot's reach, the gaze in any direction."""
    grid, reach_m, axes = view.scenario.grid, view.kind.robot.reach_m, 2 if view.planar else 3
    low = np.asarray(grid.origin_m)
    high = low + grid.size_m
    viewpoint = view.pose.copy()
    here = view.pose[:axes]
    if math.isinf(reach_m):  # actions reach from the centre of the first voxel to that of the last
        low, high = low + 0.5 * grid.voxel_size_m, high - 0.5 * grid.voxel_size_m
    lowest, highest = np.maximum(low[:axes], here - reach_m), np.minimum(high[:axes], here + reach_m)
    for _ in range(_DRAWS):
        place = rng.uniform(lowest, highest)
        if ((place - here) ** 2).sum() <= reach_m**2:
            viewpoint[:axes] = place
            break
    viewpoint[3] = rng.uniform(-math.pi, math.pi)
    viewpoint[4] = 0.0 if view.level else math.asin(rng.uniform(-1.0, 1.0))
    return viewpoint
