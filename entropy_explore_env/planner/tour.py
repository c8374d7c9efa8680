"""The strategy `tour`, in the manner of TARE (Cao et al. 2021): near viewpoints and far regions in a tour.

Within a horizon of the robot, few frontier cells are chosen from which all frontier cells there can be seen
close enough: in turn, the one that covers most that is not covered yet (greedy set cover, as there). Beyond
the horizon, frontier cells are put together by coarse cells of the map; the nearest one stands for its
coarse cell. The robot goes to the first place of a short open tour from where it is through all of these.

The tour minimises the length of shortest paths between all of its places. (Lengths along the tree of paths
from the robot, which need no further searches, make it a quarter longer.) TARE solves the two levels one
after the other and takes the first solution of OR-Tools; here both are one tour, built by insertion and
improved by 2-opt and Or-opt moves (`open_tours`).

Ours: the place chosen last stays the first unless that makes the tour longer by more than a share.

Tuned: `near` and `cover`, see docs/explorers.md.
"""

from __future__ import annotations

import numpy as np

from entropy_explore_env.frontiers.blocks import NONE
from entropy_explore_env.frontiers.open_tours import open_tour, tour_length
from entropy_explore_env.planner.frontier_rule import FrontierRule
from entropy_explore_env.planner.scene import Goal, Scene


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
        """(N,) int32 places in the order of a tour through what frontier cells stand for.

        Args:
            scene: What the robot knows.
            voxels: (K,) int32, the cells.
            lengths: (K,) of the paths to them, in voxel edges.
        """
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
        """(N,) int64 places 1 to N of a short tour from place 0, which begins with a target if hardly longer.

        Args:
            between: (1 + N, 1 + N) lengths of the paths.
            target: (1,) or (0,), the place that was chosen last, less one.
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
        """Which near frontier cells cover all of them: the target, then of equally good ones the nearest."""
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
        """Of the far frontier cells, in order of distance, the first of each coarse cell; the target, too."""
        edge = max(self.coarse * scene.cells.reach, 1.0)
        cells = np.floor(scene.centres(voxels) / edge).astype(np.int64)
        if len(cells) == 0:
            return np.zeros(0, np.int64)
        numbers = np.ravel_multi_index(tuple(cells.T), tuple(cells.max(axis=0) + 1))
        _, first, of_cell = np.unique(numbers, return_index=True, return_inverse=True)
        target = np.flatnonzero(voxels == scene.target)
        first[of_cell[target]] = target
        return np.sort(first)[: self.most_far]
