"""The strategies `coordinated-frontier` (Burgard et al. 2005) and `assigned-frontier`: optimal assignment.

`coordinated-frontier`: frontier cells near those that teammates go to are worth less.

    t* = argmax over frontier cells t of U(t) - β V(t)
    U(t) = 1 - Σ over teammates' targets t' of P(|t - t'|)

with V the length of the path in sensor ranges, and P(d) = 1 - d/range up to the sensor's range, 0 beyond
(eqs. 4-6). Teammates under way have announced their targets. Those who choose anew at the same time are
assigned theirs first where a pair of robot and frontier cell is worth more, as in the paper's algorithm;
the robot assumes that they have its own map.

`assigned-frontier`: frontier cells are put into groups, each within a quarter of a sensor's range of one
cell. All robots that are known, under way or not, are assigned to different groups so that the sum of the
path lengths is least (the Hungarian method, Kuhn 1955). A robot without a group, there being fewer than
robots, goes to the nearest one.

β is the paper's; the radius of groups is tuned, see docs/explorers.md.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from baselines.strategies.rules.nearest_frontier import best_of
from entropy_explore_env.frontiers.blocks import NONE
from entropy_explore_env.frontiers.knowledge import teammates_that_share, voxel_of
from entropy_explore_env.planner.driver import Explorer, Scene
from entropy_explore_env.planner.teammates import centres_of, lengths_of_all, team_of
from entropy_explore_env.validation import check_positive

_UNREACHED = 1e9
"""Length, in voxel edges, in place of inf, which the assignment cannot take."""


@dataclass(frozen=True)
class CoordinatedConfig:
    """What a path costs, and how large groups of frontier cells are.

    Attributes:
        beta: β, cost of a path as long as the sensor's range, against utilities up to 1.
        group: Radius of a group, in sensor ranges.

    Raises:
        SettingError: One of them is no number > 0.
    """

    beta: float = 1.0
    group: float = 0.25

    def __post_init__(self) -> None:
        """Check both."""
        check_positive(self, "beta", "group")


class _Coordinated(Explorer):
    """A rule that weighs all frontier cells that a path leads to by what teammates do."""

    def __init__(self, config: CoordinatedConfig | None = None) -> None:
        """Take the settings; None = the defaults."""
        self.config = config or CoordinatedConfig()

    def pick(self, scene: Scene) -> int:
        """See `Explorer`."""
        voxels, lengths = scene.paths.frontiers_within(math.inf)
        return NONE if len(voxels) == 0 else self.pick_among(scene, voxels, lengths)

    @abstractmethod
    def pick_among(self, scene: Scene, voxels: np.ndarray, lengths: np.ndarray) -> int:
        """The voxel to go to.

        Args:
            scene: What the robot knows.
            voxels: (K,) int32 frontier cells, K ≥ 1.
            lengths: (K,) of the paths to them, in voxel edges.
        """


class CoordinatedFrontier(_Coordinated):
    """Goes to near frontier cells that are far from teammates' targets."""

    rule = "coordinated-frontier"

    def pick_among(self, scene: Scene, voxels: np.ndarray, lengths: np.ndarray) -> int:
        """See `_Coordinated`."""
        team, reach = team_of(scene), scene.cells.reach
        places = centres_of(scene, voxels)
        utility = np.ones(len(voxels))
        for target in team.targets:
            utility -= taken(places, target, reach)
        costs = self.config.beta * lengths_of_all(scene, voxels, lengths, team.places) / reach
        return best_of(voxels, greedy_worth(places, utility, costs, reach), scene.target)


def taken(places: np.ndarray, target: np.ndarray, reach: float) -> np.ndarray:
    """(K,) P(d) of K places (K, 3): the utility that a robot which goes to the target takes from them."""
    return np.maximum(1.0 - np.linalg.norm(places - target, axis=1) / reach, 0.0)


def greedy_worth(places: np.ndarray, utility: np.ndarray, costs: np.ndarray, reach: float) -> np.ndarray:
    """(K,) what frontier cells are worth to the first robot, once cells are assigned to robots before it.

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


class AssignedFrontier(_Coordinated):
    """Goes to the group of frontier cells that the optimal assignment of all robots gives it."""

    rule = "assigned-frontier"

    def pick_among(self, scene: Scene, voxels: np.ndarray, lengths: np.ndarray) -> int:
        """See `_Coordinated`."""
        teammates = teammates_that_share(scene.view).values()
        mates = [mate for mate in teammates if mate.heard_s >= 0.0]
        known = np.array([voxel_of(scene.view, mate.pose) for mate in mates], np.int32)
        group = groups(centres_of(scene, voxels), self.config.group * scene.cells.reach)
        apart = lengths_of_all(scene, voxels, lengths, known)
        least = np.full((len(apart), int(group.max()) + 1), _UNREACHED)
        for robot, row in enumerate(apart):
            np.minimum.at(least[robot], group, np.minimum(row, _UNREACHED))
        robots, assigned = linear_sum_assignment(least)
        mine = assigned[robots == 0]
        worth = np.where(group == mine[0], -lengths, -np.inf) if len(mine) else -lengths
        return best_of(voxels, worth, scene.target)


def groups(places: np.ndarray, radius: float) -> np.ndarray:
    """(K,) int64 number of each place's group: in turn, a place that is in none yet begins one.

    Args:
        places: (K, 3).
        radius: All places of a group are within it of the one that began it.
    """
    group, count = np.full(len(places), -1), 0
    for first in range(len(places)):
        if group[first] < 0:
            near = np.linalg.norm(places - places[first], axis=1) <= radius
            group[near & (group < 0)] = count
            count += 1
    return group
