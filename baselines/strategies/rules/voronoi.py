"""The strategy `voronoi`: explore and cover by geodesic Voronoi cells (Bhattacharya, Michael & Kumar 2010).

    target = argmin over uncertain q in the own cell of |q - C|   (eqs. 6-8)
    C = Σ q φ(q) / Σ φ(q) over the cell

Each robot divides its own belief among the team, by the positions at which it last heard the others. A path
costs the entropy along it, and φ is the entropy, no less than τ′. The robot goes to the target in its own
cell. A centralised team is the same code with perfect messages.

`voronoi-gradient` takes steps down the coverage functional (eq. 3) and falls back on the projected centroid
where none helps and the cell is not explored; `voronoi-nearest`, ours, goes to the uncertain voxel that costs
least.

Once all is explored the projected centroid may lead robots in circles, as on a known map in the paper's
reproduction. Its guard (`Rules.guarded`) is not part of this strategy, since missions end by then.
"""

from __future__ import annotations

import numpy as np

from baselines.strategies.voronoi.controls import CellFunctional, nearest_uncertain, projected_centroids
from baselines.strategies.voronoi.territory import Division, Territory, VoronoiConfig
from entropy_explore_env.belief.paths.geodesic_cells import UNREACHED
from entropy_explore_env.frontiers.knowledge import RobotKnowledge, voxel_of
from entropy_explore_env.planner.driver import Driver
from entropy_explore_env.scenario import Scenario


class VoronoiCoverage(Driver):
    """Goes to a target in the robot's own geodesic Voronoi cell, and looks where most bits are expected."""

    rule = "voronoi"

    def __init__(self, config: VoronoiConfig | None = None) -> None:
        """Take the settings; None = the defaults."""
        self.config = config or VoronoiConfig()

    def reset(self, scenario: Scenario, rng: np.random.Generator) -> None:
        """Begin a mission."""
        super().reset(scenario, rng)
        self._paths = [np.zeros(0, np.int64) for _ in range(scenario.robots)]
        self._to_see = [False] * scenario.robots
        self._territory = Territory(scenario, self.config)

    def forget_goal(self, view: RobotKnowledge) -> None:
        """Choose a target anew at the next decision."""
        self._paths[view.robot] = np.zeros(0, np.int64)

    def note_blocked(self, view: RobotKnowledge) -> None:
        """Choose a target anew, since the path to this one is blocked."""
        self.forget_goal(view)

    def decide(self, view: RobotKnowledge) -> np.ndarray:
        """Return the viewpoint (5,) on the path to the target; see `Driver`."""
        here, path, land = voxel_of(view, view.pose), self._paths[view.robot], self._territory
        land.observe(view, here)
        passed = np.flatnonzero(path == here)
        path = path[passed[-1] + 1 :] if len(passed) else path[:0]
        entropy, cost = land.entropy.reshape(-1), land.traversal_cost.reshape(-1)
        leads = len(path) > 0 and not np.isinf(cost[path]).any()
        if not leads or (self._to_see[view.robot] and entropy[path[-1]] < self.config.tau):
            path, by_steps = self._path_to_target(view, here)
            uncertain = len(path) > 0 and bool(entropy[path[-1]] >= self.config.tau)
            self._to_see[view.robot] = uncertain and not by_steps
        self._paths[view.robot] = path
        return land.viewpoint_on(view, path)

    def _path_to_target(self, view: RobotKnowledge, here: int) -> tuple[np.ndarray, bool]:
        """Return the voxels (N,) of the path in the robot's own cell, and whether it goes down by steps."""
        config, land = self.config, self._territory
        density = np.maximum(land.entropy, np.float32(config.tau_floor))
        division = land.divided(view, here)
        targets, uncertain = projected_centroids(division.cells, density, config.tau, len(division.sources))
        if not uncertain.any():
            division = land.divided(view, here, explored=True)
            targets, uncertain = projected_centroids(
                division.cells, density, config.tau, len(division.sources)
            )
        target, own = int(targets[division.own]), bool(uncertain[division.own])
        if own and config.control == "nearest":
            cells, costs, sources = division.cells, division.costs, len(division.sources)
            target = int(nearest_uncertain(cells, costs, density, config.tau, sources)[division.own])
        if config.control == "gradient-search":
            path = self._descent(division, density, here)
            if len(path) > 0 or not own:
                return path, True
        return np.zeros(0, np.int64) if target == UNREACHED else land.path_to(division, target), False

    def _descent(self, division: Division, density: np.ndarray, here: int) -> np.ndarray:
        """Return the voxels (N,) of the steps of a gradient search; none if no neighbour is better."""
        cell, path = division.cells == division.own, list[int]()
        if cell.any():
            functional = CellFunctional(self._territory.inner, self._territory.traversal_cost, density, cell)
            path = functional.descent(here, self.config.steps, *division.metric)
        return np.array(path, np.int64)
