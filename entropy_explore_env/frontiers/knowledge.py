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
from entropy_explore_env.scenario import Scenario
from entropy_explore_env.settings import Grid, RobotKind
from entropy_explore_env.viewpoints.drawing import uniform_viewpoint


class TeammateKnowledge(Protocol):
    """What a robot last heard of a teammate; times are -1 s where it heard nothing."""

    @property
    def heard_s(self) -> float:
        """When the last message was sent that arrived."""
        ...

    @property
    def pose(self) -> np.ndarray:
        """(5,) the teammate's pose then, map frame."""
        ...

    @property
    def announced_s(self) -> float:
        """When the last announcement was sent that arrived."""
        ...

    @property
    def viewpoint(self) -> np.ndarray:
        """(5,) the announced viewpoint, map frame."""
        ...

    @property
    def depth_m(self) -> float:
        """Mean measured distance of the teammate's latest scan then."""
        ...

    @property
    def half_angle_rad(self) -> float:
        """Largest angle of a measured ray from its gaze."""
        ...

    @property
    def silent(self) -> bool:
        """Whether the teammate counts as silent now."""
        ...


class ScanKnowledge(Protocol):
    """A robot's latest scan."""

    @property
    def utility_bits(self) -> np.ndarray:
        """(R,) bits that each ray took from the robot's own map."""
        ...


class RobotKnowledge(Protocol):
    """What one robot knows at one of its decisions; map frame, metres, radians."""

    @property
    def robot(self) -> int:
        """Number of the robot."""
        ...

    @property
    def scenario(self) -> Scenario:
        """The public settings."""
        ...

    @property
    def kind(self) -> RobotKind:
        """Its body and its sensor."""
        ...

    @property
    def planar(self) -> bool:
        """Whether it stays in its plane."""
        ...

    @property
    def level(self) -> bool:
        """Whether it never looks up or down."""
        ...

    @property
    def time_s(self) -> float:
        """Simulated time."""
        ...

    @property
    def under_way(self) -> bool:
        """Whether it decides while it drives."""
        ...

    @property
    def since_scan_m(self) -> float:
        """Distance driven since its latest scan."""
        ...

    @property
    def pose(self) -> np.ndarray:
        """(5,) x, y, z, yaw, pitch, as it believes."""
        ...

    @property
    def covariance(self) -> np.ndarray:
        """(4, 4) of x, y, z and yaw; zeros where the pose is exact."""
        ...

    @property
    def mean(self) -> np.ndarray:
        """(X, Y, Z) float32, expected coverage."""
        ...

    @property
    def precision(self) -> np.ndarray:
        """(X, Y, Z) float32, 1/σ² of it."""
        ...

    @property
    def depth_m(self) -> float:
        """Mean measured distance of its latest scan."""
        ...

    @property
    def half_angle_rad(self) -> float:
        """Largest angle of a measured ray of its latest scan from the gaze."""
        ...

    @property
    def scan(self) -> ScanKnowledge:
        """Its latest scan."""
        ...

    @property
    def move_end(self) -> MoveEnd:
        """Why its latest drive ended."""
        ...

    @property
    def ceiling(self) -> np.ndarray | None:
        """(X, Y) int32, lowest layer of the no-fly zone; None = there is none."""
        ...

    @property
    def teammates(self) -> Mapping[int, TeammateKnowledge]:
        """Number of a teammate → what was heard of it."""
        ...


_LOST_AFTER = 2.0
"""A silent robot counts as under way for this many times a drive along all sides of the workspace."""


def belief_of(view: RobotKnowledge) -> Belief:
    """The belief of a view's robot."""
    return Belief(view.mean.reshape(-1), view.precision.reshape(-1), view.scenario.grid.shape)


def voxel_of(view: RobotKnowledge, pose: np.ndarray) -> int:
    """Number of the voxel of a pose (3,) or (5,), map frame; the nearest one for poses outside."""
    grid = view.scenario.grid
    indices = np.clip(grid.voxel_of(pose[:3]), 0, np.array(grid.shape) - 1)
    return int(np.ravel_multi_index(tuple(indices), grid.shape))


def teammates_that_share(view: RobotKnowledge) -> Mapping[int, TeammateKnowledge]:
    """Teammates whose scans may reach the robot: no silent ones, and none where the channel carries no scans.

    What the others go to see it has to see itself: nothing is left to them.
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
    """The CONE that a teammate announced, in grid units: V(Yˢ, r̂, α̂) (RochaMI)."""
    cones = np.zeros(1, CONE)
    depth = mate.depth_m / grid.voxel_size_m
    cones[0] = cone_of(grid.in_grid_units(mate.viewpoint), depth, mate.half_angle_rad)
    return cones[0]


def announced_cones(view: RobotKnowledge) -> np.ndarray:
    """(M,) CONE of what teammates have announced to see, in grid units."""
    heard = [mate for mate in view.teammates.values() if mate.announced_s >= 0.0 and mate.depth_m > 0.0]
    cones = np.zeros(len(heard), CONE)
    for place, mate in enumerate(heard):
        cones[place] = announced_cone(view.scenario.grid, mate)
    return cones


def random_viewpoint(view: RobotKnowledge, rng: np.random.Generator) -> np.ndarray:
    """Return a viewpoint (5,) drawn uniformly within a robot's reach, the gaze in any direction."""
    grid, reach_m = view.scenario.grid, view.kind.robot.reach_m
    return uniform_viewpoint(grid, reach_m, view.pose, view.planar, view.level, rng)
