"""How `planned-rate` explores plans of which everything is to be seen: short open tours, shared among a team.

Each robot plans a tour, as `tour` does, through the frontier cells that are nearer to it, by its paths, than
to where teammates go, by the straight line; where there is none, through all of them. A tour does not leave
behind what it would have to come back for: in plans it drives shorter paths than rules that choose one
frontier cell at a time.

Beside a frontier cell at a pocket, few connected voxels, little can lie that would have to be entered. The
robot drives only to a place from which all that is unknown around the cell is in sight, the one that makes
the path over it to the tour's next place shortest. To an opening it drives on to the cell, since what lies
behind has to be explored from there.

Tuned: `sight` and `pocket`, see docs/explorers.md.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from baselines.strategies.explorers.explorer import Goal, Scene
from baselines.strategies.explorers.teammates import left_to_robot
from baselines.strategies.explorers.tour import Tour, TourConfig
from baselines.strategies.frontier.voxel.map import NONE
from entropy_explore_env.validation import check_count, check_not_negative

_SHORTER = 1e-6
"""A way is shorter if it is so by this many voxel edges."""


@dataclass(frozen=True)
class SharedTourConfig(TourConfig):
    """What is near, how much a place covers, and what is looked at from afar.

    Attributes:
        pocket: Frontier cells with fewer connected known free voxels beside unknown ones, in sensor ranges,
            are looked at from where they are in sight; 0 = none is.
        sight: From how far off at most, in sensor ranges.
        around: So many voxels around the cell, along either axis, what is unknown is to be in sight.

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
        return Goal(int(tour[0]), self._lookout(scene, tour)) if len(tour) else Goal(NONE, NONE)

    def tour_among(self, scene: Scene, voxels: np.ndarray, lengths: np.ndarray) -> np.ndarray:
        """See `Tour`."""
        own = left_to_robot(scene, voxels, lengths)
        return super().tour_among(scene, voxels[own], lengths[own])

    def _lookout(self, scene: Scene, tour: np.ndarray) -> int:
        """Where the robot drives to explore the first of (N,) places of a tour, N > 0."""
        cells, target = scene.cells, int(tour[0])
        few = math.ceil(self.config.pocket * cells.reach)
        if cells.opening(target, few) >= few:
            return target
        sight = self.config.sight * cells.reach
        unseen = cells.unseen_around(target, self.config.around)
        if cells.first_lookout(np.array([scene.here], np.int32), unseen, sight) != NONE:
            return target  # what is in sight and was not seen is seen from nearby
        places = np.append(cells.standing_around(target, sight), np.int32(target))
        lengths = scene.paths.lengths_from(scene.here, places)
        if len(tour) > 1:
            lengths = lengths + scene.paths.lengths_from(int(tour[1]), places)
        order = np.argsort(lengths, kind="stable")
        shorter = places[order[lengths[order] < lengths[-1] - _SHORTER]]
        first = cells.first_lookout(shorter, unseen, sight)
        return target if first == NONE else int(shorter[first])
