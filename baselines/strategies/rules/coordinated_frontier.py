"""The strategy `coordinated-frontier` (Burgard et al. 2005): cells near teammates' targets are worth less.

    t* = argmax over frontier cells t of U(t) - β V(t)
    U(t) = 1 - Σ over teammates' targets t' of P(|t - t'|)

with V the length of the path in sensor ranges, and P(d) = 1 - d/range up to the sensor's range, 0 beyond
(eqs. 4-6). Teammates under way have announced their targets. Those that choose anew at the same time are
assigned theirs first where a pair of robot and frontier cell is worth more, as in the paper's algorithm; the
robot assumes that they have its own map.

β is the paper's, which finds values from 0.01 to 50 alike.
"""

from __future__ import annotations

import math

import numpy as np

from entropy_explore_env.frontiers.blocks import NONE
from entropy_explore_env.planner.frontier_rule import FrontierRule
from entropy_explore_env.planner.scene import Scene, best_of


class CoordinatedFrontier(FrontierRule):
    """Goes to near frontier cells that are far from teammates' targets."""

    rule = "coordinated-frontier"
    beta = 1.0
    """β, cost of a path as long as the sensor's range, against utilities up to 1."""

    def pick(self, scene: Scene) -> int:
        """Return the voxel to go to; see `FrontierRule`."""
        voxels, lengths = scene.paths.frontiers_within(math.inf)
        if len(voxels) == 0:
            return NONE
        team, reach, places = scene.team(), scene.cells.reach, scene.centres(voxels)
        utility = np.ones(len(voxels))
        for target in team.targets:
            utility -= taken(places, target, reach)
        costs = self.beta * scene.lengths_of_team(voxels, lengths, team.places) / reach
        return best_of(voxels, greedy_worth(places, utility, costs, reach), scene.target)


def taken(places: np.ndarray, target: np.ndarray, reach: float) -> np.ndarray:
    """Return P(d) (K,) of places (K, 3): the utility that a robot at the target takes from them."""
    return np.maximum(1.0 - np.linalg.norm(places - target, axis=1) / reach, 0.0)


def greedy_worth(places: np.ndarray, utility: np.ndarray, costs: np.ndarray, reach: float) -> np.ndarray:
    """Return what K cells are worth to the first robot, once cells are assigned to robots before it.

    Args:
        places: (K, 3) of the cells, in voxel edges.
        utility: (K,) U before the assignment.
        costs: (R, K) β V of R robots.
        reach: Of the sensor, in voxel edges.
    """
    left = list(range(len(costs)))
    utility = utility.copy()
    while True:
        worth = utility - costs[left]
        robot, cell = np.unravel_index(int(np.argmax(worth)), worth.shape)
        if left[robot] == 0 or not math.isfinite(worth[robot, cell]):
            return utility - costs[0]
        utility -= taken(places, places[cell], reach)
        left.pop(int(robot))
