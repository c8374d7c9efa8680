"""The strategy `information-rate-v0`: the viewpoint whose scan is expected to bring most bits per second.

Ours, not a paper's: viewpoints are drawn within reach, half of them turns on the spot, and each is evaluated
by the bits that its scan should take from the robot's own map (viewpoints/expected_scan.py) per second of
driving, turning and scanning. Where nothing nearby is worth much, the robot travels to an uncertain place
farther away, along the shortest path by its belief, scanning at each stop. Voxels that teammates have
announced to see are left to them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from baselines.strategies.knowledge import announced_cones, belief_of
from baselines.strategies.protocol import random_viewpoint
from entropy_explore_env.belief.paths.lattice import MAX_COST_RATIO, belief_costs
from entropy_explore_env.belief.paths.planning import ANY_GOAL, search_paths
from entropy_explore_env.belief.paths.search import cost_to, extract_path, new_search
from entropy_explore_env.belief.paths.string_pulling import string_pulled
from entropy_explore_env.belief.raycast import STOP_AT_COVERED
from entropy_explore_env.missions.view import RobotView
from entropy_explore_env.robots.motion import MoveEnd, driving_time
from entropy_explore_env.scenario import Scenario
from entropy_explore_env.validation import check, check_count, check_not_negative
from entropy_explore_env.viewpoints.drawing import (
    draw_gazes,
    draw_places,
    surroundings,
    vary_gazes,
    vary_places,
)
from entropy_explore_env.viewpoints.evaluation import (
    Outlook,
    RobotModel,
    expected_outlook,
    is_line_free,
    new_scratch,
    robot_model,
)

_BEST = 3
"""Number of viewpoints around which others are drawn."""
_PATIENCE = 4
"""Decisions until a robot that found nothing better farther away searches there again."""
_VOXELS_PER_PLACE, _GAZES = 32, 4
"""Voxels that are drawn for each uncertain place that is evaluated, and gazes there."""


@dataclass(frozen=True)
class InformationRateConfig:
    """How viewpoints are drawn and evaluated.

    Attributes:
        per_scan: Bits per scan instead of bits per second.
        candidates: Viewpoints that are drawn for a decision; half of them turn on the spot.
        refinements: How often viewpoints around the best ones are drawn, a quarter as many each time.
        thinning: One in this many columns, and rows, of the sensor's rays is imagined.
        stop_probability: Probability that an unknown voxel stops a ray.
        poor: Share of the most bits ever expected; if the best viewpoint brings less, the robot looks for
            a place farther away.
        places: Uncertain places farther away that are evaluated then.
        unknown_cost: Traversal cost of unknown space, relative to known free space.
        gives_way: Whether a robot that teammates stopped twice in a row goes to a random viewpoint.

    Raises:
        SettingError: One of them is not allowed.
    """

    per_scan: bool = False
    candidates: int = 80
    refinements: int = 3
    thinning: int = 2
    stop_probability: float = 0.02
    poor: float = 0.1
    places: int = 12
    unknown_cost: float = 2.0
    gives_way: bool = False

    def __post_init__(self) -> None:
        """Check every number."""
        check_count(self, "candidates", 4, 100_000)
        check_count(self, "refinements", 0, 1000)
        check_count(self, "thinning", 1, 1000)
        check_count(self, "places", 1, 10_000)
        check(self, "stop_probability", "a number from 0 to 1", lambda v: 0.0 <= v <= 1.0)
        check_not_negative(self, "poor")
        ratio = f"a number from 1 to {MAX_COST_RATIO:g}"
        check(self, "unknown_cost", ratio, lambda v: 1.0 <= v <= MAX_COST_RATIO)


@dataclass
class _TravelPlan:
    """What a robot remembers from one decision to the next."""

    best_bits: float = 0.0
    """Most bits ever expected of a viewpoint nearby."""
    patience: int = 0
    """Decisions until it looks for a place farther away again."""
    stops: list[np.ndarray] = field(default_factory=list)
    """Places (3,) in grid units that are still ahead."""
    blocked: int = 0
    """Drives in a row that a teammate's body stopped."""


class InformationRate:
    """Chooses viewpoints by expected bits per second, or per scan."""

    def __init__(self, config: InformationRateConfig | None = None) -> None:
        """Take the settings; None = the defaults."""
        self.config = config or InformationRateConfig()

    def reset(self, scenario: Scenario, rng: np.random.Generator) -> None:
        """A new mission begins."""
        config = self.config
        self._rng, self._plans = rng, [_TravelPlan() for _ in range(scenario.robots)]
        self._models = [
            robot_model(scenario, kind, config.thinning, config.stop_probability) for kind in scenario.kinds
        ]
        self._scratch = new_scratch(scenario.grid, self._models)
        self._search = new_search(scenario.grid.voxels)

    def _model_of(self, view: RobotView) -> RobotModel:
        return self._models[view.robot % len(self._models)]

    def choose(self, views: Sequence[RobotView]) -> list[np.ndarray]:
        """The viewpoint of each view, by its own belief and what it has heard."""
        return [self._choose(view) for view in views]

    def _choose(self, view: RobotView) -> np.ndarray:
        plan, config = self._plans[view.robot], self.config
        plan.blocked = plan.blocked + 1 if view.move_end is MoveEnd.TEAMMATE else 0
        if config.gives_way and plan.blocked > 1:
            plan.stops = []
            return random_viewpoint(view, self._rng)
        here = view.scenario.grid.in_grid_units(view.pose)
        cones = announced_cones(view)
        if plan.stops and not self._can_drive_straight(view, here[:3], plan.stops[0]):
            plan.stops = []
        drawn = self._drawn(view, here, plan.stops[0] if plan.stops else None)
        bits, seconds = self._outlook(view, here, drawn, cones)
        for _ in range(config.refinements):
            best = np.argsort(self._values(plan, bits, seconds))[-_BEST:]
            near = self._varied(view, here, drawn[best], moving=not plan.stops)
            near_bits, near_seconds = self._outlook(view, here, near, cones)
            drawn = np.concatenate([drawn[best], near])
            bits = np.concatenate([bits[best], near_bits])
            seconds = np.concatenate([seconds[best], near_seconds])
        best = int(np.argmax(self._values(plan, bits, seconds)))
        if plan.stops:
            plan.stops.pop(0)
        else:
            plan.best_bits = max(plan.best_bits, float(bits[best]))
            plan.patience -= 1
            if bits[best] < config.poor * plan.best_bits and plan.patience <= 0:
                value = float(self._values(plan, bits, seconds)[best])
                plan.stops = self._stops_to_a_better_place(view, here, cones, value)
                if plan.stops and self._can_drive_straight(view, here[:3], plan.stops[0]):
                    return self._choose(view)
                plan.stops, plan.patience = [], _PATIENCE
        viewpoint, grid = drawn[best], view.scenario.grid
        viewpoint[:3] = np.asarray(grid.origin_m) + viewpoint[:3] * grid.voxel_size_m
        return viewpoint

    def _values(self, plan: _TravelPlan, bits: np.ndarray, seconds: np.ndarray) -> np.ndarray:
        """(K,) bits per second of viewpoints; bits if scans count, or if all viewpoints are at one stop."""
        return bits if self.config.per_scan or plan.stops else bits / seconds

    def _can_drive_straight(self, view: RobotView, here: np.ndarray, there: np.ndarray) -> bool:
        """Whether the straight line between two places (3,) is free by the belief."""
        radius = self._model_of(view).drive.body_radius
        return is_line_free(belief_of(view), here, there - here, radius, self._scratch)

    def _drawn(self, view: RobotView, here: np.ndarray, stop: np.ndarray | None) -> np.ndarray:
        """(K, 5) viewpoints in grid units: half on the spot, half within reach; or all at a stop."""
        count = self.config.candidates
        drawn = draw_gazes(here, count, view.level, self._rng)
        if stop is not None:
            drawn[:, :3] = stop
            return drawn
        within = surroundings(view.scenario.grid, view.kind.robot, view.planar)
        drawn[: count // 2, : within.axes] = draw_places(here, count // 2, within, self._rng)
        return drawn

    def _varied(self, view: RobotView, here: np.ndarray, best: np.ndarray, moving: bool) -> np.ndarray:
        """(N, 5) viewpoints around the best ones, in grid units; gazes vary by half the field of view."""
        scan = self._model_of(view).scan
        near = best.repeat(max(self.config.candidates // (4 * len(best)), 1), axis=0)
        spread = 0.5 * max(float(np.ptp(scan.yaws)), float(np.ptp(scan.pitches)), 0.1)
        vary_gazes(near, spread, view.level, self._rng)
        if moving:
            within = surroundings(view.scenario.grid, view.kind.robot, view.planar)
            vary_places(near, here, within, self._rng)
        return near

    def _outlook(
        self,
        view: RobotView,
        here: np.ndarray,
        viewpoints: np.ndarray,
        cones: np.ndarray,
        line_must_be_free: bool = True,
    ) -> Outlook:
        """Expected bits and seconds of (K, 5) viewpoints."""
        model = self._model_of(view)
        model = model._replace(drive=model.drive._replace(line_must_be_free=line_must_be_free))
        return expected_outlook(belief_of(view), model, here, viewpoints, cones, self._scratch)

    def _stops_to_a_better_place(
        self, view: RobotView, here: np.ndarray, cones: np.ndarray, value: float
    ) -> list[np.ndarray]:
        """Stops on the path to the most valuable uncertain place, if that is worth more than staying here.

        Paths are searched only if a place would be worth more if the straight line there were free.
        """
        grid, robot, lattice = view.scenario.grid, view.kind.robot, self._model_of(view).lattice
        reach = min(robot.reach_m / grid.voxel_size_m, float(sum(grid.shape)))
        limits = robot.max_speed_m_s, robot.acceleration_m_s2
        hop_s = driving_time(reach * grid.voxel_size_m, *limits) + view.kind.sensor.scan_time_s
        each = 1.0 if self.config.per_scan else hop_s
        no_fly = view.no_fly_mask()
        drawn = self._drawn_voxels(view, here, no_fly)
        places = self._places(view, here, drawn)
        bits, _ = self._outlook(view, places[0], places, cones, line_must_be_free=False)
        straight = np.linalg.norm(places[:, :3] - here[:3], axis=1)
        if (bits / (np.maximum(straight / reach, 1.0) * each)).max() <= value:
            return []
        prior = view.scenario.sigma_prior**-2
        costs = belief_costs(view.mean, view.precision, prior, self.config.unknown_cost, no_fly)
        start = np.ravel_multi_index(tuple(here[:3].astype(int)), grid.shape)
        search_paths(self._search, lattice, costs, np.array([start], np.int32), ANY_GOAL, math.inf)
        cost = np.array([cost_to(self._search, int(voxel)) for voxel in drawn])
        reached = np.isfinite(cost) & (cost > 0.0)
        if not reached.any():
            return []
        places = self._places(view, here, drawn[reached])
        bits, _ = self._outlook(view, places[0], places, cones, line_must_be_free=False)
        goals = np.asarray(np.ravel_multi_index(tuple(places[:, :3].astype(int).T), grid.shape))
        cost = np.array([cost_to(self._search, int(goal)) for goal in goals])
        values = bits / (np.maximum(cost / reach, 1.0) * each)
        best = int(np.argmax(values))
        if values[best] <= value:
            return []
        goal, none = int(goals[best]), np.empty(0, np.int32)
        path = np.empty(extract_path(self._search, lattice, goal, none), np.int32)
        extract_path(self._search, lattice, goal, path)
        points = string_pulled(self._search, lattice, costs, path, here[:3].copy(), places[best, :3].copy())
        return _stops(here[:3], points, reach)

    def _drawn_voxels(self, view: RobotView, here: np.ndarray, no_fly: np.ndarray | None) -> np.ndarray:
        """(N,) random voxels, neither in the no-fly mask nor believed covered; of a planar robot's layer."""
        grid = view.scenario.grid
        drawn = self._rng.integers(0, grid.voxels, _VOXELS_PER_PLACE * self.config.places)
        if view.planar:
            drawn += int(here[2]) - drawn % grid.shape[2]
        free = view.mean.reshape(-1)[drawn] <= STOP_AT_COVERED
        if no_fly is not None:
            free &= ~no_fly.reshape(-1)[drawn]
        return drawn[free] if free.any() else drawn

    def _places(self, view: RobotView, here: np.ndarray, voxels: np.ndarray) -> np.ndarray:
        """(K, 5) viewpoints in grid units at the least certain of some voxels, a few gazes each."""
        least = np.argsort(view.precision.reshape(-1)[voxels], kind="stable")[: self.config.places]
        places = np.stack(np.unravel_index(voxels[least], view.scenario.grid.shape), axis=-1) + 0.5
        viewpoints = np.repeat(np.concatenate([places, np.zeros((len(places), 2))], axis=1), _GAZES, axis=0)
        viewpoints[:, 3] = self._rng.uniform(-math.pi, math.pi, len(viewpoints))
        if view.planar:
            viewpoints[:, 2] = here[2]
        return viewpoints


def _stops(start: np.ndarray, points: np.ndarray, reach: float) -> list[np.ndarray]:
    """Places along a polyline, none farther than `reach` from the one before."""
    stops, at = [], start
    for point in points:
        hops = max(1, math.ceil(float(np.linalg.norm(point - at)) / (reach * (1.0 - 1e-6))))
        stops += [at + (point - at) * (hop + 1) / hops for hop in range(hops)]
        at = point
    return stops
