"""The strategy `receding-horizon`: the next best view by a random tree of places (Bircher et al. 2016).

A rapidly exploring random tree (LaValle 1998) grows from the robot through known free space. A place n_k at
the end of a branch n_1 … n_k is worth

    gain(n_k) = gain(n_(k-1)) + unknown(n_k) exp(-λ c(n_k))

with unknown(n) the number of unknown voxels that the sensor would see from n, and c(n) the length of the
branch up to n. The robot drives along the first edge of the branch of greatest gain, then grows a new tree,
from what is left of that branch. The tree has a number of places; it grows on, up to a larger number, until
one has a gain.

Ours: a place from which the robot has scanned has no gain, so that slivers which rays miss do not hold it;
where no place has a gain, it goes to the nearest frontier cell (the paper's planner ends there, and is
known to end too early: Selin et al. 2019 go to remembered frontiers, too). Unknown voxels are counted all
around; a sensor that looks one way is turned to where most are.

Tuned: λ, see `RecedingHorizonConfig`.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from baselines.strategies.rules.nearest_frontier import best_of
from entropy_explore_env.planner.driver import Explorer, Scene
from entropy_explore_env.scenario import Scenario
from entropy_explore_env.validation import check_count, check_positive


@dataclass(frozen=True)
class RecedingHorizonConfig:
    """The tree, and what distance costs.

    Attributes:
        decay: λ, a sensor range.
        edge: Longest edge of the tree, in sensor ranges.
        around: Half the width of the box around the robot in which places are drawn, in sensor ranges.
        places: Of a tree.
        most_places: Of a tree in which none has a gain yet.
        least_gain: Unknown voxels, weighed, below which a branch counts for nothing.

    Raises:
        SettingError: One of them is not allowed.
    """

    decay: float = 8.0
    edge: float = 0.4
    around: float = 1.5
    places: int = 30
    most_places: int = 120
    least_gain: float = 2.0

    def __post_init__(self) -> None:
        """Check every field."""
        check_positive(self, "decay", "edge", "around", "least_gain")
        check_count(self, "places", 1, 10_000)
        check_count(self, "most_places", self.places, 10_000)


@dataclass
class _Tree:
    """Places of a tree, the robot's first."""

    places: list[np.ndarray] = field(default_factory=list)
    """(3,) voxel centres, in voxel edges."""
    parents: list[int] = field(default_factory=list)
    lengths: list[float] = field(default_factory=list)
    """Of the branch up to each place."""

    def add(self, place: np.ndarray, parent: int) -> None:
        """Grow by one place."""
        behind = self.places[parent] if self.places else place
        before = self.lengths[parent] if self.places else 0.0
        self.lengths.append(before + float(np.linalg.norm(place - behind)))
        self.parents.append(parent)
        self.places.append(place)


class RecedingHorizon(Explorer):
    """Drives along the first edge of the best branch of a random tree."""

    rule = "receding-horizon"
    until_reached = True

    def __init__(self, config: RecedingHorizonConfig | None = None) -> None:
        """Take the settings; None = the defaults."""
        self.config = config or RecedingHorizonConfig()

    def reset(self, scenario: Scenario, rng: np.random.Generator) -> None:
        """A new mission begins."""
        super().reset(scenario, rng)
        self._scanned: dict[int, set[int]] = {}
        self._branches: dict[int, list[np.ndarray]] = {}

    def pick(self, scene: Scene) -> int:
        """See `Explorer`."""
        robot, config = scene.view.robot, self.config
        scanned = self._scanned.setdefault(robot, set())
        scanned.add(scene.here)
        tree, worth = self._seeded(scene, self._branches.get(robot, [])), np.zeros(1)
        free = self._free_around(scene)
        for size in (config.places, config.most_places):
            self._grow(scene, tree, free, size)
            worth = self._gains(scene, tree, scanned)
            if worth.max() >= config.least_gain:
                return self._first_edge(scene, tree, int(np.argmax(worth)))
        self._branches[robot] = []
        voxels, lengths = scene.paths.nearest_frontiers()
        return best_of(voxels, -lengths, scene.target)

    def _seeded(self, scene: Scene, branch: list[np.ndarray]) -> _Tree:
        """A tree of where the robot stands, and of what is left of the last best branch."""
        tree = _Tree()
        tree.add(self._place(scene, scene.here), 0)
        for place in branch:
            if not scene.paths.is_line_free(tree.places[-1], place):
                break
            tree.add(place, len(tree.places) - 1)
        return tree

    def _grow(self, scene: Scene, tree: _Tree, free: np.ndarray, size: int) -> None:
        """Add random places until there are `size`, or so many were drawn that there is no room."""
        longest = self.config.edge * scene.cells.reach
        for _ in range(4 * size):
            if len(tree.places) >= size or len(free) == 0:
                return
            drawn = self._place(scene, int(free[self._rng.integers(len(free))]))
            apart = np.linalg.norm(np.array(tree.places) - drawn, axis=1)
            nearest = int(np.argmin(apart))
            start = tree.places[nearest]
            place = start + (drawn - start) * min(1.0, longest / max(float(apart[nearest]), 1e-9))
            place = np.floor(place) + 0.5
            if (place != start).any() and scene.paths.is_line_free(start, place):
                tree.add(place, nearest)

    def _gains(self, scene: Scene, tree: _Tree, scanned: set[int]) -> np.ndarray:
        """(K,) gains of the branches that end in each place."""
        voxels = np.array([self._voxel(scene, place) for place in tree.places], np.int32)
        unknown = scene.cells.gains(voxels)
        unknown[[int(voxel) in scanned for voxel in voxels]] = 0.0
        weights = np.exp(-self.config.decay * np.array(tree.lengths) / scene.cells.reach)
        gains = unknown * weights
        for place in range(1, len(gains)):
            gains[place] += gains[tree.parents[place]]
        return np.asarray(gains)

    def _first_edge(self, scene: Scene, tree: _Tree, last: int) -> int:
        """The first place of the branch that ends in a place; the others are kept for the next tree."""
        branch = [last]
        while tree.parents[branch[-1]] != 0:
            branch.append(tree.parents[branch[-1]])
        places = [tree.places[place] for place in reversed(branch)]
        self._branches[scene.view.robot] = places[1:]
        return self._voxel(scene, places[0])

    def _free_around(self, scene: Scene) -> np.ndarray:
        """(N,) int64 voxels in the box around the robot in which its body is known to fit."""
        shape = scene.view.scenario.grid.shape
        half = max(int(self.config.around * scene.cells.reach), 1)
        low = [max(int(at) - half, 0) for at in np.unravel_index(scene.here, shape)]
        box = tuple(slice(a, a + 2 * half + 1) for a in low)
        free = np.argwhere(np.isfinite(scene.cells.traversal_cost.reshape(shape)[box]))
        return np.asarray(np.ravel_multi_index(tuple((free + low).T), shape))

    def _place(self, scene: Scene, voxel: int) -> np.ndarray:
        """(3,) centre of a voxel, in voxel edges."""
        return np.stack(np.unravel_index(voxel, scene.view.scenario.grid.shape)).astype(float) + 0.5

    def _voxel(self, scene: Scene, place: np.ndarray) -> int:
        """The voxel of a place."""
        return int(np.ravel_multi_index(tuple(place.astype(int)), scene.view.scenario.grid.shape))
