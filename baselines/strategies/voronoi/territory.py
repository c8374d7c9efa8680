"""One robot's belief as the Voronoi rules see it: how uncertain voxels are, what paths cost, who owns what.

Arrays have the shape of the grid; voxels are numbered in C order.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from baselines.strategies.voronoi.uncertainty import fill_deviation_entropy, filtered, inflate_obstacles
from entropy_explore_env.belief.entropy import fill_occupancy_entropy
from entropy_explore_env.belief.paths.geodesic_cells import extract_path, new_tessellation, tessellate
from entropy_explore_env.belief.visibility import CONE
from entropy_explore_env.frontiers.knowledge import (
    RobotKnowledge,
    belief_of,
    teammates_that_share,
    voxel_of,
)
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
_WITHIN_REACH = 0.999
"""Share of the reach that is used, so that rounding never moves a place towards the robot."""


@dataclass(frozen=True)
class VoronoiConfig:
    """How robots divide the workspace and choose targets.

    Attributes:
        control: `projected-centroid`, `gradient-search` or `nearest`: see rules/voronoi.py.
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
class Division:
    """The workspace divided among the robots that are heard, S cells.

    Attributes:
        cells: (X, Y, Z) int32, the cell of each voxel.
        costs: (X, Y, Z) float64, of the path to each voxel from its robot.
        sources: (S,) int64 voxels of the robots, by number.
        own: The robot's own cell.
        metric: (cost of a voxel edge of path beside its entropy, whether lengths alone count).
    """

    cells: np.ndarray
    costs: np.ndarray
    sources: np.ndarray
    own: int
    metric: tuple[float, bool]


class Territory:
    """What one robot's belief says at a decision; memory is shared by the robots of a mission.

    Attributes:
        entropy: (X, Y, Z) float32 nats, filtered (sect. 5.3).
        traversal_cost: (X, Y, Z) float32; inf where the body does not fit.
        inner: Memory for tessellations of one cell.
    """

    def __init__(self, scenario: Scenario, config: VoronoiConfig) -> None:
        """Take what makes a voxel certain, what paths cost, and η."""
        grid = scenario.grid
        self._known, self._by_length, self._eta = config.known, config.metric == "length", config.eta
        self._models = [robot_model(scenario, kind) for kind in scenario.kinds]
        self._space, self.inner = new_tessellation(grid.shape), new_tessellation(grid.shape)
        self._scratch = new_scratch(grid, self._models)
        self.entropy = np.empty(grid.shape, np.float32)
        self.traversal_cost = np.empty(grid.shape, np.float32)

    def observe(self, view: RobotKnowledge, here: int) -> None:
        """Bring entropies and costs up to date with the belief of a robot that stands in a voxel."""
        field = np.empty(self.entropy.shape, np.float32)
        out, mean, precision = field.reshape(-1), view.mean.reshape(-1), view.precision.reshape(-1)
        if self._known == "occupancy":
            fill_occupancy_entropy(mean, precision, out)
        else:
            prior, end = view.scenario.sigma_prior**-2, view.scenario.ending.sigma_end**-2
            fill_deviation_entropy(precision, prior, end, out)
        self.entropy = filtered(field)
        cost = np.ones(field.shape, np.float32) if self._by_length else self.entropy.copy()
        lattice = self._model_of(view).lattice
        x, y, z = (int(i) for i in np.unravel_index(here, field.shape))
        inflate_obstacles(view.mean, lattice.footprint, lattice.margin, lattice.layer, (x, y, z), cost)
        self.traversal_cost = cost

    def divided(self, view: RobotKnowledge, here: int, explored: bool = False) -> Division:
        """Return the division among the robots that are heard and share, and this one.

        Args:
            view: Of the robot.
            here: The voxel in which it stands.
            explored: Whether all is explored: then the task is coverage, and lengths alone count.
        """
        heard = {
            mate: voxel_of(view, seen.pose)
            for mate, seen in teammates_that_share(view).items()
            if seen.heard_s >= 0.0
        }
        heard[view.robot] = here
        robots = sorted(heard)
        if explored and not self._by_length:
            cost = self.traversal_cost
            self.traversal_cost = np.where(np.isinf(cost), cost, np.float32(1.0))
        metric = (0.0, True) if explored or self._by_length else (self._eta, False)
        sources = np.array([heard[robot] for robot in robots], np.int64)
        tessellate(self._space, self.traversal_cost, sources, *metric)
        return Division(self._space.cells, self._space.costs, sources, robots.index(view.robot), metric)

    def path_to(self, division: Division, target: int) -> np.ndarray:
        """Return the voxels (N,) of the robot's path to a target of its cell, without its own."""
        return extract_path(self._space, self.traversal_cost, target, *division.metric)[1:]

    def viewpoint_on(self, view: RobotKnowledge, path: np.ndarray) -> np.ndarray:
        """Return the viewpoint (5,) at the farthest place of a path that one drive reaches, the gaze best."""
        grid, robot = view.scenario.grid, view.kind.robot
        viewpoint = view.pose.copy()
        places = grid.centre_of(np.stack(np.unravel_index(path, grid.shape), axis=-1))
        if view.planar:
            places[:, 2] = view.pose[2]
        within = np.linalg.norm(places - view.pose[:3], axis=1) <= robot.reach_m * _WITHIN_REACH
        for index in np.flatnonzero(within)[::-1]:
            if index == 0 or robot.navigator == "planned" or self._line_is_free(view, places[index]):
                viewpoint[:3] = places[index]
                break
        return self._gazing(view, viewpoint)

    def _line_is_free(self, view: RobotKnowledge, place: np.ndarray) -> bool:
        """Whether the straight line to a place (3,), map frame, is free by the belief."""
        extent = (place - view.pose[:3]) / view.scenario.grid.voxel_size_m
        start, radius = view.scenario.grid.in_grid_units(view.pose), self._model_of(view).drive.body_radius
        return is_line_free(belief_of(view), start, extent, radius, self._scratch)

    def _gazing(self, view: RobotKnowledge, viewpoint: np.ndarray) -> np.ndarray:
        """Return the viewpoint with the gaze from which most bits are expected."""
        model, grid = self._model_of(view), view.scenario.grid
        if view.planar and sees_all_around(view.kind.sensor):
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

    def _model_of(self, view: RobotKnowledge) -> RobotModel:
        return self._models[view.robot % len(self._models)]
