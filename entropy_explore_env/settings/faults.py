"""What goes wrong with robots during a mission, as settings: stops, sensors and radios that fail."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields

from entropy_explore_env.errors import SettingError
from entropy_explore_env.settings.validation import check, check_fields, check_within, is_whole

_MOST_ROBOTS = 1000


def _check_robots(settings: Outage | SensorFault | RadioFault) -> None:
    """Check whose fault it is."""
    robots = settings.robots
    numbers = isinstance(robots, tuple) and all(is_whole(robot, 0, _MOST_ROBOTS - 1) for robot in robots)
    if not numbers or len(set(robots)) < len(robots):
        name = f"{type(settings).__name__}.robots"
        raise SettingError(name, robots, "a tuple of different robot numbers; empty = all robots")


@dataclass(frozen=True)
class Outage:
    """When something of a robot fails, once in a mission, and for how long.

    Of a given time and a drawn one the earlier counts.

    Attributes:
        at_s: Simulated time of the failure, 1e-3 to 1e9; inf = at no given time.
        mean_s: Mean of the exponential distribution from which each robot draws a time of failure, 1e-3 to
            1e9; inf = at no drawn time.
        lasts_s: Time from the failure until the robot works again, 1e-3 to 1e9; inf = for ever.
        robots: Numbers of the robots that fail; empty = all.
    """

    at_s: float = math.inf
    mean_s: float = math.inf
    lasts_s: float = math.inf
    robots: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        """Check every field."""
        check_within(self, "at_s", "mean_s", "lasts_s", least=1e-3, most=1e9, inf=True)
        _check_robots(self)

    @property
    def happens(self) -> bool:
        """Whether it ever does."""
        return math.isfinite(self.at_s) or math.isfinite(self.mean_s)


@dataclass(frozen=True)
class SensorFault:
    """What is wrong with range sensors throughout a mission.

    Attributes:
        lost_rays: Probability that a ray brings no measurement, 0 to 1; each ray on its own.
        range_factor: Scale of the measured distance of hits, 0.1 to 10.
        range_bias_m: Offset added to the scaled distance, -1e6 to 1e6. The result is at least a thousandth of
            a voxel edge and at most the range; `RangeSensor.min_range_m` applies before and after.
        robots: Numbers of the robots with such a sensor; empty = all.
    """

    lost_rays: float = 0.0
    range_factor: float = 1.0
    range_bias_m: float = 0.0
    robots: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        """Check every field."""
        check(self, "lost_rays", "a number from 0 to 1", lambda v: 0 <= v <= 1)
        check_within(self, "range_factor", least=0.1, most=10)
        check_within(self, "range_bias_m", least=-1e6, most=1e6)
        _check_robots(self)

    @property
    def happens(self) -> bool:
        """Whether anything is wrong."""
        return self.lost_rays > 0.0 or self.range_factor != 1.0 or self.range_bias_m != 0.0


@dataclass(frozen=True)
class RadioFault:
    """What is wrong with radios throughout a mission.

    Attributes:
        garbled: Probability that a received message is garbled, 0 to 1. Garbled messages are detected,
            dropped and counted.
        repeated: Probability that a message is received twice, 0 to 1. The second copy is known by its
            number: it costs its bits, is counted and changes nothing.
        late: Probability that a message is sent late, 0 to 1, so that later ones overtake it. Old news
            changes neither where its sender was nor where it goes; late measurements are fused.
        late_s: Time that late messages wait before they are sent, 1e-3 to 3600.
        robots: Numbers of the robots with such a radio; empty = all.
    """

    garbled: float = 0.0
    repeated: float = 0.0
    late: float = 0.0
    late_s: float = 2.0
    robots: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        """Check every field."""
        for name in ("garbled", "repeated", "late"):
            check(self, name, "a number from 0 to 1", lambda v: 0 <= v <= 1)
        check_within(self, "late_s", least=1e-3, most=3600)
        _check_robots(self)

    @property
    def happens(self) -> bool:
        """Whether anything is wrong."""
        return max(self.garbled, self.repeated, self.late) > 0.0


@dataclass(frozen=True)
class Faults:
    """What goes wrong with the robots of a team; by default nothing does.

    Drawn times, rays and messages come from a random stream of their own: whether there are faults changes
    neither worlds, starts, noise nor the channel's losses.

    Attributes:
        stop: Outage of the robot: it stops at once, neither scans nor decides, neither sends nor hears. Its
            body stays in the way, its map is kept, and when it works again it decides anew. A mission in
            which all robots have stopped for good is cut off.
        blind: Outage of the sensor: scans measure nothing.
        silent: Outage of the radio: no message leaves the robot or reaches it.
        sensor: Lost rays and wrong distances.
        radio: Messages that arrive garbled, twice, or out of order.
    """

    stop: Outage = field(default_factory=Outage)
    blind: Outage = field(default_factory=Outage)
    silent: Outage = field(default_factory=Outage)
    sensor: SensorFault = field(default_factory=SensorFault)
    radio: RadioFault = field(default_factory=RadioFault)

    def __post_init__(self) -> None:
        """Check every field."""
        check_fields(self)

    @property
    def parts(self) -> dict[str, Outage | SensorFault | RadioFault]:
        """Name → what may go wrong."""
        return {each.name: getattr(self, each.name) for each in fields(self)}

    @property
    def happen(self) -> bool:
        """Whether anything goes wrong."""
        return any(part.happens for part in self.parts.values())
