"""The strategy `distance-advantage` (Ericson, Pedro & Jensfelt 2025): near to the robot, far from all else.

    v* = argmax over frontier cells v of Adv(v),   Adv(v) = mean over u of d(u, v) - d(robot, v)

u are the free cells around the robot: those that it can reach, up to a radius off along either axis. d is
the length of the path through known free space. What would be far to come back to is taken now. Only
frontier cells whose path is no longer than a horizon count; where there is none, the nearest one does.

What there is to gain is no part of the worth; it says which frontier cells are worth going to at all, as in
the paper. A cell counts if it belongs to a wide opening, that is, to many connected frontier cells, or if
it is so near that it costs little in passing. Where no cell counts, all do: slivers come last. (Unknown
voxels in sight, were all that is unknown free, are no measure: through a wall's single unseen voxel a wide
cone is in sight.)

The mean needs a search from each frontier cell. Most are spared: since d(u, v) ≤ d(u, w) + d(w, v), a cell
w whose mean is known bounds the advantage of every other one from above, and cells whose bounds are below
the best advantage so far are never searched from. The choice is the same.

Tuned: `radius`, `horizon`, `opening` and `passing`; see `DistanceAdvantageConfig`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from baselines.strategies.rules.nearest_frontier import best_of
from entropy_explore_env.frontiers.blocks import NONE
from entropy_explore_env.frontiers.path_lengths import KnownPaths
from entropy_explore_env.planner.driver import Explorer, Scene
from entropy_explore_env.validation import check, check_count, check_positive


@dataclass(frozen=True)
class DistanceAdvantageConfig:
    """Around which place means are taken, and which frontier cells count.

    Attributes:
        radius: Voxels, along either axis, that u may be off the robot.
        horizon: Longest path, in voxel edges, to a frontier cell that counts though it is not the nearest.
        opening: Least number of connected known free voxels beside unknown ones, in sensor ranges; 0 = any
            frontier cell counts.
        passing: A frontier cell whose path is no longer than this, in sensor ranges, counts anyway.
        meanwhile: So does one whose path is at most this share of the path to the nearest wide opening.
        detour: u that are farther from the robot than this many radii, by path, do not count; inf = all do.

    Raises:
        SettingError: One of them is not allowed.
    """

    radius: int = 60
    horizon: float = 61.0
    opening: float = 0.1
    passing: float = 0.06
    meanwhile: float = 0.5
    detour: float = 8.0

    def __post_init__(self) -> None:
        """Check every field."""
        check_count(self, "radius", 1, 1_000_000)
        check_positive(self, "horizon", "detour", finite=False)
        for name in ("opening", "passing", "meanwhile"):
            check(self, name, "a number from 0 to 1", lambda v: 0.0 <= v <= 1.0)


Counts = Callable[[int, float], bool]
"""Whether a frontier cell, with a path of this length to it, counts."""


class DistanceAdvantage(Explorer):
    """Goes to the frontier cell with the greatest distance advantage."""

    rule = "distance-advantage"

    def __init__(self, config: DistanceAdvantageConfig | None = None) -> None:
        """Take the settings; None = the defaults."""
        self.config = config or DistanceAdvantageConfig()

    def pick(self, scene: Scene) -> int:
        """See `Explorer`."""
        config, cells, paths = self.config, scene.cells, scene.paths
        least = round(config.opening * cells.reach)
        if least <= 1:
            return self._pick_of(scene, lambda *_: True)
        voxel, length = nearest_that_counts(paths, lambda voxel, _: cells.opening(voxel, least) >= least)
        if voxel == NONE:
            return self._pick_of(scene, lambda *_: True)
        near = max(config.passing * cells.reach, config.meanwhile * length)
        return self._pick_of(
            scene, lambda voxel, length: length <= near or cells.opening(voxel, least) >= least
        )

    def _pick_of(self, scene: Scene, counts: Counts) -> int:
        """The frontier cell of those that count; NONE = none does."""
        config, paths = self.config, scene.paths
        voxels, lengths = paths.frontiers_within(config.horizon)
        if len(voxels):
            paths.extend(config.detour * config.radius)
            around = paths.around(scene.here, config.radius)
            worth = advantages(paths, voxels, lengths, around, counts)
            if worth.max() > -np.inf:
                return best_of(voxels, worth, scene.target)
            paths.start(scene.here)
        return nearest_that_counts(paths, counts)[0]


def nearest_that_counts(paths: KnownPaths, counts: Counts) -> tuple[int, float]:
    """The nearest frontier cell that counts, by the robot's search, and its length; NONE = none does."""
    tried = set[int]()
    while True:
        voxels, lengths = paths.frontiers_within(paths.reach)
        for place in np.argsort(lengths, kind="stable"):
            voxel = int(voxels[place])
            if voxel not in tried and counts(voxel, float(lengths[place])):
                return voxel, float(lengths[place])
            tried.add(voxel)
        if paths.exhausted():
            return NONE, math.inf
        paths.extend(1.5 * paths.reach)


def advantages(
    paths: KnownPaths,
    voxels: np.ndarray,
    lengths: np.ndarray,
    around: np.ndarray,
    counts: Counts,
) -> np.ndarray:
    """Distance advantages of frontier cells, as far as it takes to know the greatest.

    Args:
        paths: Of the robot, whose search is another one afterwards.
        voxels: (K,) int32, the frontier cells.
        lengths: (K,) of the paths from the robot to them.
        around: (N,) int32, the free cells around the robot, which its search has reached.
        counts: Whether a frontier cell counts.

    Returns:
        (K,) in voxel edges; -inf for cells that do not count, or cannot have the greatest.
    """
    farthest = float(paths.lengths_to(around).max(initial=0.0))
    worth, bounds = np.full(len(voxels), -np.inf), np.full(len(voxels), np.inf)
    place = int(np.argmin(lengths))
    while bounds[place] > worth.max():
        if counts(int(voxels[place]), float(lengths[place])):
            least, most = abs(farthest - lengths[place]), farthest + lengths[place]
            mean = paths.mean_length(int(voxels[place]), around, least, most)
            worth[place] = mean - lengths[place]
            bounds = np.minimum(bounds, mean + paths.lengths_to(voxels) - lengths)
        bounds[place] = -np.inf
        bounds[np.isfinite(worth)] = -np.inf
        place = int(np.argmax(bounds))
    return worth
