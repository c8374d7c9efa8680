"""One kind of robot of a mixed team."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from entropy_explore_env.errors import SettingError
from entropy_explore_env.settings.robot import Robot
from entropy_explore_env.settings.sensor import RangeSensor
from entropy_explore_env.settings.validation import check_fields


@dataclass(frozen=True)
class RobotKind:
    """One kind of robot of a mixed team: how it moves and what it senses."""

    robot: Robot = field(default_factory=Robot)
    sensor: RangeSensor = field(default_factory=RangeSensor)

    def __post_init__(self) -> None:
        """Check every field."""
        check_fields(self)
        if self.robot.redecide == "on_scan" and math.isinf(self.sensor.scan_every_m):
            allowed = "at_stop or a period, where RangeSensor.scan_every_m is inf"
            raise SettingError("Robot.redecide", self.robot.redecide, allowed)
