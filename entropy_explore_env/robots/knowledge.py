"""What one robot knows at one of its decisions, as rules and planners read it: arrays and plain numbers.

Frontiers and the planner also serve robots outside of missions; the missions' `RobotView` adds what only
missions know. Places are in the map frame, in metres; angles are in radians.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from entropy_explore_env.prediction.predictor import MapPredictor, Predicted, Prediction, shipped_predictor
from entropy_explore_env.prediction.volumes import shipped_volume_predictor
from entropy_explore_env.robots.motion import MoveEnd
from entropy_explore_env.settings.robot_kind import RobotKind
from entropy_explore_env.settings.scenario import Scenario


@dataclass(frozen=True, eq=False)
class ScanView:
    """A robot's latest scan, R rays. Before the first one, all `returned` are 0.

    Equal only to itself, as other views.

    Attributes:
        pose: (5,) where it was taken: x, y, z, yaw, pitch.
        range_m: (R,) measured distances; 0 where nothing was measured.
        returned: (R,) int8, a `Return` each: nothing, free up to the range, hit.
        utility_bits: (R,) what each ray brought to the robot's own map.
    """

    pose: np.ndarray
    range_m: np.ndarray
    returned: np.ndarray
    utility_bits: np.ndarray

    def __repr__(self) -> str:
        """Return from where it was taken, and how much it brought."""
        bits = self.utility_bits.sum()
        return f"ScanView({len(self.range_m)} rays from {place_text(self.pose)}, {bits:.6g} bits)"


@dataclass(frozen=True, eq=False)
class TeammateView:
    """What a robot last heard of a teammate; times are -1 and the rest 0 if it never heard.

    Equal only to itself, as other views.

    A teammate that has not been heard for long (`missions.silence.is_silent`) counts as silent: it is out of
    reach, or works no more. Where it was last heard it may still stand; what it announced is not kept, so
    that its place is free for others.

    Attributes:
        heard_s: When the last message was sent that reached the robot.
        pose: (5,) where the teammate was then: x, y, z, yaw, pitch.
        announced_s: When the last announcement was sent that reached the robot.
        viewpoint: (5,) the viewpoint that it announced: x, y, z, yaw, pitch.
        depth_m: r̂, mean measured distance of the teammate's latest scan then.
        half_angle_rad: α̂, largest angle of a measured ray from its gaze.
        silent: Whether it was heard once, and counts as silent now: `announced_s` is -1 then, `viewpoint`,
            `depth_m` and `half_angle_rad` are 0.
    """

    heard_s: float
    pose: np.ndarray
    announced_s: float
    viewpoint: np.ndarray
    depth_m: float
    half_angle_rad: float
    silent: bool = False

    def __repr__(self) -> str:
        """Return where it was last heard, and where it went."""
        if self.heard_s < 0.0:
            return "TeammateView(never heard)"
        if self.silent:
            return f"TeammateView(at {place_text(self.pose)} at {self.heard_s:g} s, silent since)"
        announced = "" if self.announced_s < 0.0 else f", to {place_text(self.viewpoint)}"
        return f"TeammateView(at {place_text(self.pose)} at {self.heard_s:g} s{announced})"


@dataclass(frozen=True, eq=False, kw_only=True)
class RobotKnowledge:
    """What one robot knows at one of its decisions.

    It is equal only to itself, and hashes by identity.

    Attributes:
        robot: Its number.
        scenario: The public settings.
        time_s: Simulated time.
        under_way: Whether it decides while it drives on. Where it chooses its target again, nothing changes.
        since_scan_m: Metres that it has driven since its latest scan.
        pose: (5,) x, y, z, yaw, pitch, pitch downwards. Where the robot drifts (`Robot.localization`) this is
            its estimate: its map, scans, target and path are where it believes them to be, and what it
            chooses is meant so.
        covariance: (4, 4) float64 of the pose's x, y, z and yaw, m and rad; 0 where it is exact. Of the
            latest event at which the estimate changed: while the robot drives on it is uncertain by more.
        mean: (X, Y, Z) float32, expected coverage.
        precision: (X, Y, Z) float32, 1/σ² of it.
        depth_m, half_angle_rad: r̂ and α̂ of its latest scan.
        scan: Its latest scan.
        move_end: Why its latest drive ended where it did; UNDER_WAY where it chooses while it drives on.
        teammates: Robot number → what it heard of it.
        ceiling: (X, Y) int32, in each column the lowest layer of the no-fly zone (an exposure surface
            is known beforehand); None = no such zone.
    """

    robot: int
    scenario: Scenario
    time_s: float
    under_way: bool
    since_scan_m: float
    pose: np.ndarray
    covariance: np.ndarray = field(default_factory=lambda: np.zeros((4, 4)))
    mean: np.ndarray
    precision: np.ndarray
    depth_m: float
    half_angle_rad: float
    scan: ScanView
    move_end: MoveEnd
    teammates: dict[int, TeammateView]
    ceiling: np.ndarray | None

    @property
    def kind(self) -> RobotKind:
        """How it moves and what it senses."""
        return self.scenario.kind_of(self.robot)

    @cached_property
    def prediction(self) -> Prediction:
        """What is predicted around the robot where its map holds nothing, as of the first look at it.

        By the predictor that comes with the library, in horizontal cells of the band of heights that the
        robot's body passes (`prediction.predictor`).

        Raises:
            SettingError: The map holds a number that is not finite.
        """
        return self.predicted_by(shipped_predictor())

    def predicted_by(self, predictor: MapPredictor[Predicted]) -> Predicted:
        """Return what a predictor says around the robot: see `prediction` and `predicted_volume`."""
        grid, radius_m = self.scenario.grid, self.kind.robot.body_radius_m
        known = (self.mean, self.precision, self.scenario.sigma_prior)
        return predictor.predict(grid, *known, self.pose, radius_m)

    @cached_property
    def predicted_volume(self) -> np.ndarray:
        """What is predicted of the voxels around the robot, as of the first look at it.

        (X, Y, Z) float32, read-only: the probability to be solid, by the predictor of volumes that comes with
        the library. It is -1 of voxels that were measured, that share a cell of 0.4 m with one that was, or
        that lie outside of the crop of 25.6 × 25.6 × 12.8 m.

        Raises:
            SettingError: The map is a plan, or holds a number that is not finite.
        """
        return self.predicted_by(shipped_volume_predictor())

    @property
    def planar(self) -> bool:
        """Whether it stays in its plane."""
        return self.scenario.layer_of(self.kind.robot) is not None

    @property
    def level(self) -> bool:
        """Whether it stays in its plane and never looks up or down."""
        return self.scenario.looks_level(self.kind.robot)


def place_text(pose: np.ndarray) -> str:
    """Return the first three numbers of a pose or viewpoint, metres."""
    return "(" + ", ".join(f"{number:.3g}" for number in pose[:3]) + ") m"
