"""Landmarks by which robots correct what they believe of their poses."""

from __future__ import annotations

import math
from dataclasses import dataclass

from entropy_explore_env.errors import SettingError
from entropy_explore_env.settings.validation import check_count, check_within, is_number

MAX_FIDUCIALS = 1000
MAX_OWN = 64
"""Landmarks that a robot keeps."""


@dataclass(frozen=True)
class Fiducials:
    """Landmarks of the world whose places all robots know; by default there are none.

    A robot that scans sights those that are within `range_m` and its sensor's range, in its sensor's field of
    view, and not behind anything solid or a teammate's body. It knows which one it sees. What it sees, where
    the landmark is from the robot, corrects its estimate of its pose. They matter to robots that drift
    (`Localization`); nothing else changes with them.

    Attributes:
        number: Number of fiducials drawn in each mission, 0 to 1000, on surfaces that robots can see: beside
            a face that separates a free voxel from a solid one, or from the workspace's end.
        positions_m: Places of given fiducials, (x, y, z) each, in the map frame and in free space. In a 2-D
            world z does not matter. Lists become tuples.
        range_m: Largest distance of a sighting, 1e-6 to 1e6; inf = as far as the sensor sees.
        range_sigma_m: Standard deviation of a sighting along the line of sight, 1e-6 to 1e6.
        bearing_sigma_rad: Standard deviation of a sighting's direction, sideways and up, 1e-6 to 10.
        own_number: Number of landmarks that each robot keeps in its own map, 0 to 64: corners that it chooses
            in its scans and sights again like fiducials. They take back the error added since it chose
            them, and no more.
        own_score: Least worth of a landmark of its own map (Sujan, eq. 17), 0 to 2: `missions.landmarks`.
        own_apart_m: Least distance between two landmarks of its own map, 0 to 1e6.
    """

    number: int = 0
    positions_m: tuple[tuple[float, float, float], ...] = ()
    range_m: float = math.inf
    range_sigma_m: float = 0.05
    bearing_sigma_rad: float = 0.01
    own_number: int = 0
    own_score: float = 0.7
    own_apart_m: float = 1.0

    def __post_init__(self) -> None:
        """Check every field."""
        check_count(self, "number", 0, MAX_FIDUCIALS)
        if isinstance(self.positions_m, list | tuple):  # lists as JSON and users write them
            inner = [tuple(place) if isinstance(place, list) else place for place in self.positions_m]
            object.__setattr__(self, "positions_m", tuple(inner))
        places = self.positions_m
        if (
            not isinstance(places, tuple)
            or len(places) > MAX_FIDUCIALS
            or not all(isinstance(place, tuple) and len(place) == 3 for place in places)
            or not all(is_number(number) and abs(number) <= 2e9 for place in places for number in place)
        ):
            allowed = (
                f"a tuple or list of at most {MAX_FIDUCIALS} places (x, y, z), each number from -2e9 to 2e9"
            )
            raise SettingError("Fiducials.positions_m", places, allowed)
        if self.number > 0 and places:
            raise SettingError("Fiducials.number", self.number, "0 where positions_m are given")
        check_within(self, "range_m", least=1e-6, most=1e6, inf=True)
        check_within(self, "range_sigma_m", least=1e-6, most=1e6)
        check_within(self, "bearing_sigma_rad", least=1e-6, most=10)
        check_count(self, "own_number", 0, MAX_OWN)
        check_within(self, "own_score", least=0, most=2)
        check_within(self, "own_apart_m", least=0, most=1e6)

    @property
    def count(self) -> int:
        """F, how many there are in a mission."""
        return self.number or len(self.positions_m)
