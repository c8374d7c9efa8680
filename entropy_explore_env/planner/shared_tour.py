"""How `planned-rate` explores plans of which everything is to be seen: short open tours, shared among a team.

Each robot plans a tour, as `tour` does, through the frontier cells that are nearer to it, by its paths, than
to where teammates go, by the straight line; where there is none, through all of them. A tour does not leave
behind what it would have to come back for: in plans it drives shorter paths than rules that choose one
frontier cell at a time.

A dead end is a frontier of few connected voxels: little lies behind it, and the robot need not drive to it.
It drives to a place from which all that is unknown around the frontier cell is in sight, the one that makes
the path over it to the tour's next place shortest, if that is shorter than over the cell. Where the look
leaves the cell a frontier, the robot goes on to it. To an opening it drives at once, since what lies behind
has to be explored from there.

Tuned: `opening` and `view`, see docs/explorers.md.
"""

from __future__ import annotations

import math

import numpy as np

from entropy_explore_env.frontiers.blocks import NONE
from entropy_explore_env.planner.scene import NOWHERE, Goal, Scene, scanned_here
from entropy_explore_env.planner.tour import Tour

_SHORTER = 1e-6
"""A way is shorter if it is so by this many voxel edges."""


class SharedTour(Tour):
    """Goes on a tour through what teammates leave to the robot, and looks into dead ends from outside."""

    rule = "planned-rate"
    opening = 0.125
    """A frontier is a dead end if it has fewer connected known free voxels; over the sensor's range."""
    view = 0.5
    """Largest distance from which a dead end is looked at, in sensor ranges."""
    around = 3
    """Distance in voxels, along each axis, from what the body touches in the frontier cell, within which all
    unknown voxels of the frontier have to be visible."""

    def pick(self, scene: Scene) -> Goal:
        """Return the voxel to go to; see `FrontierRule`."""
        tour = self.tour_among(scene, *scene.paths.all_frontiers(scene.here))
        if len(tour) == 0:
            return NOWHERE
        target = int(tour[0])
        if target == scene.looked:
            return Goal(target, target, looked=True)
        return self._first_leg(scene, target, tour[1:2])

    def tour_among(self, scene: Scene, voxels: np.ndarray, lengths: np.ndarray) -> np.ndarray:
        """See `Tour`."""
        own = scene.nearer_than_teammates(voxels, lengths)
        return super().tour_among(scene, voxels[own], lengths[own])

    def _first_leg(self, scene: Scene, target: int, onward: np.ndarray) -> Goal:
        """To the target itself, or to a place from which it is looked at.

        Args:
            scene: What the robot knows.
            target: The first place of the tour.
            onward: (1,) voxel, the second place of the tour; (0,) if the tour has only one.
        """
        cells, few = scene.cells, math.ceil(self.opening * scene.cells.reach)
        if cells.opening(target, few) >= few:
            return Goal(target, target)
        sight = self.view * cells.reach
        unseen = cells.unseen_around(target, self.around)
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
