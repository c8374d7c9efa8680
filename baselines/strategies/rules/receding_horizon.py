"""The strategy `receding-horizon`: the next best view by a random tree of places (Bircher et al. 2016).

A rapidly exploring random tree (LaValle 1998) grows from the robot through known free space. A place n_k at
the end of a branch n_1 … n_k is worth

    gain(n_k) = gain(n_(k-1)) + unknown(n_k) exp(-λ c(n_k))

with unknown(n) the number of unknown voxels that the sensor would see from n, and c(n) the length of the
branch up to n. The robot drives along the first edge of the branch of greatest gain, then grows a new tree,
from what is left of that branch.

Ours: a place from which the robot has scanned has no gain, so that slivers which rays miss do not hold it;
where no place of a larger tree has a gain either, it goes to the nearest frontier cell (the paper's planner
ends there, and is known to end too early: Selin et al. 2019 go to remembered frontiers, too).
"""

from __future__ import annotations

import numpy as np

from entropy_explore_env.planner.frontier_rule import FrontierRule
from entropy_explore_env.planner.scene import Scene, best_of
from entropy_explore_env.settings.scenario import Scenario

_DECAY = 8.0
"""λ, for each sensor range; tuned: see docs/explorers.md."""
_EDGE, _AROUND = 0.4, 1.5
"""Longest edge of the tree, and half the width of the box in which places are drawn, in sensor ranges."""
_SIZES = 30, 120
"""Places of a tree, and of a larger one that is grown where none of the first has a gain."""
_LEAST_GAIN = 2.0
"""Unknown voxels, weighed, below which a branch has no gain."""
_DRAWS = 4
"""Places that are drawn at most, for each place of a tree."""


class Tree:
    """A tree of places: the robot's first."""

    def __init__(self, root: np.ndarray) -> None:
        """Begin with a place (3,), in voxel edges."""
        self.places, self.parents, self.lengths = [root], [0], [0.0]

    def add(self, place: np.ndarray, parent: int) -> None:
        """Grow by one place (3,); `lengths` holds that of the branch up to it."""
        step = float(np.linalg.norm(place - self.places[parent]))
        self.lengths.append(self.lengths[parent] + step)
        self.parents.append(parent)
        self.places.append(place)

    def branch_to(self, last: int) -> list[int]:
        """Return the numbers of the places of the branch that ends in a place, without the root."""
        branch = [last]
        while self.parents[branch[-1]] != 0:
            branch.append(self.parents[branch[-1]])
        return branch[::-1]


class RecedingHorizon(FrontierRule):
    """Drives along the first edge of the best branch of a random tree."""

    rule = "receding-horizon"
    until_reached = True

    def reset(self, scenario: Scenario, rng: np.random.Generator) -> None:
        """Begin a mission."""
        super().reset(scenario, rng)
        self._scanned: dict[int, set[int]] = {}
        self._branches: dict[int, list[np.ndarray]] = {}

    def pick(self, scene: Scene) -> int:
        """Return the voxel to go to; see `FrontierRule`."""
        robot = scene.view.robot
        scanned = self._scanned.setdefault(robot, set())
        scanned.add(scene.here)
        tree = Tree(scene.centres(np.array([scene.here]))[0])
        for place in self._branches.get(robot, []):
            if not scene.paths.is_line_free(tree.places[-1], place):
                break
            tree.add(place, len(tree.places) - 1)
        free = scene.free_around(max(int(_AROUND * scene.cells.reach), 1))
        for size in _SIZES:
            self._grow(scene, tree, free, size)
            indices = np.array(tree.places).astype(int)
            numbers = np.ravel_multi_index(tuple(indices.T), scene.view.scenario.grid.shape)
            voxels = np.asarray(numbers, np.int32)
            worth = _gains(scene, tree, voxels, scanned)
            if worth.max() >= _LEAST_GAIN:
                first, *rest = tree.branch_to(int(np.argmax(worth)))
                self._branches[robot] = [tree.places[place] for place in rest]
                return int(voxels[first])
        self._branches[robot] = []
        voxels, lengths = scene.paths.nearest_frontiers()
        return best_of(voxels, -lengths, scene.target)

    def _grow(self, scene: Scene, tree: Tree, free: np.ndarray, size: int) -> None:
        """Add random places of (N,) free voxels until there are `size`, or enough were drawn."""
        longest = _EDGE * scene.cells.reach
        for _ in range(_DRAWS * size):
            if len(tree.places) >= size or len(free) == 0:
                return
            drawn = scene.centres(free[self._rng.integers(len(free), size=1)])[0]
            apart = np.linalg.norm(np.array(tree.places) - drawn, axis=1)
            nearest = int(np.argmin(apart))
            start = tree.places[nearest]
            place = start + (drawn - start) * min(1.0, longest / max(float(apart[nearest]), 1e-9))
            place = np.floor(place) + 0.5
            if (place != start).any() and scene.paths.is_line_free(start, place):
                tree.add(place, nearest)


def _gains(scene: Scene, tree: Tree, voxels: np.ndarray, scanned: set[int]) -> np.ndarray:
    """Return the gains (K,) of the branches that end in each place, which lie in (K,) voxels."""
    unknown = scene.cells.gains(voxels)
    unknown[[int(voxel) in scanned for voxel in voxels]] = 0.0
    gains = unknown * np.exp(-_DECAY * np.array(tree.lengths) / scene.cells.reach)
    for place in range(1, len(gains)):
        gains[place] += gains[tree.parents[place]]
    return np.asarray(gains)
