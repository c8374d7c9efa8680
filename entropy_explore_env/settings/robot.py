"""How a robot moves, and when it decides."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal

from entropy_explore_env.errors import SettingError, did_you_mean
from entropy_explore_env.settings.localization import Localization
from entropy_explore_env.settings.validation import check, check_fields, check_within, is_number

MIN_REDECIDE_S = 0.01
"""A shorter period between decisions under way would only cost time."""
_REDECIDE = ("at_stop", "on_scan")


@dataclass(frozen=True)
class Robot:
    """How a robot moves: from rest to rest, straight (Rocha04, table 1) or on a planned way.

    Attributes:
        motion: `free` flies anywhere; `planar` keeps the height of its sensor and, unless it `tilts`, looks
            level.
        navigator: `straight` drives straight to the viewpoint; `planned` takes the cheapest way through
            the robot's own belief, below the ceiling where the world has one (all robots know where it
            is), without stopping at its corners.
        unknown_cost: Cost of a metre through unknown voxels on planned paths, in metres through known ones,
            1 to 1e6.
        reach_m: Largest displacement of one decision (ξ of Rocha04, eq. 32), 1e-6 to 1e6;
            inf = the workspace.
        max_speed_m_s: Top speed, 1e-4 to 1e4.
        acceleration_m_s2: Acceleration and deceleration, 1e-4 to 1e6.
        turn_rate_rad_s: Rate of yaw and pitch, while driving, 1e-4 to 1e6; inf = at once.
        body_radius_m: The body is a ball; 0 = a point that blocks no robot. At most 1e6.
        sensor_height_m: Planar robots: height of the sensor above the workspace's floor, 0 to 1e6.
        tilts: Planar robots: whether the sensor also looks up and down, as a camera on a mast; not in 2-D.
        above_ground_m: Planar robots: the sensor's height above the ground that must carry the robot, 1e-6 to
            1e6. A drive ends before a place below which some of the body's circle has no solid voxel there
            (MoveEnd.EDGE). None, and in 2-D: it needs no ground.
        when_blocked: What follows a drive that a teammate cut short (MoveEnd.TEAMMATE), after the scan where
            it stopped: `wander` decides at once; `wait` stands still first.
        blocked_wait_s: Time from that scan to the decision with `wait`, 1e-4 to 1e5.
        redecide: When a robot decides: `at_stop`, only where it stops; `on_scan`, also at every scan under
            way (`RangeSensor.scan_every_m`); a number, also whenever that many seconds, at least 0.01, have
            passed since its last decision. It drives on meanwhile: see missions/redecision.py.
        localization: Drift of the robot's estimate of its pose; none by default.
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
        check_fields(self)
        check(self, "unknown_cost", "a number from 1 to 1e6", lambda v: 1.0 <= v <= 1e6)
        check_within(self, "reach_m", least=1e-6, most=1e6, inf=True)
        check_within(self, "max_speed_m_s", least=1e-4, most=1e4)
        check_within(self, "acceleration_m_s2", least=1e-4, most=1e6)
        check_within(self, "turn_rate_rad_s", least=1e-4, most=1e6, inf=True)
        check_within(self, "body_radius_m", "sensor_height_m", least=0, most=1e6)
        if self.above_ground_m is not None:
            check(self, "above_ground_m", "None, or a number from 1e-6 to 1e6", lambda v: 1e-6 <= v <= 1e6)
        check_within(self, "blocked_wait_s", least=1e-4, most=1e5)
        periodic = is_number(self.redecide) and MIN_REDECIDE_S <= self.redecide < math.inf
        if not periodic and not (isinstance(self.redecide, str) and self.redecide in _REDECIDE):
            allowed = f"one of {', '.join(_REDECIDE)}, or a finite number of seconds ≥ {MIN_REDECIDE_S}"
            allowed += did_you_mean(self.redecide, _REDECIDE)
            raise SettingError("Robot.redecide", self.redecide, allowed)

    @property
    def planning_radius_m(self) -> float:
        """How wide a body it plans its paths for: its own, wider by the margin where it drifts."""
        wider_m = self.localization.margin_m if self.localization.drifts else 0.0
        return self.body_radius_m + wider_m
