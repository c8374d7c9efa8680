"""The strategy `voronoi`: explore and cover by geodesic Voronoi cells (Bhattacharya, Michael & Kumar 2010).

    target = argmin over uncertain q in the own cell of |q - C|   (eqs. 6-8)
    C = Σ q φ(q) / Σ φ(q) over the cell

Each robot divides its own belief among the team, by the positions at which it last heard the others. A path
costs the entropy along it, and φ is the entropy, no less than τ′. The robot goes to the target in its own
cell. A centralised team is the same code with perfect messages.

`voronoi-nearest`, ours, goes to the uncertain voxel that costs least; by length, and a voxel is certain when
its deviation has fallen to the mission's σ_end.

Once all is explored the projected centroid may lead robots in circles, as on a known map in the paper's
reproduction. Its guard (`Rules.guarded`) is not part of this strategy, since missions end by then.
"""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np

from baselines.strategies.territory import Territory, nearest_uncertain, projected_centroid
from entropy_explore_env.belief.paths.geodesic_cells import UNREACHED
from entropy_explore_env.errors import SettingError
from entropy_explore_env.frontiers.knowledge import voxel_of
from entropy_explore_env.planner.driver import Driver
from entropy_explore_env.robots.knowledge import RobotKnowledge
from entropy_explore_env.settings.scenario import Scenario

Control = Literal["projected-centroid", "nearest"]
_LENGTH_COST = 0.01
"""η, cost of a voxel edge of path in addition to its entropy."""
_UNCERTAIN, _LEAST = 0.35, 0.33
"""τ and τ′ in nats: voxels with at least the first are uncertain, and no density is less than the second."""
_NEAREST_UNCERTAIN, _NEAREST_LEAST = 0.02, 0.01
"""The same for `nearest`, where entropy follows the deviation."""


class VoronoiCoverage(Driver):
    """Goes to a target in the robot's own geodesic Voronoi cell, and looks where most bits are expected."""

    rule = "voronoi"

    def __init__(self, control: Control = "projected-centroid") -> None:
        """Take where in its cell a robot goes.

        Raises:
            SettingError: There is no such control.
        """
        if control not in get_args(Control):
            raise SettingError("control", control, f"one of {', '.join(get_args(Control))}")
        self._control = control
        self._tau, self._floor = _UNCERTAIN, _LEAST
        if control == "nearest":
            self._tau, self._floor = _NEAREST_UNCERTAIN, _NEAREST_LEAST

    def reset(self, scenario: Scenario, rng: np.random.Generator) -> None:
        """Begin a mission."""
        super().reset(scenario, rng)
        self._paths = [np.zeros(0, np.int64) for _ in range(scenario.robots)]
        self._to_see = [False] * scenario.robots
        self._territory = Territory(scenario, _LENGTH_COST, self._control == "nearest")

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
        if not leads or (self._to_see[view.robot] and entropy[path[-1]] < self._tau):
            path = self._path_to_target(view, here)
            self._to_see[view.robot] = len(path) > 0 and bool(entropy[path[-1]] >= self._tau)
        self._paths[view.robot] = path
        return land.viewpoint_on(view, path)

    def _path_to_target(self, view: RobotKnowledge, here: int) -> np.ndarray:
        """Return the voxels (N,) of the path in the robot's own cell."""
        land = self._territory
        density = np.maximum(land.entropy, np.float32(self._floor))
        cell = land.divide(view, here)
        if not (density[land.space.cells != UNREACHED] >= self._tau).any():
            cell = land.divide(view, here, explored=True)
        own = len(cell) > 0 and bool(density.reshape(-1)[cell].max() >= self._tau)
        if own and self._control == "nearest":
            target = nearest_uncertain(cell, land.space.costs, density, self._tau)
        else:
            target = projected_centroid(cell, density, self._tau)
        return np.zeros(0, np.int64) if target == UNREACHED else land.path_to(target)
