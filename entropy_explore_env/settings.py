"""The parts of a scenario: frozen settings, checked once, the unit in every field's name (SI, bits)."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from entropy_explore_env.errors import SettingError, did_you_mean
from entropy_explore_env.localization_settings import Localization
from entropy_explore_env.validation import (
    check,
    check_choice,
    check_count,
    check_counts,
    check_kind,
    check_within,
    is_number,
)

BITS_OF_UNIT_GAUSSIAN = 0.5 * math.log2(2.0 * math.pi * math.e)
"""Differential entropy of N(0, 1) in bits: Rocha04, eq. 15 at σ = 1."""

MAX_VOXELS = 2**31 - 1
"""Voxels are numbered by 32-bit integers."""
MAX_VOXELS_ALONG_AXIS = 2**20
"""Rays measure their way in 64-bit integers."""

MIN_REDECIDE_S = 0.01
"""A shorter period between decisions under way would only cost time."""
_REDECIDE = ("at_stop", "on_scan")


def gaussian_entropy_bits(sigma: float) -> float:
    """Differential entropy of a Gaussian in bits, log2 √(2πe) + log2 σ (Rocha04, eq. 15)."""
    return BITS_OF_UNIT_GAUSSIAN + math.log2(sigma)


@dataclass(frozen=True)
class Grid:
    """The voxels of a workspace. Frame: map, z up, metres (REP-103).

    Attributes:
        shape: Voxels along x, y and z; one along z is a 2-D world.
        voxel_size_m: Edge of a voxel (`vsz` of Rocha04).
        origin_m: Lower corner of voxel (0, 0, 0) in the map frame.
    """

    shape: tuple[int, int, int]
    voxel_size_m: float
    origin_m: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        """Check every field."""
        check_counts(self, "shape", 1, MAX_VOXELS_ALONG_AXIS)
        if math.prod(self.shape) > MAX_VOXELS:
            raise SettingError("Grid.shape", self.shape, f"at most {MAX_VOXELS} voxels in all")
        check(self, "voxel_size_m", "a number from 1e-6 to 1e6", lambda v: 1e-6 <= v <= 1e6)
        finite = isinstance(self.origin_m, tuple) and len(self.origin_m) == 3
        if not finite or not all(is_number(v) and abs(v) <= 1e9 for v in self.origin_m):
            raise SettingError(
                "Grid.origin_m", self.origin_m, "a tuple of three numbers (x, y, z) from -1e9 to 1e9"
            )

    @property
    def voxels(self) -> int:
        """Number of voxels V = X·Y·Z."""
        return math.prod(self.shape)

    @property
    def flat(self) -> bool:
        """Whether the world is 2-D: one voxel high."""
        return self.shape[2] == 1

    @property
    def size_m(self) -> np.ndarray:
        """(3,) float64, extent along x, y and z in metres."""
        return np.asarray(self.shape) * self.voxel_size_m

    def voxel_of(self, position_m: np.ndarray) -> np.ndarray:
        """Indices (..., 3) int64 of the voxels that hold the points (..., 3), map frame, metres."""
        scaled = (np.asarray(position_m) - np.asarray(self.origin_m)) / self.voxel_size_m
        return np.floor(scaled).astype(np.int64)

    def in_grid_units(self, pose: np.ndarray) -> np.ndarray:
        """(N,) a pose or viewpoint, x, y, z first, with its place in voxel edges from the lower corner."""
        converted = pose.copy()
        converted[:3] = (converted[:3] - np.asarray(self.origin_m)) / self.voxel_size_m
        return converted

    def centre_of(self, voxel: np.ndarray) -> np.ndarray:
        """Centres (..., 3) in metres, map frame, of the voxels with indices (..., 3)."""
        return np.asarray(self.origin_m) + (np.asarray(voxel) + 0.5) * self.voxel_size_m


@dataclass(frozen=True)
class Robot:
    """How a robot moves: from rest to rest, straight (Rocha04, table 1) or on a planned way.

    Attributes:
        motion: `free` flies anywhere; `planar` keeps the height of its sensor and, unless it `tilts`, looks
            level.
        navigator: `straight` drives straight to the viewpoint; `planned` takes the cheapest way through
            the robot's own belief, below the ceiling where the world has one (all robots know where it
            is), without stopping at its corners.
        unknown_cost: Planned paths: what a metre through unknown voxels costs, in metres through
            known ones; ≥ 1.
        reach_m: Largest displacement of one decision (ξ of Rocha04, eq. 32), 1e-6 to 1e6;
            inf = the workspace.
        max_speed_m_s: Top speed, 1e-4 to 1e4.
        acceleration_m_s2: Of speeding up and of braking, 1e-4 to 1e6.
        turn_rate_rad_s: Of yaw and pitch, while driving, 1e-4 to 1e6; inf = at once.
        body_radius_m: The body is a ball; 0 = a point that blocks nobody. At most 1e6.
        sensor_height_m: Planar robots: height of the sensor above the workspace's floor, 0 to 1e6.
        tilts: Planar robots: whether the sensor also looks up and down, as a camera on a mast; not in 2-D.
        above_ground_m: Planar robots: the sensor's height above the ground that must carry the robot, 1e-6 to
            1e6. A drive ends before a place below which some of the body's circle has no solid voxel there
            (MoveEnd.EDGE). None, and in 2-D: it needs no ground.
        when_blocked: After a drive that a teammate cut short (MoveEnd.TEAMMATE), who may move on: `wander`
            decides anew at once, and our strategies then wander; `wait` stands still first. Either way
            the robot scans where it stopped, as after every drive, before that.
        blocked_wait_s: `wait`: from the end of that scan until it decides, 1e-4 to 1e5; nothing else ends
            the wait.
        redecide: `at_stop`: the robot decides only where it stops. It decides while it drives, too, with
            `on_scan` at every scan under way, which its sensor must take (`RangeSensor.scan_every_m`); with a
            number whenever so many seconds, at least 0.01, have passed since it last decided. It drives on
            meanwhile; missions/redecision.py says what a new decision does to the drive.
        localization: How well the robot knows where it is; exactly by default.
    """

    motion: Literal["free", "planar"] = "free"
    navigator: Literal["straight", "planned"] = "straight"
    unknown_cost: float = 2.0
    reach_m: float = 0.5
    max_speed_m_s: float = 0.25
    acceleration_m_s2: float = 0.25
    turn_rate_rad_s: float = math.pi / 2
    body_radius_m: float = 0.1
    sensor_height_m: float = 0.5
    tilts: bool = False
    above_ground_m: float | None = None
    when_blocked: Literal["wander", "wait"] = "wander"
    blocked_wait_s: float = 5.0
    redecide: Literal["at_stop", "on_scan"] | float = "at_stop"
    localization: Localization = field(default_factory=Localization)

    def __post_init__(self) -> None:
        """Check every field."""
        check_choice(self, "motion", Literal["free", "planar"])
        check_choice(self, "navigator", Literal["straight", "planned"])
        check(self, "unknown_cost", "a number from 1 to 1e6", lambda v: 1.0 <= v <= 1e6)
        check_within(self, "reach_m", least=1e-6, most=1e6, inf=True)
        check_within(self, "max_speed_m_s", least=1e-4, most=1e4)
        check_within(self, "acceleration_m_s2", least=1e-4, most=1e6)
        check_within(self, "turn_rate_rad_s", least=1e-4, most=1e6, inf=True)
        check_within(self, "body_radius_m", "sensor_height_m", least=0, most=1e6)
        check_kind(self, "tilts", bool)
        if self.above_ground_m is not None:
            check(self, "above_ground_m", "None, or a number from 1e-6 to 1e6", lambda v: 1e-6 <= v <= 1e6)
        check_choice(self, "when_blocked", Literal["wander", "wait"])
        check_within(self, "blocked_wait_s", least=1e-4, most=1e5)
        periodic = is_number(self.redecide) and MIN_REDECIDE_S <= self.redecide < math.inf
        if not periodic and not (isinstance(self.redecide, str) and self.redecide in _REDECIDE):
            allowed = f"one of {', '.join(_REDECIDE)}, or a finite number of seconds ≥ {MIN_REDECIDE_S}"
            allowed += did_you_mean(self.redecide, _REDECIDE)
            raise SettingError("Robot.redecide", self.redecide, allowed)
        check_kind(self, "localization", Localization)

    @property
    def planning_radius_m(self) -> float:
        """How wide a body it plans its paths for: its own, wider by the margin where it drifts."""
        wider_m = self.localization.margin_m if self.localization.drifts else 0.0
        return self.body_radius_m + wider_m


@dataclass(frozen=True)
class RangeSensor:
    """A range sensor that samples yaw and pitch around its gaze (Rocha04, eqs. 3-5, table 1).

    Attributes:
        field_of_view_rad: Full widths (yaw, pitch); (π/6, π/12) at π/90 gives 16 × 8 rays.
        angular_step_rad: Between neighbouring rays.
        max_range_m: Farthest return, 1e-6 to 1e6; inf = the workspace's boundary, which is a wall.
        sigma_min: Standard deviation of coverage right before the sensor (eq. 5).
        sigma_slope_per_m: Its growth with the measured distance, ζ (eq. 5), 0 to 1e6; per mⁿ.
        sigma_exponent: n, with which power of the distance it grows, 0.25 to 4: 1 as in eq. 5; 2 is that of
            stereo cameras (Sujan, eq. 4).
        range_noise_m: Standard deviation of the measured distance, 0 to 1e6.
        voxels_behind: Voxels behind the hit that a ray still updates (as covered: eq. 4).
        scan_time_s: A scan takes this long, 1e-4 to 1e5, standing still.
        scan_every_m: A scan is also taken under way, whenever so much of the way is driven, 1e-3 to 1e6: the
            robot drives on, and the scan takes no time. inf = only on arrival.
        min_range_m: Nearest return, as of a depth camera that is blind close by: a return whose measured
            distance is shorter brings no measurement, and nothing is learned along its ray. Of farther
            returns, and of rays without one, all that the ray crossed is known to be free, also close by.
    """

    field_of_view_rad: tuple[float, float] = (math.pi / 6, math.pi / 12)
    angular_step_rad: float = math.pi / 90
    max_range_m: float = math.inf
    sigma_min: float = 0.08
    sigma_slope_per_m: float = 0.006
    sigma_exponent: float = 1.0
    range_noise_m: float = 0.0
    voxels_behind: int = 1
    scan_time_s: float = 0.5
    scan_every_m: float = math.inf
    min_range_m: float = 0.0

    def __post_init__(self) -> None:
        """Check every field."""
        limits = (2 * math.pi, math.pi)
        view = self.field_of_view_rad
        if (
            not isinstance(view, tuple)
            or len(view) != 2
            or not all(is_number(v) and 0 <= v <= limit + 1e-9 for v, limit in zip(view, limits, strict=True))
        ):
            raise SettingError(
                "RangeSensor.field_of_view_rad", view, "a tuple (yaw in [0, 2π], pitch in [0, π])"
            )
        check_within(self, "scan_time_s", least=1e-4, most=1e5)
        check_within(self, "scan_every_m", least=1e-3, most=1e6, inf=True)
        check(self, "angular_step_rad", "a finite number ≥ 1e-6", lambda v: 1e-6 <= v < math.inf)
        check_within(self, "max_range_m", least=1e-6, most=1e6, inf=True)
        check_within(self, "sigma_slope_per_m", "range_noise_m", least=0, most=1e6)
        check(self, "min_range_m", "a number ≥ 0 below max_range_m", lambda v: 0 <= v < self.max_range_m)
        check(self, "sigma_min", "a number from 1e-4 to 1e4", lambda v: 1e-4 <= v <= 1e4)
        check_within(self, "sigma_exponent", least=0.25, most=4)
        check_count(self, "voxels_behind", 0, 1000)
        if self.rays > 1_000_000:
            raise SettingError(
                "RangeSensor.angular_step_rad", self.angular_step_rad, "at most 1,000,000 rays"
            )

    @property
    def columns(self) -> int:
        """Rays side by side; a full turn is not closed by a second ray at its end."""
        return self._samples(self.field_of_view_rad[0], closed=True)

    @property
    def rows(self) -> int:
        """Rays above each other."""
        return self._samples(self.field_of_view_rad[1], closed=False)

    @property
    def rays(self) -> int:
        """R, rays of a scan."""
        return self.columns * self.rows

    def _samples(self, width_rad: float, closed: bool) -> int:
        steps = math.floor(width_rad / self.angular_step_rad + 1e-9)
        full_turn = closed and width_rad > 2 * math.pi - self.angular_step_rad / 2
        return max(steps, 1) if full_turn else steps + 1


@dataclass(frozen=True)
class RobotKind:
    """One kind of robot of a mixed team: how it moves and what it senses."""

    robot: Robot = field(default_factory=Robot)
    sensor: RangeSensor = field(default_factory=RangeSensor)

    def __post_init__(self) -> None:
        """Check every field."""
        check_kind(self, "robot", Robot)
        check_kind(self, "sensor", RangeSensor)
        if self.robot.redecide == "on_scan" and math.isinf(self.sensor.scan_every_m):
            allowed = "at_stop or a period, where RangeSensor.scan_every_m is inf"
            raise SettingError("Robot.redecide", self.robot.redecide, allowed)


def centred_angles(samples: int, step_rad: float) -> np.ndarray:
    """(samples,) float64 angles around a gaze, in its middle, `step_rad` apart."""
    return (np.arange(samples) - (samples - 1) / 2.0) * step_rad


@dataclass(frozen=True)
class Ending:
    """When a mission is over: by the entropy of maps (Rocha04, eq. 41), or by what the team has seen.

    The threshold is the entropy of a map in which every voxel that can be seen at all has the
    standard deviation `sigma_end`; where everything can be seen it is V·h(σ_end), as in Rocha04.

    With `seen_share` or `unseen_free_voxels`, one of the two, the threshold ends nothing; rewards are still
    counted in shares of it. A voxel is seen when some robot has measured it at least once. What can be seen
    are those voxels of `World.visible`, the free ones that are connected with where robots can be and the
    solid ones beside them, that are in line of sight and range of a place that a body of the team can reach
    from its
    start: behind a gap too narrow for bodies only what beams through it reach (`worlds.sight.visible_from`).
    Nobody acts on it: the mission keeps the joint map for it
    (`Scenario.track_truth`).

    Attributes:
        sigma_end: Standard deviation of coverage at which a voxel counts as known.
        termination: Whose map has to pass the threshold: `any` robot's, or that of `all` robots. `shared`:
            the map of every robot that still works, which is every one that has not stopped for good
            (`Faults.stop`), so that what is known has been shared. With `seen_share` or `unseen_free_voxels`
            the first two are about what the team has seen together, and with `shared` every such robot's own
            map must hold so much: what it measured itself or fused from messages.
        seen_share: The mission ends when the team has seen this share of what can be seen; None = by entropy.
        unseen_free_voxels: It ends when no more free voxels than this are unseen of those that can be seen.
        time_limit_s: Simulated time after which the mission is cut off (a truncation), 1e-3 to 1e9; inf =
            never.
        max_cycles: Steps after which it is cut off; None = never.
    """

    sigma_end: float = 0.03
    termination: Literal["any", "all", "shared"] = "any"
    seen_share: float | None = None
    unseen_free_voxels: int | None = None
    time_limit_s: float = 10_000.0
    max_cycles: int | None = None

    def __post_init__(self) -> None:
        """Check every field."""
        check(self, "sigma_end", "a number from 1e-4 to 1e4", lambda v: 1e-4 <= v <= 1e4)
        check_choice(self, "termination", Literal["any", "all", "shared"])
        if self.seen_share is not None:
            check(self, "seen_share", "None, or a number above 0 up to 1", lambda v: 0 < v <= 1)
        if self.unseen_free_voxels is not None:
            check_count(self, "unseen_free_voxels", 0, MAX_VOXELS)
            if self.seen_share is not None:
                allowed = "None where seen_share is given"
                raise SettingError("Ending.unseen_free_voxels", self.unseen_free_voxels, allowed)
        check_within(self, "time_limit_s", least=1e-3, most=1e9, inf=True)
        if self.max_cycles is not None:
            check_count(self, "max_cycles", 1, 2**62)

    @property
    def by_seen(self) -> bool:
        """Whether a mission ends by what the team has seen, and not by entropy."""
        return self.seen_share is not None or self.unseen_free_voxels is not None


@dataclass(frozen=True)
class Reward:
    """What a step is worth, in shares of H(0) - H_th, so that map size does not matter.

    Attributes:
        kind: `individual`: bits that the robot's own measurements took from its own map;
            `team`: mean decrease of the robots' map entropies.
        cost_per_s: Subtracted for every second that passes, 0 to 1e6. In the named scenarios 0.2 / the
            time of a good strategy's mission, so that returns tell fast from slow.
    """

    kind: Literal["individual", "team"] = "individual"
    cost_per_s: float = 0.0

    def __post_init__(self) -> None:
        """Check every field."""
        check_choice(self, "kind", Literal["individual", "team"])
        check_within(self, "cost_per_s", least=0, most=1e6)
