"""A scenario: one task, put together from its parts and checked as a whole."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar, Literal

import numpy as np

from entropy_explore_env.errors import SettingError, counted
from entropy_explore_env.settings.action import Action
from entropy_explore_env.settings.channel import BITS_PER_MEASUREMENT, BITS_PER_RECEIPT, Channel
from entropy_explore_env.settings.ending import SIGMA_PRIOR, Ending
from entropy_explore_env.settings.faults import Faults
from entropy_explore_env.settings.fiducials import Fiducials
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.observation import Observation
from entropy_explore_env.settings.reward import Reward
from entropy_explore_env.settings.robot import Robot
from entropy_explore_env.settings.robot_kind import RobotKind
from entropy_explore_env.settings.sensor import RangeSensor
from entropy_explore_env.settings.validation import check_count, check_fields, check_within

MAX_IN_FLIGHT = 2**24
"""Measurements of delayed messages that may be under way at once."""
MAX_MESSAGES = 2**16
"""Delayed messages that may be under way at once: every event looks through all of them."""
MAX_DRIVE_S = 1e5
"""A robot drives straight across the workspace in this time, or less."""
MAX_BROADCASTS = 200_000
"""Broadcasts in phases within a step."""
MAX_SCANS_UNDER_WAY = 20_000
"""Scans under way, straight across the workspace."""
BACKLOG_SCANS = 64
"""Scans of each robot that are kept where measurements are sent by need."""
MAX_ACTIONS = 2**20
"""Discrete actions, counted with those in the corners beyond reach."""


@dataclass(frozen=True)
class Scenario:
    """One task: a kind of world, the team in it, what it may do and when it is over.

    Attributes:
        name: Name of the scenario.
        grid: Size and resolution of the workspace; a world from a file brings its own. In a world
            one voxel high robots look level and the sensor's field of view has no pitch.
        world: How the truth is made: the name of a recipe (`empty`, `furnished`, `office`, … in
            worlds/recipes), or the path of a world file.
        split: Which worlds a recipe makes: `train`, `validation` and `test` have none in common
            (worlds/splits.py). Files, and recipes without chance, are one world in all of them.
        robots: Team size A.
        robot: How robots move.
        sensor: What robots sense.
        extra_kinds: Further kinds of robots, for a mixed team: of K kinds in all, the first being `robot`
            with `sensor`, robot a is of kind a mod K. All share one form of action and observation
            (missions/action.py, missions/observation/layout.py).
        start_radius_m: Largest distance of a robot's start from that of the first one; inf = anywhere.
        decision_period_s: Duration of a step, 1e-3 to 1e5; None = until the next robot has to decide.
        track_truth: Whether the team's joint map, of everything measured, is kept and compared with the
            truth, for figures only. It costs one more map a mission. It is True where the ending asks for
            what was seen.
        faults: Failures of robots, sensors and radios; none by default.
        fiducials: Landmarks by which robots that drift correct what they believe of their poses
            (`Robot.localization`); none by default.
    """

    sigma_prior: ClassVar[float] = SIGMA_PRIOR
    """Standard deviation of coverage before any measurement; the mean is ½."""

    name: str
    grid: Grid
    world: str = "empty"
    split: Literal["train", "validation", "test"] = "train"
    robots: int = 3
    start_radius_m: float = math.inf
    decision_period_s: float | None = 1.0
    track_truth: bool = False
    robot: Robot = field(default_factory=Robot)
    sensor: RangeSensor = field(default_factory=RangeSensor)
    extra_kinds: tuple[RobotKind, ...] = ()
    channel: Channel = field(default_factory=Channel)
    faults: Faults = field(default_factory=Faults)
    fiducials: Fiducials = field(default_factory=Fiducials)
    ending: Ending = field(default_factory=Ending)
    reward: Reward = field(default_factory=Reward)
    action: Action = field(default_factory=Action)
    observation: Observation = field(default_factory=Observation)

    def __post_init__(self) -> None:
        """Check every field, and that the parts fit each other; level the sensor in a 2-D world."""
        check_fields(self)
        if not isinstance(self.extra_kinds, tuple) or not all(
            isinstance(o, RobotKind) for o in self.extra_kinds
        ):
            raise SettingError("Scenario.extra_kinds", self.extra_kinds, "a tuple of RobotKind")
        if self.grid.flat:
            object.__setattr__(self, "sensor", _level(self.sensor))
            extra_kinds = tuple(RobotKind(kind.robot, _level(kind.sensor)) for kind in self.extra_kinds)
            object.__setattr__(self, "extra_kinds", extra_kinds)
        check_count(self, "robots", 1, 1000)
        check_within(self, "start_radius_m", least=1e-6, most=1e6, inf=True)
        if self.decision_period_s is not None:
            check_within(self, "decision_period_s", least=1e-3, most=1e5)
        if self.ending.by_seen:
            object.__setattr__(self, "track_truth", True)
        if self.observation.overlaps and self.action.kind != "candidates":
            raise SettingError("Observation.overlaps", True, "False, unless Action.kind is 'candidates'")
        for kind in self.kinds:
            self._check_kind(kind.robot)
            self._check_drives(kind)
        self._check_broadcasts()
        self._check_receipts()
        self._check_faults()
        self._check_fiducials()
        allowed = f"a time so short that at most {MAX_MESSAGES} messages are under way at once"
        name, longest_s = ("Channel.delay_s", self.channel.delay_s)
        if self.faults.radio.late > 0.0 and self.faults.radio.late_s > self.channel.delay_s:
            name, longest_s = ("RadioFault.late_s", self.faults.radio.late_s)
        if self.message_slots > MAX_MESSAGES:
            raise SettingError(name, longest_s, allowed)
        allowed = f"a time so short that at most {MAX_IN_FLIGHT} measurements are under way at once"
        if self.message_slots * max(self.batch_measurements, 1) > MAX_IN_FLIGHT:
            raise SettingError(name, longest_s, allowed)
        if 2 * self.robots * self.phase_batches * max(self.batch_measurements, 1) > MAX_IN_FLIGHT:
            raise SettingError("Channel.phase_s", self.channel.phase_s, allowed)

    def _check_kind(self, robot: Robot) -> None:
        """Check that a kind of robot fits the grid and the actions."""
        if self.action.kind == "discrete" and not math.isfinite(robot.reach_m):
            raise SettingError("Action.kind", "discrete", "continuous where Robot.reach_m is inf")
        if self.action.kind == "discrete" and robot.reach_m < self.grid.voxel_size_m:
            allowed = f"at least a voxel ({self.grid.voxel_size_m} m) for discrete actions"
            raise SettingError("Robot.reach_m", robot.reach_m, allowed)
        if self.action.kind == "discrete" and self.action.moves == "all":  # along the axes there are few
            steps = math.floor(robot.reach_m / self.grid.voxel_size_m + 1e-9)
            axes = self.grid.shape[:2] if self.in_planes else self.grid.shape
            moves = math.prod(2 * min(steps, n - 1) + 1 for n in axes)
            actions = moves * self.action.yaws * self.action.pitches
            if actions > MAX_ACTIONS:
                allowed = f"a reach with at most {MAX_ACTIONS:,} discrete actions (not {actions:,}), "
                allowed += "or moves along the axes alone: Action.moves = 'axes'"
                raise SettingError("Robot.reach_m", robot.reach_m, allowed)
        layer = self.layer_of(robot)
        if layer is not None and layer >= self.grid.shape[2]:
            allowed = f"below the workspace's height ({self.grid.size_m[2]} m)"
            raise SettingError("Robot.sensor_height_m", robot.sensor_height_m, allowed)
        ground = self.ground_layer_of(robot)
        if ground is not None and ground < 0:
            allowed = f"at least a voxel ({self.grid.voxel_size_m} m) less than sensor_height_m"
            raise SettingError("Robot.above_ground_m", robot.above_ground_m, allowed)

    def _check_receipts(self) -> None:
        """Check that beside its receipts a message by need has room for a measurement."""
        least = 1 + math.ceil((self.robots - 1) * BITS_PER_RECEIPT / BITS_PER_MEASUREMENT)
        if self.backlog_scans and self.channel.burst < least:
            allowed = f"0, or at least {least} where robots send by need: receipts for {self.robots - 1} "
            allowed += "teammates take the bits of the others"
            raise SettingError("Channel.burst", self.channel.burst, allowed)

    def _check_faults(self) -> None:
        """Check that faults are those of robots that there are, and fit the channel."""
        for part in self.faults.parts.values():
            if part.robots and max(part.robots) >= self.robots:
                allowed = f"numbers of robots of the team, which are below {self.robots}"
                raise SettingError(f"{type(part).__name__}.robots", part.robots, allowed)
        if self.faults.radio.late > 0.0 and self.channel.phase_s > 0.0:
            allowed = "0 where batches are broadcast in phases"
            raise SettingError("RadioFault.late", self.faults.radio.late, allowed)
        if self.faults.radio.late > 0.0 and self.channel.order == "need":
            allowed = '0 where Channel.order is "need": receipts tell what was heard at once'
            raise SettingError("RadioFault.late", self.faults.radio.late, allowed)

    def _check_fiducials(self) -> None:
        """Check that given fiducials are in the workspace."""
        low = np.asarray(self.grid.origin_m)
        high, axes = low + self.grid.size_m, 2 if self.grid.flat else 3
        for place in self.fiducials.positions_m:
            where = np.asarray(place)
            if ((where < low) | (where >= high))[:axes].any():
                allowed = f"places from {low.tolist()} to {high.tolist()} m, the workspace"
                raise SettingError("Fiducials.positions_m", place, allowed)

    def _check_drives(self, kind: RobotKind) -> None:
        """Check that a drive takes a day at most and few scans, so that a step soon returns."""
        across_m = float(np.linalg.norm(self.grid.size_m))
        robot, every_m = kind.robot, kind.sensor.scan_every_m
        if 2.0 * robot.body_radius_m > self.grid.size_m.max():
            allowed = f"at most half the workspace's longest edge ({self.grid.size_m.max():.6g} m)"
            raise SettingError("Robot.body_radius_m", robot.body_radius_m, allowed)
        if across_m / robot.max_speed_m_s > MAX_DRIVE_S:
            allowed = f"at least {across_m / MAX_DRIVE_S:.3g}: across the workspace in {MAX_DRIVE_S:g} s"
            raise SettingError("Robot.max_speed_m_s", robot.max_speed_m_s, allowed)
        least = 4.0 * across_m / MAX_DRIVE_S**2
        if robot.acceleration_m_s2 < least:
            allowed = f"at least {least:.3g}: across the workspace in {MAX_DRIVE_S:g} s"
            raise SettingError("Robot.acceleration_m_s2", robot.acceleration_m_s2, allowed)
        if across_m / every_m > MAX_SCANS_UNDER_WAY:
            allowed = (
                f"at least {across_m / MAX_SCANS_UNDER_WAY:.3g}, a share of the workspace's diagonal, or inf"
            )
            raise SettingError("RangeSensor.scan_every_m", every_m, allowed)

    def _check_broadcasts(self) -> None:
        """Check that a step, as long as the slowest robot may take to decide again, has few broadcasts."""
        step_s = self.decision_period_s or max(
            driving_time_s(kind.robot, float(np.linalg.norm(self.grid.size_m)))
            + math.pi / kind.robot.turn_rate_rad_s
            + kind.sensor.scan_time_s
            + kind.robot.blocked_wait_s
            for kind in self.kinds
        )
        least_s = min(step_s, self.ending.time_limit_s) / MAX_BROADCASTS
        if 0.0 < self.channel.phase_s / self.channel.repeats < least_s:
            allowed = (
                f"0, or at least {least_s * self.channel.repeats:.3g}: {MAX_BROADCASTS} broadcasts a step"
            )
            raise SettingError("Channel.phase_s", self.channel.phase_s, allowed)

    @cached_property
    def kinds(self) -> tuple[RobotKind, ...]:
        """The K kinds of robots in the team."""
        return (RobotKind(self.robot, self.sensor), *self.extra_kinds)[: self.robots]

    def kind_of(self, robot: int) -> RobotKind:
        """Return what a robot of the team, by its number, is."""
        return self.kinds[robot % len(self.kinds)]

    @property
    def message_slots(self) -> int:
        """Messages that can be under way at once: two a scan and robot, while the delay lasts.

        Between two scans a robot stands still for the latter or drives to it, at most at top speed. A robot
        that decides under way by time may announce so much more often.
        """
        longest_s = self.longest_delay_s
        if longest_s == 0.0 or self.robots == 1:
            return 0
        periods = [kind.robot.redecide for kind in self.kinds if not isinstance(kind.robot.redecide, str)]
        more = math.floor(longest_s / min(periods)) + 2 if periods else 0
        more += 2 if self.faults.stop.happens else 0  # a robot that works again decides without a scan before
        return (2 * self._scans_within(longest_s) + more) * self.robots

    @property
    def longest_delay_s(self) -> float:
        """Longest time from a message's sending to its arrival, that of late messages included."""
        late_s = self.faults.radio.late_s if self.faults.radio.late > 0.0 else 0.0
        return self.channel.delay_s + late_s

    @property
    def phase_batches(self) -> int:
        """Batches that a robot can collect in a phase of the broadcast; 0 where they are sent at once."""
        return 0 if self.channel.phase_s == 0.0 else self._scans_within(self.channel.phase_s)

    @property
    def shares_summaries(self) -> bool:
        """Whether robots send summaries of maps to each other."""
        return self.channel.content == "summaries" and self.channel.burst > 0 and self.robots > 1

    @property
    def backlog_scans(self) -> int:
        """Scans of each robot that are kept to be sent by need; 0 where the latest is sent by utility."""
        needed = self.channel.order == "need" and self.channel.burst > 0 and self.robots > 1
        return BACKLOG_SCANS if needed else 0

    @property
    def batch_measurements(self) -> int:
        """Most measurements of a batch: no more than a scan has rays; 0 where summaries are sent."""
        rays = max(kind.sensor.rays for kind in self.kinds)
        return 0 if self.shares_summaries else min(self.channel.burst, rays)

    @property
    def summary_slots(self) -> int:
        """Summaries of one robot that can be under way at once."""
        if not self.shares_summaries or self.longest_delay_s == 0.0:
            return 0
        sent = self.longest_delay_s / max(self.channel.summary_every_s, 1e-9)
        return min(math.floor(min(sent, 1e9)) + 2, self._scans_within(self.longest_delay_s))

    def _scans_within(self, time_s: float) -> int:
        """Return the scans that a robot can take in this time, and two more."""
        apart_s = min(
            min(kind.sensor.scan_time_s, kind.sensor.scan_every_m / kind.robot.max_speed_m_s)
            for kind in self.kinds
        )
        return math.floor(min(time_s / apart_s, 1e9)) + 2

    @property
    def most_decisions(self) -> int:
        """Decisions of a robot on its own that the time limit leaves time for: a scan follows each of them.

        Decisions under way (`Robot.redecide`) are not counted. At most 2⁶².
        """
        decisions = self.ending.time_limit_s / self.sensor.scan_time_s
        return math.ceil(min(decisions, 2.0**62)) + 1

    @property
    def drifts(self) -> bool:
        """Whether some robot's estimate of its pose ever differs from the truth."""
        return any(kind.robot.localization.drifts for kind in self.kinds)

    @property
    def planar(self) -> bool:
        """Whether the whole team stays in planes and looks level."""
        return all(self.looks_level(kind.robot) for kind in self.kinds)

    @property
    def in_planes(self) -> bool:
        """Whether the whole team stays in planes, wherever it looks."""
        return all(self.layer_of(kind.robot) is not None for kind in self.kinds)

    def looks_level(self, robot: Robot) -> bool:
        """Return whether a kind of robot stays in a plane and its sensor never looks up or down."""
        return self.layer_of(robot) is not None and (self.grid.flat or not robot.tilts)

    def ground_layer_of(self, robot: Robot) -> int | None:
        """Return the voxel layer that must carry a kind of robot, < 0 below all; None if it needs none."""
        layer = self.layer_of(robot)
        if self.grid.flat or layer is None or robot.above_ground_m is None:
            return None
        below_m = robot.sensor_height_m - robot.above_ground_m
        return math.floor(below_m / self.grid.voxel_size_m + 1e-9) - 1

    def layer_of(self, robot: Robot) -> int | None:
        """Return the voxel layer in which a kind of robot and its sensor stay; None if it flies.

        Planar robots have one, and in 2-D worlds any robot.
        """
        if self.grid.flat:
            return 0
        layers = robot.sensor_height_m / self.grid.voxel_size_m
        return int(layers + 1e-9) if robot.motion == "planar" else None  # 0.3 / 0.1 is 3

    def plane_m(self, robot: int) -> float | None:
        """Return the height z, map frame, of the plane in which a robot stays; None if it flies."""
        layer = self.layer_of(self.kind_of(robot).robot)
        return None if layer is None else float(self.grid.centre_of(np.array([0, 0, layer]))[2])

    @property
    def in_short(self) -> str:
        """Name, team and voxels in one line."""
        x, y, z = self.grid.shape
        team = counted(self.robots, "robot")
        return f"{self.name!r}, {team}, {x} × {y} × {z} voxels of {self.grid.voxel_size_m:g} m"

    def __repr__(self) -> str:
        """Name, team and voxels; `settings_of` gives all settings."""
        return f"Scenario({self.in_short})"

    @cached_property
    def agents(self) -> tuple[str, ...]:
        """Names of the robots: robot_0, robot_1 and so on."""
        return tuple(f"robot_{a}" for a in range(self.robots))


def driving_time_s(robot: Robot, length_m: float) -> float:
    """Return the seconds from rest to rest: up to top speed and down again, with or without time between."""
    ramp_s = min(robot.max_speed_m_s / robot.acceleration_m_s2, math.sqrt(length_m / robot.acceleration_m_s2))
    return length_m / robot.max_speed_m_s + ramp_s


def _level(sensor: RangeSensor) -> RangeSensor:
    """Return the sensor without pitch."""
    return dataclasses.replace(sensor, field_of_view_rad=(sensor.field_of_view_rad[0], 0.0))
