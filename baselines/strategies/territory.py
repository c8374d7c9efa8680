"""One robot's belief as the Voronoi rules see it: how uncertain voxels are, what paths cost, who owns what.

Arrays have the shape of the grid; voxels are numbered in C order, and a cell is the (N,) int64 numbers of its
voxels, ascending. Entropies are in nats: that of occupancy (Bhattacharya, Michael & Kumar 2010,
belief/entropy.py), or one by standard deviation, ours. Density φ is (X, Y, Z) float32 > 0, without a unit.
"""

from __future__ import annotations

import math

import numpy as np
from scipy import ndimage

from entropy_explore_env.belief.entropy import LN2, fill_occupancy_entropy
from entropy_explore_env.belief.paths.geodesic_cells import (
    UNREACHED,
    extract_path,
    new_tessellation,
    tessellate,
)
from entropy_explore_env.belief.paths.lattice import Lattice
from entropy_explore_env.belief.raycast import STOP_AT_COVERED
from entropy_explore_env.frontiers.knowledge import belief_of, centres_of, teammates_that_share, voxel_of
from entropy_explore_env.planner.stops import WITHIN_REACH
from entropy_explore_env.robots.knowledge import RobotKnowledge
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.viewpoints.evaluation import (
    RobotModel,
    line_is_free,
    new_scratch,
    robot_model,
    sees_all_around,
)
from entropy_explore_env.viewpoints.expected_scan import expected_bits

_GAZES = 16
_PITCHES = (-0.6, 0.0, 0.6)


def projected_centroid(cell: np.ndarray, density: np.ndarray, threshold: float) -> int:
    """Return the voxel of a cell that is nearest to its centroid (eqs. 6-8); UNREACHED in an empty cell.

    C = Σ q φ(q) / Σ φ(q)   over the cell;   the target is the q nearest to C, of those with φ(q) ≥ τ if
    there are any, else of all voxels of the cell.
    """
    if len(cell) == 0:
        return UNREACHED
    weights = density.reshape(-1)[cell].astype(np.float64)
    places = np.stack(np.unravel_index(cell, density.shape), axis=-1)
    sums = (weights[:, None] * np.column_stack([np.ones(len(cell)), places])).sum(axis=0)
    uncertain = weights >= threshold
    if uncertain.any():
        cell, places = cell[uncertain], places[uncertain]
    return int(cell[int(np.argmin(((places - sums[1:] / sums[0]) ** 2).sum(axis=1)))])


def nearest_uncertain(cell: np.ndarray, costs: np.ndarray, density: np.ndarray, threshold: float) -> int:
    """Return the voxel of a cell with φ ≥ τ that costs least to reach; UNREACHED if no φ is ≥ τ."""
    among = cell[density.reshape(-1)[cell] >= threshold]
    return int(among[int(np.argmin(costs.reshape(-1)[among]))]) if len(among) else UNREACHED


class Territory:
    """What one robot's belief says at a decision; memory is shared by the robots of a mission.

    Attributes:
        entropy: (X, Y, Z) float32 nats, filtered (sect. 5.3).
        traversal_cost: (X, Y, Z) float32; inf where the body does not fit.
        metric: `length_cost` and `by_length` of `tessellate`, of the latest division.
        space: The latest division.
    """

    def __init__(self, scenario: Scenario, length_cost: float, by_length: bool) -> None:
        """Take what paths cost until all is explored.

        Args:
            scenario: Of the mission.
            length_cost: Of a voxel edge of path, beside the entropy along it.
            by_length: Whether lengths alone count, and a voxel is certain when its deviation has fallen to
                the mission's σ_end. Else entropy is that of occupancy, p = P(c > ½), as in the paper.
        """
        shape = scenario.grid.shape
        self._exploring = (0.0, True) if by_length else (length_cost, False)
        self._models = [robot_model(scenario, kind) for kind in scenario.kinds]
        self._scratch = new_scratch(scenario.grid, self._models)
        self.space, self.metric = new_tessellation(shape), (0.0, True)
        self.entropy, self.traversal_cost = np.empty(shape, np.float32), np.empty(shape, np.float32)

    def observe(self, view: RobotKnowledge, here: int) -> None:
        """Bring entropies and costs up to date with the belief of a robot that stands in a voxel."""
        if self._exploring[1]:
            prior, end = view.scenario.sigma_prior**-2, view.scenario.ending.sigma_end**-2
            field = deviation_entropy(view.precision, prior, end)
        else:
            field = np.empty(self.entropy.shape, np.float32)
            fill_occupancy_entropy(view.mean.reshape(-1), view.precision.reshape(-1), field.reshape(-1))
        self.entropy = filtered(field)
        cost = np.ones(field.shape, np.float32) if self._exploring[1] else self.entropy.copy()
        start = tuple(int(i) for i in np.unravel_index(here, field.shape))
        inflate_obstacles(view.mean, self._model_of(view).lattice, start, cost)
        self.traversal_cost = cost

    def divide(self, view: RobotKnowledge, here: int, explored: bool = False) -> np.ndarray:
        """Divide the workspace among the robots that are heard and share, and this one.

        Args:
            view: Of the robot.
            here: The voxel in which it stands.
            explored: Whether all is explored: then the task is coverage, and lengths alone count.

        Returns:
            (N,) int64 voxels of the robot's own cell.
        """
        heard = {view.robot: here}
        for mate, seen in teammates_that_share(view).items():
            if seen.heard_s >= 0.0:
                heard[mate] = voxel_of(view, seen.pose)
        robots = sorted(heard)
        if explored and not self._exploring[1]:
            cost = self.traversal_cost
            self.traversal_cost = np.where(np.isinf(cost), cost, np.float32(1.0))
        self.metric = (0.0, True) if explored else self._exploring
        sources = np.array([heard[robot] for robot in robots], np.int64)
        tessellate(self.space, self.traversal_cost, sources, *self.metric)
        return np.flatnonzero(self.space.cells == robots.index(view.robot))

    def path_to(self, target: int) -> np.ndarray:
        """Return the voxels (N,) of the robot's path to a target of its cell, without its own."""
        return extract_path(self.space, self.traversal_cost, target, *self.metric)[1:]

    def viewpoint_on(self, view: RobotKnowledge, path: np.ndarray) -> np.ndarray:
        """Return the viewpoint (5,) at the farthest place of a path that one drive reaches, the gaze best."""
        robot, viewpoint, places = view.kind.robot, view.pose.copy(), centres_of(view, path)
        within = np.linalg.norm(places - view.pose[:3], axis=1) <= robot.reach_m * WITHIN_REACH
        for index in np.flatnonzero(within)[::-1]:
            if index == 0 or robot.navigator == "planned" or self._line_is_free(view, places[index]):
                viewpoint[:3] = places[index]
                break
        return self._gazing(view, viewpoint)

    def _line_is_free(self, view: RobotKnowledge, place: np.ndarray) -> bool:
        """Return whether the straight line to a place (3,), map frame, is free by the belief."""
        grid, radius = view.scenario.grid, self._model_of(view).drive.body_radius
        start, finish = (grid.in_grid_units(np.append(end[:3], (0.0, 0.0))) for end in (view.pose, place))
        return bool(line_is_free(belief_of(view), start, finish, radius, self._scratch))

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
        belief = belief_of(view)
        bits = [expected_bits(belief, model.scan, at, self._scratch) for at in drawn]
        viewpoint[3:] = gazes[int(np.argmax(bits))]
        return viewpoint

    def _model_of(self, view: RobotKnowledge) -> RobotModel:
        return self._models[view.robot % len(self._models)]


def deviation_entropy(precision: np.ndarray, prior_precision: float, end_precision: float) -> np.ndarray:
    """Return float32 entropies: ln 2 at the prior, 0 from the end's precision on, linear in log σ between.

    Rocha04's missions ask for this: a voxel is known when its standard deviation is σ_end.
    """
    missing = np.log(end_precision / precision.astype(np.float64)) / math.log(end_precision / prior_precision)
    return np.asarray(np.clip(LN2 * missing, 0.0, LN2), np.float32)


def filtered(entropy: np.ndarray) -> np.ndarray:
    """Return the least entropy of each voxel and those around it (sect. 5.3): 3 × 3, or 3 × 3 × 3."""
    return ndimage.minimum_filter(entropy, size=[3 if n > 1 else 1 for n in entropy.shape], mode="nearest")


def inflate_obstacles(
    mean: np.ndarray, lattice: Lattice, start: tuple[int, ...], traversal_cost: np.ndarray
) -> None:
    """Make the voxels impassable in which a body does not fit, except for its way out from where it starts.

    Args:
        mean: (X, Y, Z) float32, expected coverage; above ½ a voxel is an obstacle.
        lattice: Of the body.
        start: Indices of the robot's voxel.
        traversal_cost: (X, Y, Z) float32, set to inf there.
    """
    shape, covered = np.array(mean.shape), mean > STOP_AT_COVERED
    body = np.concatenate([np.zeros((1, 3), np.int64), lattice.footprint])
    wide = np.abs(body).max(axis=0)
    touched = np.zeros(2 * wide + 1, bool)
    touched[tuple((body + wide).T)] = True
    layers = slice(None) if lattice.layer < 0 else slice(lattice.layer, lattice.layer + 1)
    inside = np.zeros(mean.shape, bool)
    inside[tuple(slice(near, size - near) for near, size in zip(lattice.margin, shape, strict=True))] = True
    blocked = np.asarray(ndimage.binary_dilation(covered, touched), bool)
    fits = np.zeros(mean.shape, bool)
    fits[:, :, layers] = (inside & ~blocked)[:, :, layers]
    traversal_cost[~fits] = np.inf
    if not fits[start]:
        out = np.array(start) + lattice.footprint
        out = out[
            ((out >= 0) & (out < shape)).all(axis=1) & ((lattice.layer < 0) | (out[:, 2] == lattice.layer))
        ]
        traversal_cost[tuple(out[~covered[tuple(out.T)]].T)] = LN2
        traversal_cost[start] = LN2
