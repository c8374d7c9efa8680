"""How `planned-rate` explores plans of which everything is to be seen: short open tours, shared among a team.

Each robot plans a tour, as `tour` does, through the frontier cells that are nearer to it, by its paths, than
to where teammates go, by the straight line; where there is none, through all of them. A tour does not leave
behind what it would have to come back for: in plans it drives shorter paths than rules that choose one
frontier cell at a time.

A pocket is a frontier of few connected voxels: little lies behind it, and the robot need not drive to it. It
drives to a place from which all that is unknown around the frontier cell is in sight, the one that makes the
path over it to the tour's next place shortest, if that is shorter than over the cell. Where the look leaves
the cell a frontier, the robot goes on to it. To an opening it drives at once, since what lies behind has to
be explored from there.

Tuned: `sight` and `pocket`, see docs/explorers.md.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from entropy_explore_env.frontiers.blocks import NONE
from entropy_explore_env.planner.driver import NOWHERE, Goal, Scene, scanned_here
from entropy_explore_env.planner.teammates import left_to_robot
from entropy_explore_env.planner.tour import Tour, TourConfig
from entropy_explore_env.validation import check_count, check_not_negative

_SHORTER = 1e-6
"""A way is shorter if it is so by this many voxel edges."""


@dataclass(frozen=True)
class SharedTourConfig(TourConfig):
    """What is near, how much a place covers, and what is looked at from afar.

    Attributes:
        pocket: A frontier cell is at a pocket if fewer known free voxels beside unknown ones are connected
            there; their number over the sensor's range in voxels. 0 = there are no pockets.
        sight: From how far off a pocket is looked at, at most, in sensor ranges.
        around: Distance in voxels, along each axis, from the frontier cell (and what the body touches there)
            within which all unknown voxels of the frontier have to be in sight.

    Raises:
        SettingError: One of them is not allowed.
    """

    pocket: float = 0.125
    sight: float = 0.5
    around: int = 3

    def __post_init__(self) -> None:
        """Check every field."""
        super().__post_init__()
        check_not_negative(self, "pocket", "sight")
        check_count(self, "around", 1, 1000)


class SharedTour(Tour):
    """Goes through what teammates leave to the robot on a tour, and looks into pockets from outside."""

    rule = "planned-rate"
    config: SharedTourConfig

    def __init__(self, config: SharedTourConfig | None = None) -> None:
        """Take the settings; None = the defaults."""
        super().__init__(config or SharedTourConfig())

    def goal(self, scene: Scene) -> Goal:
        """See `Explorer`."""
        tour = self.tour_among(scene, *scene.paths.all_frontiers(scene.here))
        if len(tour) == 0:
            return NOWHERE
        target = int(tour[0])
        if target == scene.looked:
            return Goal(target, target, looked=True)
        return self._first_leg(scene, target, tour[1:2])

    def tour_among(self, scene: Scene, voxels: np.ndarray, lengths: np.ndarray) -> np.ndarray:
        """See `Tour`."""
        own = left_to_robot(scene, voxels, lengths)
        return super().tour_among(scene, voxels[own], lengths[own])

    def _first_leg(self, scene: Scene, target: int, onward: np.ndarray) -> Goal:
        """To the target itself, or to a place from which it is looked at.

        Args:
            scene: What the robot knows.
            target: The first place of the tour.
            onward: (1,) voxel, the second place of the tour; (0,) if the tour has only one.
        """
        cells, few = scene.cells, math.ceil(self.config.pocket * scene.cells.reach)
        if cells.opening(target, few) >= few:
            return Goal(target, target)
        sight = self.config.sight * cells.reach
        unseen = cells.unseen_around(target, self.config.around)
        if cells.first_viewing_place(np.array([scene.here], np.int32), unseen, sight) != NONE:
            return Goal(target, target, looked=True) if scanned_here(scene.view) else Goal(target, scene.here)
        places = np.append(cells.standing_around(target, sight), np.int32(target))
        lengths = scene.paths.lengths_from(scene.here, places)
        for place in onward:
            lengths = lengths + scene.paths.lengths_from(int(place), places)
        order = np.argsort(lengths, kind="stable")
        shorter = places[order[lengths[order] < lengths[-1] - _SHORTER]]
        first = cells.first_viewing_place(shorter, unseen, sight)
        return Goal(target, target if first == NONE else int(shorter[first]))
