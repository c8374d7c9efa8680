"""How `planned-rate` explores plans: distance advantage, less what turning costs, wide openings first.

    v* = argmax over frontier cells v of mean over u of d(u, v) - w(v) d(robot, v) - b |turn(v)| / π - t(v)

Ours. The mean is that of distance advantage (Ericson, Pedro & Jensfelt 2025): what would be far to come back
to is taken now. turn(v) is the angle between the way that the robot has come and the way to v: who turns
round brakes, and drives what it has driven already. w is 1 for wide openings, those with many known free
voxels beside unknown ones around them, and more for slivers; where the mission may leave something unseen,
slivers are left until there is no opening any more. t(v) is how near v is to where teammates go.

Tuned: `sliver` and `turn`; see `AheadConfig`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from baselines.strategies.explorers.coordinated_frontier import taken
from baselines.strategies.explorers.explorer import Explorer, Scene
from baselines.strategies.explorers.nearest_frontier import best_of
from baselines.strategies.explorers.teammates import centres_of, team_of
from entropy_explore_env.scenario import Scenario
from entropy_explore_env.validation import check, check_not_negative, check_positive

_DETOUR = 8.0
"""Free cells count in means if the path to them is no longer than this many radii."""
_STOOD = 1e-3
"""A robot that is nearer to where it was, in voxel edges, has not moved."""


@dataclass(frozen=True)
class AheadConfig:
    """Around which place means are taken, and what counts how much.

    Attributes:
        radius: How far, along either axis, u may be off the robot, in sensor ranges; of the frontier cells
            whose path is longer only the best of those that are nearest counts.
        around: How far, along either axis, an opening reaches around a frontier cell, in sensor ranges.
        opening: Least number of known free voxels beside unknown ones there, in sensor ranges.
        sliver: w of frontier cells that are no opening, at least 1.
        turn: b, what it costs to turn round, in sensor ranges.
        ahead: Where on the path to a frontier cell its direction is taken, in sensor ranges.

    Raises:
        SettingError: One of them is not allowed.
    """

    radius: float = 0.75
    around: float = 0.125
    opening: float = 0.1
    sliver: float = 1.5
    turn: float = 0.375
    ahead: float = 0.1

    def __post_init__(self) -> None:
        """Check every field."""
        check_positive(self, "radius", "around", "opening", "ahead")
        check_not_negative(self, "turn")
        check(self, "sliver", "a number ≥ 1", lambda w: w >= 1.0)


class AdvantageAhead(Explorer):
    """Goes to what lies ahead, and would be far to come back to."""

    rule = "planned-rate"

    def __init__(self, config: AheadConfig | None = None) -> None:
        """Take the settings; None = the defaults."""
        self.config = config or AheadConfig()

    def reset(self, scenario: Scenario, rng: np.random.Generator) -> None:
        """A new mission begins."""
        super().reset(scenario, rng)
        ending = scenario.ending
        self._leaves_some = bool(ending.unseen_free_voxels) or (ending.seen_share or 1.0) < 1.0
        self._came: dict[int, tuple[np.ndarray, np.ndarray]] = {}

    def pick(self, scene: Scene) -> int:
        """See `Explorer`."""
        heading = self._heading(scene)
        horizon = self.config.radius * scene.cells.reach + 1.0
        voxels, lengths = self._counting(scene, *scene.paths.frontiers_within(horizon))
        if len(voxels) == 0:
            voxels, lengths = scene.paths.nearest_frontiers()
            if self._leaves_some:
                voxels, lengths = scene.paths.frontiers_within(math.inf)
                wide = self._is_wide(scene, voxels)
                kept = wide if wide.any() else np.ones(len(voxels), bool)
                voxels, lengths = voxels[kept], lengths[kept]
            return best_of(voxels, -self._costs(scene, voxels, lengths, heading), scene.target)
        costs = self._costs(scene, voxels, lengths, heading)
        if len(voxels) == 1:
            return int(voxels[0])
        return best_of(voxels, self._advantages(scene, voxels, lengths, costs), scene.target)

    def _is_wide(self, scene: Scene, voxels: np.ndarray) -> np.ndarray:
        """(K,) bool, whether (K,) frontier cells are wide openings."""
        radius = max(round(self.config.around * scene.cells.reach), 1)
        least = max(round(self.config.opening * scene.cells.reach), 1)
        return scene.cells.crowds(voxels, radius, least) >= least

    def _counting(
        self, scene: Scene, voxels: np.ndarray, lengths: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Those frontier cells, and lengths, that count as long as there is an opening."""
        if not self._leaves_some:
            return voxels, lengths
        wide = self._is_wide(scene, voxels)
        return voxels[wide], lengths[wide]

    def _costs(
        self, scene: Scene, voxels: np.ndarray, lengths: np.ndarray, heading: np.ndarray
    ) -> np.ndarray:
        """(K,) what it costs to go to (K,) frontier cells now, in voxel edges; at least the path's length."""
        reach, places = scene.cells.reach, centres_of(scene, voxels)
        costs = np.where(self._is_wide(scene, voxels), 1.0, self.config.sliver) * lengths
        for target in team_of(scene).targets:
            costs += reach * taken(places, target, reach)
        if len(voxels) > 0 and heading.any():
            ahead = max(round(self.config.ahead * reach), 1)
            routes = [scene.paths.route_to(int(voxel)) for voxel in voxels]
            first = np.array([route[min(ahead, len(route) - 1)] for route in routes], np.int32)
            here = scene.view.scenario.grid.in_grid_units(scene.view.pose)[:2]
            way = centres_of(scene, first)[:, :2] - here
            turn = np.arctan2(way[:, 1], way[:, 0]) - math.atan2(heading[1], heading[0])
            turn = np.abs((turn + math.pi) % (2.0 * math.pi) - math.pi)
            costs += self.config.turn * reach * turn / math.pi
        return costs

    def _heading(self, scene: Scene) -> np.ndarray:
        """(2,) the way that the robot has come since it was last elsewhere; zeros = it has not moved yet."""
        robot, here = scene.view.robot, scene.view.scenario.grid.in_grid_units(scene.view.pose)[:2]
        place, way = self._came.get(robot, (here, np.zeros(2)))
        if np.linalg.norm(here - place) > _STOOD:
            way = here - place
        self._came[robot] = here, way
        return way

    def _advantages(
        self, scene: Scene, voxels: np.ndarray, lengths: np.ndarray, costs: np.ndarray
    ) -> np.ndarray:
        """(K,) mean lengths less costs, as far as it takes to know the greatest; -inf where it cannot be.

        Bounds are those of `distance-advantage`: d(u, v) ≤ d(u, w) + d(w, v).
        """
        paths, radius = scene.paths, round(self.config.radius * scene.cells.reach)
        paths.extend(_DETOUR * radius)
        around = paths.around(scene.here, radius)
        farthest = float(paths.lengths_to(around).max(initial=0.0))
        worth, bounds = np.full(len(voxels), -np.inf), np.full(len(voxels), np.inf)
        place = int(np.argmin(costs))
        while bounds[place] > worth.max():
            least, most = abs(farthest - lengths[place]), farthest + lengths[place]
            mean = paths.mean_length(int(voxels[place]), around, least, most)
            worth[place] = mean - costs[place]
            bounds = np.minimum(bounds, mean + paths.lengths_to(voxels) - costs)
            bounds[np.isfinite(worth)] = -np.inf
            place = int(np.argmax(bounds))
        return worth
