"""The strategy `information-rate`: the viewpoint whose scan is expected to bring most bits per second.

Ours, not a paper's: viewpoints are drawn within reach, half of them turns on the spot, and each is weighed by
the bits that its scan should take from the robot's own map (belief/visibility.py) per second of driving,
turning and scanning. Where nothing nearby is worth much, the robot travels to an uncertain place farther
away, along the shortest way by its belief, scanning at each stop. What teammates have announced that they
will see is left to them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from baselines.strategies.information_rate.expected_bits import (
    Build,
    announced_cone,
    build_of,
    free_by_belief,
    new_scratch,
    weigh_viewpoints,
)
from entropy_explore_env.belief.paths.lattice import belief_costs
from entropy_explore_env.belief.paths.planning import ANY_GOAL, search_paths
from entropy_explore_env.belief.paths.search import cost_to, extract_path, new_search
from entropy_explore_env.belief.paths.string_pulling import string_pulled
from entropy_explore_env.belief.raycast import STOP_AT_COVERED
from entropy_explore_env.belief.visibility import CONE
from entropy_explore_env.missions.view import RobotView
from entropy_explore_env.robots.motion import driving_time
from entropy_explore_env.scenario import Scenario

_KEPT = 3
"""Viewpoints around which others are drawn."""
_PATIENCE = 4
"""Decisions that a robot stays where it is after it has found nothing better elsewhere."""
_LOTS, _GAZES = 32, 4
"""Random voxels for each uncertain place that is weighed, and gazes there."""


@dataclass(frozen=True)
class Weighing:
    """How viewpoints are drawn and weighed.

    Attributes:
        per_scan: Bits per scan instead of bits per second.
        candidates: Viewpoints that are drawn for a decision; half of them turn on the spot.
        thinning: Of the columns and rows of the sensor's rays every so many-th is imagined.
        refinements: How often viewpoints around the best ones are drawn, a quarter as many each time.
        blocking: Probability that an unknown voxel stops a ray.
        poor: A best viewpoint with less than this share of the best ever expected makes the robot look
            farther away.
        places: Uncertain places farther away that are weighed then.
        unknown_cost: What a metre of way through unknown space costs, in metres of known space.
    """

    per_scan: bool = False
    candidates: int = 80
    refinements: int = 3
    thinning: int = 2
    blocking: float = 0.02
    poor: float = 0.1
    places: int = 12
    unknown_cost: float = 2.0


@dataclass
class _Journey:
    """What a robot remembers from one decision to the next."""

    best_bits: float = 0.0
    patience: int = 0
    """Decisions until it looks farther away again."""
    stops: list[np.ndarray] = field(default_factory=list)
    """Places (3,) in grid units that are still ahead."""


class InformationRate:
    """Chooses viewpoints by expected bits per second, or per scan."""

    def __init__(self, weighing: Weighing | None = None) -> None:
        """Take the settings."""
        self.weighing = weighing or Weighing()

    def reset(self, scenario: Scenario, rng: np.random.Generator) -> None:
        """A new mission begins."""
        grid = scenario.grid
        self._rng, self._journeys = rng, [_Journey() for _ in range(scenario.robots)]
        self._builds = [
            build_of(scenario, kind, self.weighing.thinning, self.weighing.blocking)
            for kind in scenario.kinds
        ]
        self._scratch = new_scratch(grid, self._builds)
        self._search = new_search(grid.voxels)

    def _build_of(self, view: RobotView) -> Build:
        return self._builds[view.robot % len(self._builds)]

    def choose(self, views: Sequence[RobotView]) -> list[np.ndarray]:
        """The viewpoint of each view, by its own belief and what it has heard."""
        return [self._choose(view) for view in views]

    def _choose(self, view: RobotView) -> np.ndarray:
        journey = self._journeys[view.robot]
        here = view.scenario.grid.in_grid_units(view.pose)
        cones = self._cones(view)
        if journey.stops and not _in_sight(view, here[:3], journey.stops[0], self._scratch):
            journey.stops = []
        drawn = self._drawn(view, here, journey.stops[0] if journey.stops else None)
        bits, seconds = self._weighed(view, here, drawn, cones)
        for _ in range(self.weighing.refinements):
            best = np.argsort(self._worth(journey, bits, seconds))[-_KEPT:]
            near = self._nearby(view, here, drawn[best], moving=not journey.stops)
            near_bits, near_seconds = self._weighed(view, here, near, cones)
            drawn = np.concatenate([drawn[best], near])
            bits = np.concatenate([bits[best], near_bits])
            seconds = np.concatenate([seconds[best], near_seconds])
        best = int(np.argmax(self._worth(journey, bits, seconds)))
        if journey.stops:
            journey.stops.pop(0)
        else:
            journey.best_bits = max(journey.best_bits, float(bits[best]))
            journey.patience -= 1
            if bits[best] < self.weighing.poor * journey.best_bits and journey.patience <= 0:
                rate = float(self._worth(journey, bits, seconds)[best])
                journey.stops = self._way_to_somewhere_better(view, here, cones, rate)
                if journey.stops and _in_sight(view, here[:3], journey.stops[0], self._scratch):
                    return self._choose(view)
                journey.stops, journey.patience = [], _PATIENCE
        viewpoint, grid = drawn[best], view.scenario.grid
        viewpoint[:3] = np.asarray(grid.origin_m) + viewpoint[:3] * grid.voxel_size_m
        return viewpoint

    def _worth(self, journey: _Journey, bits: np.ndarray, seconds: np.ndarray) -> np.ndarray:
        """(K,) what viewpoints are worth: bits per second, or bits where all take as long or time is free."""
        return bits if self.weighing.per_scan or journey.stops else bits / seconds

    def _cones(self, view: RobotView) -> np.ndarray:
        """(M,) CONE of what teammates have announced, in grid units."""
        heard = [mate for mate in view.teammates.values() if mate.announced_s >= 0.0 and mate.depth_m > 0.0]
        cones = np.zeros(len(heard), CONE)
        for place, mate in enumerate(heard):
            cones[place] = announced_cone(view.scenario.grid, mate)
        return cones

    def _drawn(self, view: RobotView, here: np.ndarray, stop: np.ndarray | None) -> np.ndarray:
        """(K, 5) viewpoints in grid units: half on the spot, half within reach; or all at a stop."""
        count, planar, rng = self.weighing.candidates, view.planar, self._rng
        drawn = np.tile(here, (count, 1))
        drawn[:, 3] = rng.uniform(-math.pi, math.pi, count)
        drawn[:, 4] = 0.0 if planar else np.arcsin(rng.uniform(-1.0, 1.0, count))
        if stop is not None:
            drawn[:, :3] = stop
            return drawn
        (axes, reach, inside), moved = _nearby_space(view), count // 2
        way = rng.normal(size=(moved, axes))
        way *= (reach * rng.uniform(size=moved) ** (1 / axes) / np.linalg.norm(way, axis=1))[:, None]
        drawn[:moved, :axes] = np.clip(here[:axes] + way, 0.5, inside)
        return drawn

    def _nearby(self, view: RobotView, here: np.ndarray, best: np.ndarray, moving: bool) -> np.ndarray:
        """(N, 5) viewpoints around the best ones, in grid units; their gazes stray by half the view."""
        planar, rng, build = view.planar, self._rng, self._build_of(view)
        near = best.repeat(max(self.weighing.candidates // (4 * len(best)), 1), axis=0)
        spread = 0.5 * max(float(np.ptp(build.yaws)), float(np.ptp(build.pitches)), 0.1)
        near[:, 3] += spread * rng.normal(size=len(near))
        near[:, 3] = (near[:, 3] + math.pi) % (2.0 * math.pi) - math.pi
        if not planar:
            tilted = near[:, 4] + spread * rng.normal(size=len(near))
            near[:, 4] = np.clip(tilted, -0.5 * math.pi, 0.5 * math.pi)
        if moving:
            axes, reach, inside = _nearby_space(view)
            way = near[:, :axes] - here[:axes]
            away = np.linalg.norm(way, axis=1) > 0.0  # turns on the spot stay turns on the spot
            way[away] += 0.25 * reach * rng.normal(size=(int(away.sum()), axes))
            length = np.maximum(np.linalg.norm(way, axis=1) / reach, 1.0)
            near[:, :axes] = np.clip(here[:axes] + way / length[:, None], 0.5, inside)
        return near

    def _weighed(
        self,
        view: RobotView,
        here: np.ndarray,
        drawn: np.ndarray,
        cones: np.ndarray,
        anywhere: bool = False,
    ) -> tuple[np.ndarray, np.ndarray]:
        """(K,) expected bits and seconds of each viewpoint; 0 bits where the straight way is not free.

        With `anywhere` the way does not matter.
        """
        scenario, robot, build = view.scenario, view.kind.robot, self._build_of(view)
        limits = (
            robot.max_speed_m_s,
            robot.acceleration_m_s2,
            robot.turn_rate_rad_s,
            view.kind.sensor.scan_time_s,
            robot.body_radius_m / scenario.grid.voxel_size_m,
        )
        bits, seconds = np.zeros(len(drawn)), np.zeros(len(drawn))
        weigh_viewpoints(
            view.mean.reshape(-1),
            view.precision.reshape(-1),
            scenario.grid.shape,
            scenario.grid.voxel_size_m,
            here,
            drawn,
            build.yaws,
            build.pitches,
            build.sight,
            cones,
            limits,
            anywhere,
            self._scratch,
            bits,
            seconds,
        )
        return bits, seconds

    def _way_to_somewhere_better(
        self, view: RobotView, here: np.ndarray, cones: np.ndarray, rate: float
    ) -> list[np.ndarray]:
        """Stops on the way to the uncertain place that is worth most, if it is worth more than staying.

        Ways are sought only if there is a place that would be worth it on the straight line.
        """
        grid, robot, lattice = view.scenario.grid, view.kind.robot, self._build_of(view).lattice
        reach = min(robot.reach_m / grid.voxel_size_m, float(sum(grid.shape)))
        limits = robot.max_speed_m_s, robot.acceleration_m_s2
        hop_s = driving_time(reach * grid.voxel_size_m, *limits) + view.kind.sensor.scan_time_s
        each = 1.0 if self.weighing.per_scan else hop_s
        closed = view.no_fly_mask()
        drawn = self._drawn_voxels(view, here, closed)
        places = self._places(view, here, drawn)
        bits, _ = self._weighed(view, places[0], places, cones, anywhere=True)
        straight = np.linalg.norm(places[:, :3] - here[:3], axis=1)
        if (bits / (np.maximum(straight / reach, 1.0) * each)).max() <= rate:
            return []
        prior = view.scenario.sigma_prior**-2
        costs = belief_costs(view.mean, view.precision, prior, self.weighing.unknown_cost, closed)
        start = np.ravel_multi_index(tuple(here[:3].astype(int)), grid.shape)
        search_paths(self._search, lattice, costs, np.array([start], np.int32), ANY_GOAL, math.inf)
        cost = np.array([cost_to(self._search, int(voxel)) for voxel in drawn])
        reached = np.isfinite(cost) & (cost > 0.0)
        if not reached.any():
            return []
        places = self._places(view, here, drawn[reached])
        bits, _ = self._weighed(view, places[0], places, cones, anywhere=True)
        goals = np.asarray(np.ravel_multi_index(tuple(places[:, :3].astype(int).T), grid.shape))
        cost = np.array([cost_to(self._search, int(goal)) for goal in goals])
        worth = bits / (np.maximum(cost / reach, 1.0) * each)
        best = int(np.argmax(worth))
        if worth[best] <= rate:
            return []
        goal, none = int(goals[best]), np.empty(0, np.int32)
        path = np.empty(extract_path(self._search, lattice, goal, none), np.int32)
        extract_path(self._search, lattice, goal, path)
        points = string_pulled(self._search, lattice, costs, path, here[:3].copy(), places[best, :3].copy())
        return _stops(here[:3], points, reach)

    def _drawn_voxels(self, view: RobotView, here: np.ndarray, closed: np.ndarray | None) -> np.ndarray:
        """(N,) random voxels that are neither closed nor believed covered; of a planar robot's layer."""
        grid = view.scenario.grid
        drawn = self._rng.integers(0, grid.voxels, _LOTS * self.weighing.places)
        if view.planar:
            drawn += int(here[2]) - drawn % grid.shape[2]
        free = view.mean.reshape(-1)[drawn] <= STOP_AT_COVERED
        if closed is not None:
            free &= ~closed.reshape(-1)[drawn]
        return drawn[free] if free.any() else drawn

    def _places(self, view: RobotView, here: np.ndarray, voxels: np.ndarray) -> np.ndarray:
        """(K, 5) viewpoints in grid units at the least known of some voxels, a few gazes each."""
        least = np.argsort(view.precision.reshape(-1)[voxels], kind="stable")[: self.weighing.places]
        places = np.stack(np.unravel_index(voxels[least], view.scenario.grid.shape), axis=-1) + 0.5
        viewpoints = np.repeat(np.concatenate([places, np.zeros((len(places), 2))], axis=1), _GAZES, axis=0)
        viewpoints[:, 3] = self._rng.uniform(-math.pi, math.pi, len(viewpoints))
        if view.planar:
            viewpoints[:, 2] = here[2]
        return viewpoints


def _nearby_space(view: RobotView) -> tuple[int, float, np.ndarray]:
    """Axes along which viewpoints are drawn, how far off, and the last place along each, in grid units."""
    grid, axes = view.scenario.grid, 2 if view.planar else 3
    reach = min(view.kind.robot.reach_m / grid.voxel_size_m, 0.25 * float(max(grid.shape)))
    return axes, reach, np.asarray(grid.shape[:axes]) - 0.5


def _stops(start: np.ndarray, points: np.ndarray, reach: float) -> list[np.ndarray]:
    """Places along a polyline, none farther than `reach` from the one before."""
    stops, at = [], start
    for point in points:
        hops = max(1, math.ceil(float(np.linalg.norm(point - at)) / (reach * (1.0 - 1e-6))))
        stops += [at + (point - at) * (hop + 1) / hops for hop in range(hops)]
        at = point
    return stops


def _in_sight(view: RobotView, here: np.ndarray, there: np.ndarray, scratch: tuple[np.ndarray, ...]) -> bool:
    """Whether the straight way to a place is free by the belief."""
    way = there - here
    length = float(np.linalg.norm(way))
    if length < 1e-9:
        return True
    mean, size = view.mean.reshape(-1), view.scenario.grid.shape
    x, y, z = (way / length).tolist()
    radius = view.kind.robot.body_radius_m / view.scenario.grid.voxel_size_m
    return bool(free_by_belief(mean, size, here, (x, y, z), length, radius, scratch))
