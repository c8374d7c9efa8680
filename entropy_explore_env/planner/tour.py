"""Rules that go on short open tours: `tour`, and how `planned-rate` explores plans that are to be seen whole.

`tour` is in the manner of TARE (Cao et al. 2021). Within a horizon of the robot, few frontier cells are
chosen from which all frontier cells there can be seen close enough (greedy set cover, as there); beyond it,
the nearest cell stands for each coarse cell of the map. The robot goes to the first place of a short open
tour of shortest paths through all of these (`open_tours`). TARE solves the two levels one after the other.
Ours: the place chosen last stays the first unless that makes the tour longer by more than a share.

`SharedTour` plans through the frontier cells that are nearer to the robot, by its paths, than to where
teammates go, by the straight line; if no cell is, through all of them. To a dead end, a frontier of few
connected voxels behind which little lies, the robot need not drive: it looks into it from the place that
makes the path over it to the tour's next place shortest, if that is shorter than over the cell, and goes on
to the cell where the look leaves it a frontier.

Tuned: `near`, `cover`, `opening` and `view`, see docs/explorers.md.
"""

from __future__ import annotations

import math

import numpy as np

from entropy_explore_env.belief.paths.search import new_search
from entropy_explore_env.frontiers.blocks import NONE
from entropy_explore_env.frontiers.open_tours import open_tour, tour_length
from entropy_explore_env.frontiers.path_lengths import KnownPaths
from entropy_explore_env.frontiers.voxel_frontiers import VoxelFrontiers
from entropy_explore_env.planner.frontier_rule import FrontierRule
from entropy_explore_env.planner.scene import NOWHERE, Goal, Scene, scanned_here
from entropy_explore_env.settings.scenario import Scenario

_SHORTER = 1e-6
"""A way is shorter if it is so by this many voxel edges."""


class Tour(FrontierRule):
    """Goes to the first place of a tour through what is left to explore."""

    rule = "tour"
    near = 0.4
    """Longest path to a near frontier cell, in sensor ranges."""
    cover = 0.4
    """Largest distance from which a frontier cell is seen close enough, in sensor ranges."""
    most_near = 120
    """Near places at most, the nearest ones."""
    most_far = 8
    """Far places at most."""
    coarse = 1.0
    """Edge of the coarse cells, in sensor ranges."""
    stay = 0.1
    """Share by which a tour may be longer to begin where the last one did."""

    def pick(self, scene: Scene) -> int | Goal:
        """Return the voxel to go to; see `FrontierRule`."""
        places = self.tour_among(scene, *scene.paths.all_frontiers(scene.here))
        return int(places[0]) if len(places) else NONE

    def tour_among(self, scene: Scene, voxels: np.ndarray, lengths: np.ndarray) -> np.ndarray:
        """Return (N,) int32 places in the order of a tour through what (K,) frontier cells stand for."""
        if len(voxels) <= 1:
            return voxels
        order = np.argsort(lengths, kind="stable")
        voxels, lengths = voxels[order], lengths[order]
        near = lengths <= self.near * scene.cells.reach
        near[self.most_near :] = False
        kept, far = self._cover(scene, voxels[near]), self._coarse(scene, voxels[~near])
        chosen = np.concatenate([np.flatnonzero(near)[kept], np.flatnonzero(~near)[far]]).astype(np.int64)
        places = voxels[chosen]
        between = scene.paths.lengths_between(places, lengths[chosen])
        return places[self._ordered(between, np.flatnonzero(places == scene.target)) - 1]

    def _ordered(self, between: np.ndarray, target: np.ndarray) -> np.ndarray:
        """Return (N,) int64 places 1 to N of a short tour from place 0 with (1 + N, 1 + N) lengths of paths.

        It begins with the `target`, (1,) the place that was chosen last, less one, or (0,), if that makes it
        hardly longer.
        """
        tour = open_tour(between)
        if len(target) == 0:
            return tour[1:]
        first = 1 + int(target[0])
        rest = np.array([first, *(n for n in range(1, len(between)) if n != first)])
        onward = rest[open_tour(between[np.ix_(rest, rest)])]
        length = float(between[0, first]) + tour_length(between, onward)
        return onward if length <= (1.0 + self.stay) * tour_length(between, tour) else tour[1:]

    def _cover(self, scene: Scene, voxels: np.ndarray) -> list[int]:
        """Return which near frontier cells cover all: the target, then of equally good ones the nearest."""
        if len(voxels) == 0:
            return []
        seen = scene.paths.free_lines(scene.centres(voxels), self.cover * scene.cells.reach)
        left, chosen = np.ones(len(voxels), bool), []
        for target in np.flatnonzero(voxels == scene.target):
            chosen.append(int(target))
            left &= ~seen[target]
        while left.any():
            best = int(np.argmax((seen & left).sum(axis=1)))
            chosen.append(best)
            left &= ~seen[best]
        return chosen

    def _coarse(self, scene: Scene, voxels: np.ndarray) -> np.ndarray:
        """Return the nearest far frontier cell of each coarse cell, in order of distance, and the target."""
        edge = max(self.coarse * scene.cells.reach, 1.0)
        cells = np.floor(scene.centres(voxels) / edge).astype(np.int64)
        if len(cells) == 0:
            return np.zeros(0, np.int64)
        numbers = np.ravel_multi_index(tuple(cells.T), tuple(cells.max(axis=0) + 1))
        _, first, of_cell = np.unique(numbers, return_index=True, return_inverse=True)
        target = np.flatnonzero(voxels == scene.target)
        first[of_cell[target]] = target
        return np.sort(first)[: self.most_far]


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

    def grow(self, scenario: Scenario, shift: np.ndarray) -> None:
        """Go on in a larger grid, in which voxel (0, 0, 0) of the one before has the indices `shift`."""
        self._scenario, self.search = scenario, new_search(scenario.grid.voxels)
        for robot, memory in self._memories.items():
            kind, before = scenario.kind_of(robot), memory.cells
            cells = VoxelFrontiers(scenario, kind)
            cells.remember(before, shift)
            memory.cells, memory.paths = cells, KnownPaths(scenario, kind, cells, self.search)
            # What is below 0 is no voxel: NONE and the like.
            target, place = (
                voxel if voxel < 0 else int(cells.renumbered(before, np.array(voxel), shift))
                for voxel in memory.goal[:2]
            )
            memory.goal = memory.goal._replace(target=target, place=place)

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
        """Return the tour's first place, or a place from which it is looked at, as a Goal.

        `onward` is (1,) the second place of the tour; (0,) if the tour has only one.
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
