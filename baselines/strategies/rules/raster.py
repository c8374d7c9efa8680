"""The strategy `raster` (Sujan, sect. 3.1, method ii): places of a lattice, row by row, as they become known.

A robot takes the next place in row order that can be reached and that it has not scanned from. It looks in
all directions there, or (`raster-fixed-yaw`) along x alone. Robots do not coordinate.

Ours, where the paper says nothing: places lie half a sensor range apart; with a sensor without range limit, a
twentieth of the workspace's longest side. A view that is narrower than 0.1 rad counts as 0.1 rad wide.
"""

from __future__ import annotations

import math

import numpy as np

from baselines.strategies.next_best_view.pose_samples import (
    next_of_raster,
    raster_rows,
    reachable_voxels,
    yaws_around,
)
from entropy_explore_env.frontiers.blocks import NONE
from entropy_explore_env.frontiers.knowledge import RobotKnowledge
from entropy_explore_env.frontiers.voxel_frontiers import VoxelFrontiers
from entropy_explore_env.planner.frontier_rule import FrontierRule
from entropy_explore_env.planner.scene import NOWHERE, Goal, Scene
from entropy_explore_env.scenario import Scenario
from entropy_explore_env.settings import RobotKind

_SPACING = 0.5
"""Between places, in sensor ranges; without range limit, in tenths of the workspace's longest side."""


class Raster(FrontierRule):
    """Scans from the places of a lattice, row by row, each as soon as it is known to be free."""

    rule = "raster"
    until_reached, refines, turns_first = True, False, False

    def __init__(self, turning: bool = True) -> None:
        """Take the method.

        Args:
            turning: Whether robots look in all directions from each place, or always along x.
        """
        self._turning = turning

    def reset(self, scenario: Scenario, rng: np.random.Generator) -> None:
        """Begin a mission."""
        super().reset(scenario, rng)
        self._taken: dict[int, dict[int, int]] = {robot: {} for robot in range(scenario.robots)}
        """Robot → voxel → how many scans it has chosen there."""

    def pick(self, scene: Scene) -> Goal:
        """Return the next place and gaze; see `FrontierRule`."""
        view = scene.view
        yaws = yaws_around(view.kind.sensor.field_of_view_rad[0]) if self._turning else [0.0]
        taken = self._taken[view.robot]
        voxel = next_of_raster(taken, self._places(view.kind, reachable_voxels(scene)), len(yaws))
        if voxel == NONE:
            return NOWHERE
        return Goal(voxel, voxel, gaze=(yaws[taken[voxel] - 1], 0.0))

    def arrive(self, view: RobotKnowledge, cells: VoxelFrontiers, here: int) -> None:
        """Learn nothing: the next gaze is the raster's."""

    def _places(self, kind: RobotKind, reachable: np.ndarray) -> list[int]:
        """Return the lattice's places among (N,) reachable voxels, in row order."""
        grid, range_m = self._scenario.grid, kind.sensor.max_range_m
        unit_m = 0.1 * max(grid.size_m) if math.isinf(range_m) else range_m
        step = max(round(_SPACING * unit_m / grid.voxel_size_m), 1)
        axes = 3 if self._scenario.layer_of(kind.robot) is None else 2
        indices = np.stack(np.unravel_index(reachable, grid.shape), axis=-1)[:, :axes]
        return reachable[raster_rows(indices, step, grid.shape[:axes])].tolist()
