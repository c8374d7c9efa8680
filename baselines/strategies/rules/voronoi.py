"""The strategy `voronoi`: explore and cover by geodesic Voronoi cells (Bhattacharya, Michael & Kumar 2010).

Each robot divides its own belief among the team, by the positions at which it last heard the others. A path
costs the entropy along it. The robot goes to a target in its own cell. A centralised team is the same code
with perfect messages.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from baselines.strategies.protocol import random_viewpoint
from baselines.strategies.voronoi.controls import (
    CellFunctional,
    gradient_step,
    nearest_uncertain,
    projected_centroids,
)
from baselines.strategies.voronoi.uncertainty import fill_deviation_entropy, filtered, inflate_obstacles
from entropy_explore_env.belief.entropy import fill_occupancy_entropy
from entropy_explore_env.belief.paths.geodesic_cells import (
    UNREACHED,
    extract_path,
    new_tessellation,
    tessellate,
)
from entropy_explore_env.belief.visibility import CONE
from entropy_explore_env.frontiers.knowledge import belief_of, teammates_that_share, voxel_of
from entropy_explore_env.missions.view import RobotView
from entropy_explore_env.robots.motion import MoveEnd
from entropy_explore_env.scenario import Scenario
from entropy_explore_env.validation import check, check_choice, check_count
from entropy_explore_env.viewpoints.evaluation import (
    RobotModel,
    is_line_free,
    new_scratch,
    robot_model,
    sees_all_around,
)
from entropy_explore_env.viewpoints.expected_scan import fill_expected_bits

Control = Literal["projected-centroid", "gradient-search", "nearest"]
Metric = Literal["entropy", "length"]
Known = Literal["occupancy", "deviation"]

_GAZES = 16
_PITCHES = (-0.6, 0.0, 0.6)
_NOTHING = 0.01
"""A scan that brings less than this share of the most that one brought has brought nothing."""
_WITHIN_REACH = 0.999
"""Share of the reach that is used, so that rounding never moves a place towards the robot."""


@dataclass(frozen=True)
class VoronoiConfig:
    """How robots divide the workspace and choose targets.

    Once all is explored the projected centroid may lead robots in circles, as on a known map in the paper's
    reproduction. Its guard (`Rules.guarded`) is not part of this strategy, since missions end by then.
    Where a mission asks for more than the paper does, robots that have covered all would scan from one spot
    for ever: a robot whose scan brought nothing, and which would repeat it, goes anywhere (ours).

    Attributes:
        control: `projected-centroid` (eqs. 6-8); `gradient-search` (eq. 3), which takes `steps` steps a
            decision and falls back on the projected centroid where none helps and the cell is not explored;
            `nearest`: the uncertain voxel of the own cell that costs least to reach (ours).
        metric: What paths cost until all is explored: `entropy` (sect. 5.2) or `length`.
        known: What makes a voxel certain: its `occupancy` (p = P(c > ½), as in the paper), or its
            `deviation`, which has to fall to the mission's σ_end (ours).
        eta: η, cost of a voxel edge of path in addition to its entropy.
        tau: τ in nats: voxels with at least this entropy are uncertain.
        tau_floor: τ′, the least density, below τ.
        steps: Steps of the gradient search per decision.
    """

    control: Control = "projected-centroid"
    metric: Metric = "entropy"
    known: Known = "occupancy"
    eta: float = 0.01
    tau: float = 0.35
    tau_floor: float = 0.33
    steps: int = 5

    def __post_init__(self) -> None:
        """Check every field."""
        check_choice(self, "control", Control)
        check_choice(self, "metric", Metric)
        check_choice(self, "known", Known)
        check(self, "eta", "a number from 1e-6 to 1e3", lambda v: 1e-6 <= v <= 1e3)
        check(self, "tau", "a number from 1e-6 to ln 2", lambda v: 1e-6 <= v <= 0.6931)
        check(self, "tau_floor", "a number above 0 and below tau", lambda v: 0.0 < v < self.tau)
        check_count(self, "steps", 1, 1000)


@dataclass
class _TravelPlan:
    """What a robot remembers from one decision to the next."""

    path: np.ndarray = field(default_factory=lambda: np.zeros(0, np.int64))
    """(N,) voxels to the target that are still ahead."""
    to_see: bool = False
    """Whether the target was uncertain when it was chosen."""
    failures: int = 0
    """Consecutive drives that ended early."""
    viewpoint: np.ndarray = field(default_factory=lambda: np.full(5, np.nan))
    """(5,) as chosen at the latest decision."""
    most_bits: float = 0.0
    """Of a scan so far."""


class VoronoiCoverage:
    """Goes to a target in the robot's own geodesic Voronoi cell, and looks where most bits are expected."""

    def __init__(self, config: VoronoiConfig | None = None) -> None:
        """Take the settings; None = the defaults."""
        self.config = config or VoronoiConfig()

    def reset(self, scenario: Scenario, rng: np.random.Generator) -> None:
        """A new mission begins."""
        grid = scenario.grid
        self._rng = rng
        self._plans = [_TravelPlan() for _ in range(scenario.robots)]
        self._models = [robot_model(scenario, kind) for kind in scenario.kinds]
        self._space, self._inner = new_tessellation(grid.shape), new_tessellation(grid.shape)
        self._entropy = np.empty(grid.shape, np.float32)
        self._scratch = new_scratch(grid, self._models)

    def choose(self, views: Sequence[RobotView]) -> list[np.ndarray]:
        """The viewpoint of each view, by its own belief and where it last heard the others."""
        return [self._choose(view) for view in views]

    def _choose(self, view: RobotView) -> np.ndarray:
        plan, here = self._plans[view.robot], voxel_of(view, view.pose)
        ended_early = view.move_end not in (MoveEnd.ARRIVED, MoveEnd.SEEN, MoveEnd.UNDER_WAY)
        plan.failures = plan.failures + 1 if ended_early else 0
        if plan.failures > 1:  # the same belief would lead to the same choice
            plan.path, plan.failures = plan.path[:0], 0
            return random_viewpoint(view, self._rng)
        entropy = self._uncertainty(view)
        traversal_cost = self._traversal_cost(view, entropy, here)
        ahead = np.flatnonzero(plan.path == here)
        plan.path = plan.path[ahead[-1] + 1 :] if len(ahead) else plan.path[:0]
        if ended_early or not self._is_valid(plan, entropy, traversal_cost):
            self._choose_target(view, entropy, traversal_cost, here)
        viewpoint = self._towards(view, plan)
        came_bits = float(view.scan.utility_bits.sum())
        plan.most_bits = max(plan.most_bits, came_bits)
        if np.allclose(viewpoint, plan.viewpoint) and came_bits < _NOTHING * plan.most_bits:
            viewpoint = random_viewpoint(view, self._rng)
        plan.viewpoint = viewpoint.copy()
        return viewpoint

    def _uncertainty(self, view: RobotView) -> np.ndarray:
        """(X, Y, Z) float32 nats, filtered."""
        out, mean, precision = self._entropy.reshape(-1), view.mean.reshape(-1), view.precision.reshape(-1)
        if self.config.known == "occupancy":
            fill_occupancy_entropy(mean, precision, out)
        else:
            prior, end = view.scenario.sigma_prior**-2, view.scenario.ending.sigma_end**-2
            fill_deviation_entropy(precision, prior, end, out)
        return filtered(self._entropy)

    def _traversal_cost(self, view: RobotView, entropy: np.ndarray, here: int) -> np.ndarray:
        """(X, Y, Z) float32, by the metric that is set; inf where the body does not fit."""
        lattice, shape = self._model_of(view).lattice, view.scenario.grid.shape
        traversal_cost = entropy.copy() if self.config.metric == "entropy" else np.ones(shape, np.float32)
        x, y, z = (int(i) for i in np.unravel_index(here, shape))
        inflate_obstacles(
            view.mean, lattice.footprint, lattice.margin, lattice.layer, (x, y, z), traversal_cost
        )
        return traversal_cost

    def _is_valid(self, plan: _TravelPlan, entropy: np.ndarray, traversal_cost: np.ndarray) -> bool:
        """Whether the plan leads to a target that is still worth going to, without a known obstacle."""
        if len(plan.path) == 0 or np.isinf(traversal_cost.reshape(-1)[plan.path]).any():
            return False
        return not plan.to_see or bool(entropy.reshape(-1)[plan.path[-1]] >= self.config.tau)

    def _choose_target(
        self, view: RobotView, entropy: np.ndarray, traversal_cost: np.ndarray, here: int
    ) -> None:
        """Divide the belief, and choose the target in the robot's own cell."""
        config, plan = self.config, self._plans[view.robot]
        sources, own = self._sources(view, here)
        density = np.maximum(entropy, np.float32(config.tau_floor))
        by_length = config.metric == "length"
        metric = (0.0 if by_length else config.eta, by_length)
        tessellate(self._space, traversal_cost, sources, *metric)
        targets, uncertain = projected_centroids(self._space.cells, density, config.tau, len(sources))
        if not uncertain.any() and not by_length:  # all is explored: now the task is coverage
            traversal_cost, metric = (
                np.where(np.isinf(traversal_cost), traversal_cost, np.float32(1.0)),
                (0.0, True),
            )
            tessellate(self._space, traversal_cost, sources, *metric)
            targets, uncertain = projected_centroids(self._space.cells, density, config.tau, len(sources))
        target = int(targets[own])
        if uncertain[own] and config.control == "nearest":
            arrays = self._space.cells, self._space.costs, density
            target = int(nearest_uncertain(*arrays, config.tau, len(sources))[own])
        plan.path, plan.to_see = np.zeros(0, np.int64), False
        if config.control == "gradient-search":
            plan.path = self._descent(traversal_cost, density, own, here, metric)
        if (
            len(plan.path) == 0
            and target != UNREACHED
            and (config.control != "gradient-search" or uncertain[own])
        ):
            plan.path = extract_path(self._space, traversal_cost, target, *metric)[1:]
            plan.to_see = bool(entropy.reshape(-1)[target] >= config.tau)

    def _descent(
        self, traversal_cost: np.ndarray, density: np.ndarray, own: int, here: int, metric: tuple[float, bool]
    ) -> np.ndarray:
        """(N,) voxels, the steps of a gradient search; empty if no neighbour is better."""
        cell, path = self._space.cells == own, list[int]()
        if not cell.any():
            return np.zeros(0, np.int64)
        functional = CellFunctional(self._inner, traversal_cost, density, cell)
        for _ in range(self.config.steps):
            step = gradient_step(functional, cell, here, *metric)
            if step == here:
                break
            path.append(step)
            here = step
        return np.array(path, np.int64)

    def _sources(self, view: RobotView, here: int) -> tuple[np.ndarray, int]:
        """Voxels of the robots that are heard and share, and of this one, by number; and this one's index."""
        heard = {
            mate: voxel_of(view, seen.pose)
            for mate, seen in teammates_that_share(view).items()
            if seen.heard_s >= 0.0
        }
        heard[view.robot] = here
        robots = sorted(heard)
        return np.array([heard[robot] for robot in robots], np.int64), robots.index(view.robot)

    def _towards(self, view: RobotView, plan: _TravelPlan) -> np.ndarray:
        """The farthest place on the path that one drive reaches, and the best gaze there."""
        grid, robot = view.scenario.grid, view.kind.robot
        viewpoint = view.pose.copy()
        places = grid.centre_of(np.stack(np.unravel_index(plan.path, grid.shape), axis=-1))
        if view.planar:
            places[:, 2] = view.pose[2]
        within = np.linalg.norm(places - view.pose[:3], axis=1) <= robot.reach_m * _WITHIN_REACH
        for index in np.flatnonzero(within)[::-1]:
            if index == 0 or robot.navigator == "planned" or self._in_sight(view, places[index]):
                viewpoint[:3] = places[index]
                break
        return self._gazing(view, viewpoint)

    def _in_sight(self, view: RobotView, place: np.ndarray) -> bool:
        """Whether the straight line to a place (3,), map frame, is free by the belief."""
        extent = (place - view.pose[:3]) / view.scenario.grid.voxel_size_m
        start = view.scenario.grid.in_grid_units(view.pose)
        radius = self._model_of(view).drive.body_radius
        return is_line_free(belief_of(view), start, extent, radius, self._scratch)

    def _gazing(self, view: RobotView, viewpoint: np.ndarray) -> np.ndarray:
        """The viewpoint with the gaze from which most bits are expected; unchanged if the sensor sees all."""
        model, kind, grid = self._model_of(view), view.kind, view.scenario.grid
        if view.planar and sees_all_around(kind.sensor):
            return viewpoint
        yaws = view.pose[3] + np.arange(_GAZES) * (2.0 * math.pi / _GAZES)
        pitches = (0.0,) if view.planar else _PITCHES
        gazes = np.stack(np.meshgrid(yaws, pitches, indexing="ij"), axis=-1).reshape(-1, 2)
        drawn = np.tile(grid.in_grid_units(viewpoint), (len(gazes), 1))
        drawn[:, 3:] = gazes
        bits, no_cones = np.empty(len(drawn)), np.zeros(0, CONE)
        fill_expected_bits(belief_of(view), model.scan, drawn, no_cones, self._scratch, bits)
        viewpoint[3:] = gazes[int(np.argmax(bits))]
        return viewpoint

    def _model_of(self, view: RobotView) -> RobotModel:
        return self._models[view.robot % len(self._models)]
