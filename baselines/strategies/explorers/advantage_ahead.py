"""How `planned-rate` explores plans until their entropy is low: openings, by advantage, sight and turning.

    v* = argmax over openings v of
         mean over u of d(u, v) - d(robot, v) + g ln V(v) - b |turn(v)| / π - t(v)

Ours. The mean is that of distance advantage (Ericson, Pedro & Jensfelt 2025): what would be far to come back
to is taken now. An opening is a frontier cell around which many known free voxels lie beside unknown ones;
one stands for all that are around it. V is how many unknown voxels are in sight of it, at most as many as
would lie behind an opening of this width in a strip of a given depth: through a wall's single unseen voxel a
wide cone is in sight. turn(v) is the angle between the way that the robot has
come and the way to v: who turns round brakes, and drives what it has driven already. t(v) is how near v is
to where teammates go.

Only openings whose path is no longer than a horizon count; where there is none, those a little farther off
do, without means. All other frontier cells, slivers between rays and single voxels of walls, wait until
there is no opening any more, since most are seen in passing. Then they are visited on short open tours, as
in `tour`, each by the robot that is nearer to it than teammates' targets are. A sliver that the robot is
about to leave behind is visited before if that is a short way round, measured by how far it is from the
sliver to the nearest frontier cell elsewhere: what lies alone would be far to come back to.

Tuned: see docs/explorers.md.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from baselines.strategies.explorers.coordinated_frontier import taken
from baselines.strategies.explorers.explorer import Explorer, Scene
from baselines.strategies.explorers.nearest_frontier import best_of
from baselines.strategies.explorers.teammates import centres_of, left_to_robot, team_of
from baselines.strategies.explorers.tour import Tour, TourConfig
from entropy_explore_env.scenario import Scenario
from entropy_explore_env.validation import check_count, check_not_negative, check_positive

_ALONE = 90.0
"""Longest distance from a sliver to other frontier cells that counts, in voxel edges; more takes too long."""
_DETOUR = 4.0
"""Free cells count in means if the path to them is no longer than this many radii."""
_STOOD = 1e-3
"""A robot that is nearer to where it was, in voxel edges, has not moved."""
_EXTENSION = 1.5
"""Where too little is found, the search goes this many times as far."""
_TOUR = TourConfig(near=1.5, cover=0.5, most_near=40, most_far=20)
"""Of slivers."""
_TRIED, _FIRST = 3, 1e6
"""Slivers that are looked at, the nearest ones; a length that puts the one that it is under way to first."""
_STAY = 1.5
"""A way round that was begun may be this many times as long."""


@dataclass(frozen=True)
class AheadConfig:
    """Around which place means are taken, what an opening is, and what counts how much.

    Attributes:
        radius: Voxels, along either axis, that u may be off the robot; openings whose path is longer wait.
        around: How far, along either axis, an opening reaches around a frontier cell, in sensor ranges; as
            wide are the cells of a grid of which one opening each counts.
        opening: Least number of known free voxels beside unknown ones there, in sensor ranges.
        depth: V is at most as many voxels as the opening has, times this many sensor ranges.
        gain: g, in sensor ranges.
        turn: b, what it costs to turn round, in sensor ranges.
        passing: How long the way round by a sliver may be that would be left behind, over the distance from
            it to the nearest frontier cell elsewhere; 0 = none is visited in passing.
        elsewhere: Farther off than this, along either axis, in sensor ranges.
        ahead: Where on the path to a frontier cell its direction is taken, in sensor ranges.

    Raises:
        SettingError: One of them is not allowed.
    """

    radius: int = 60
    around: float = 0.125
    opening: float = 0.125
    depth: float = 0.25
    gain: float = 0.25
    turn: float = 0.375
    passing: float = 1.0
    elsewhere: float = 0.125
    ahead: float = 0.1

    def __post_init__(self) -> None:
        """Check every field."""
        check_count(self, "radius", 1, 1_000_000)
        check_positive(self, "around", "depth", "elsewhere", "ahead")
        check_not_negative(self, "opening", "gain", "turn", "passing")


class _Openings(NamedTuple):
    """Openings that can be gone to; K of them."""

    voxels: np.ndarray
    """(K,) int32"""
    lengths: np.ndarray
    """(K,) of the paths to them, voxel edges."""
    seen: np.ndarray
    """(K,) V, at least 1."""


class AdvantageAhead(Explorer):
    """Goes to what lies ahead, shows much, and would be far to come back to."""

    rule = "planned-rate"

    def __init__(self, config: AheadConfig | None = None) -> None:
        """Take the settings; None = the defaults."""
        self.config = config or AheadConfig()

    def reset(self, scenario: Scenario, rng: np.random.Generator) -> None:
        """A new mission begins."""
        super().reset(scenario, rng)
        self._came: dict[int, tuple[np.ndarray, np.ndarray]] = {}
        self._slivers = Tour(_TOUR)

    def pick(self, scene: Scene) -> int:
        """See `Explorer`."""
        heading = self._heading(scene)
        horizon = self.config.radius + 1.0
        openings = self._openings(scene, *scene.paths.frontiers_within(horizon))
        if len(openings.voxels) > 1:
            worth = self._advantages(scene, openings, self._costs(scene, openings, heading))
            return self._by_way_of(scene, best_of(openings.voxels, worth, scene.target))
        if len(openings.voxels) == 0:
            openings = self._farther(scene, horizon)
        if len(openings.voxels) == 0:
            return self._tour(scene)
        costs = self._costs(scene, openings, heading)
        return self._by_way_of(scene, best_of(openings.voxels, -costs, scene.target))

    def _tour(self, scene: Scene) -> int:
        """The sliver to visit next where there is no opening."""
        reach, most = scene.paths.reach, _TOUR.most_near + _TOUR.most_far
        while True:
            voxels, lengths = scene.paths.frontiers_within(reach)
            if len(voxels) >= most or scene.paths.exhausted():
                own = left_to_robot(scene, voxels, lengths)
                return self._slivers.pick_among(scene, voxels[own], lengths[own])
            reach *= _EXTENSION

    def _by_way_of(self, scene: Scene, goal: int) -> int:
        """The goal, or a sliver that the way to it leaves behind, and that would be far to come back to."""
        paths, reach, config = scene.paths, scene.cells.reach, self.config
        paths.start(scene.here)
        farthest = config.passing * self._alone(scene)
        voxels, lengths = paths.frontiers_within(farthest)
        if config.passing == 0.0 or len(voxels) == 0:
            return goal
        while math.isinf(paths.lengths_to(np.array([goal], np.int32))[0]) and not paths.exhausted():
            paths.extend(_EXTENSION * paths.reach)
        route = paths.route_to(goal)
        if len(route) == 0:
            return goal
        ahead = int(route[min(max(round(config.around * reach), 1), len(route) - 1)])
        onward = float(paths.lengths_to(np.array([ahead], np.int32))[0])
        paths.start(ahead)
        paths.extend(2.0 * farthest)
        back = paths.lengths_to(voxels)
        round_about = lengths + back - onward
        begun = voxels == scene.target
        left = (back >= lengths + 0.5 * onward) & (round_about <= farthest)
        left |= begun & (round_about <= _STAY * farthest)
        order = np.argsort((lengths - _FIRST * begun)[left], kind="stable")[:_TRIED]
        for place in np.flatnonzero(left)[order]:
            far = config.passing * self._apart(scene, int(voxels[place]))
            if round_about[place] <= (_STAY * far if begun[place] else far):
                return int(voxels[place])
        return goal

    def _apart(self, scene: Scene, voxel: int) -> float:
        """How far it is from a frontier cell to the nearest one elsewhere, in voxel edges."""
        alone, elsewhere = self._alone(scene), self.config.elsewhere * scene.cells.reach
        scene.paths.start(voxel)
        voxels, lengths = scene.paths.frontiers_within(alone)
        off = np.abs(centres_of(scene, voxels) - centres_of(scene, np.array([voxel], np.int32)))
        return float(lengths[off.max(axis=1) > elsewhere].min(initial=alone))

    def _alone(self, scene: Scene) -> float:
        """Longest distance from a sliver to other frontier cells that counts, in voxel edges."""
        return min(scene.cells.reach, _ALONE)

    def _farther(self, scene: Scene, reach: float) -> _Openings:
        """The openings that the search finds first beyond a reach; none where there is none at all."""
        found = _Openings(np.empty(0, np.int32), np.empty(0), np.empty(0))
        if len(self._openings(scene, *scene.cells.of_blocks()).voxels) == 0:
            return found
        while len(found.voxels) == 0 and not scene.paths.exhausted():
            before, reach = reach, _EXTENSION * reach
            voxels, lengths = scene.paths.frontiers_within(reach)
            found = self._openings(scene, voxels[lengths > before], lengths[lengths > before])
        return found

    def _openings(self, scene: Scene, voxels: np.ndarray, lengths: np.ndarray) -> _Openings:
        """The openings among (K,) frontier cells with (K,) lengths."""
        config, cells = self.config, scene.cells
        radius, least = max(round(config.around * cells.reach), 1), round(config.opening * cells.reach)
        widest = (2 * radius + 1) ** 2
        counts = cells.crowds(voxels, radius, widest)
        wide = counts >= least
        wide[wide] = _first_of_cells(centres_of(scene, voxels[wide]), lengths[wide], radius)
        wide |= (voxels == scene.target) & (counts >= least)
        voxels, lengths, counts = voxels[wide], lengths[wide], counts[wide]
        seen = np.minimum(cells.gains(voxels), config.depth * cells.reach * counts)
        return _Openings(voxels, lengths, np.maximum(seen, 1.0))

    def _costs(self, scene: Scene, openings: _Openings, heading: np.ndarray) -> np.ndarray:
        """(K,) what it costs to go to openings now, less what they show; in voxel edges."""
        reach, places = scene.cells.reach, centres_of(scene, openings.voxels)
        costs = openings.lengths - self.config.gain * reach * np.log(openings.seen)
        for target in team_of(scene).targets:
            costs += reach * taken(places, target, reach)
        if len(openings.voxels) > 0 and heading.any() and self.config.turn > 0.0:
            ahead = max(round(self.config.ahead * reach), 1)
            routes = [scene.paths.route_to(int(voxel)) for voxel in openings.voxels]
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

    def _advantages(self, scene: Scene, openings: _Openings, costs: np.ndarray) -> np.ndarray:
        """(K,) mean lengths less costs, as far as it takes to know the greatest; -inf where it cannot be.

        Bounds are those of `distance-advantage`: d(u, v) ≤ d(u, w) + d(w, v).
        """
        paths, radius = scene.paths, self.config.radius
        voxels, lengths = openings.voxels, openings.lengths
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


def _first_of_cells(places: np.ndarray, lengths: np.ndarray, edge: int) -> np.ndarray:
    """(K,) bool, of (K, 3) places those with the shortest of (K,) paths in their cells of a coarse grid."""
    order = np.argsort(lengths, kind="stable")
    _, first = np.unique(np.floor(places[order] / edge).astype(np.int64), axis=0, return_index=True)
    chosen = np.zeros(len(places), bool)
    chosen[order[first]] = True
    return chosen
