"""The strategy `raster` (Sujan, sect. 3.1, method ii): places of a lattice, row by row, as they become known.

A robot takes the next place in row order that can be reached and that it has not scanned from. It looks in
all directions there. Robots do not coordinate.

Ours, where the paper says nothing: places lie half a sensor range apart; with a sensor without range limit, a
twentieth of the workspace's longest side. A view that is narrower than 0.1 rad counts as 0.1 rad wide.
"""

from __future__ import annotations

import math

import numpy as np

from baselines.strategies.next_best_view.poses import reachable_voxels, yaws_around
from entropy_explore_env.frontiers.blocks import NONE
from entropy_explore_env.frontiers.voxel_frontiers import VoxelFrontiers
from entropy_explore_env.planner.frontier_rule import FrontierRule
from entropy_explore_env.planner.scene import NOWHERE, Goal, Scene
from entropy_explore_env.robots.knowledge import RobotKnowledge
from entropy_explore_env.settings.robot_kind import RobotKind
from entropy_explore_env.settings.scenario import Scenario

_SPACING = 0.5
"""Between places, in sensor ranges; without range limit, in tenths of the workspace's longest side."""


class RasterScan:
    """The scans of a raster that a robot has chosen, those that were stopped on the way included."""

    def __init__(self, turning: bool) -> None:
        """Begin; with `turning` it looks in all directions from each place, else along x."""
        self._turning = turning
        self._taken: dict[int, int] = {}
        """Place → number of scans chosen there."""

    def next_scan(self, view: RobotKnowledge, voxels: np.ndarray, spacing_m: float) -> tuple[int, float]:
        """Return the next place, a voxel, and the yaw there; NONE where all scans are taken.

        Args:
            view: Of the robot.
            voxels: (N,) int32 that it can reach.
            spacing_m: Between places.
        """
        grid = view.scenario.grid
        yaws = yaws_around(view.kind.sensor.field_of_view_rad[0]) if self._turning else [0.0]
        axes = 3 if view.scenario.layer_of(view.kind.robot) is None else 2
        places = np.stack(np.unravel_index(voxels, grid.shape), axis=-1)[:, :axes]
        rows = raster_rows(places, max(round(spacing_m / grid.voxel_size_m), 1), grid.shape[:axes])
        reachable = voxels[rows].tolist()
        latest = [place for place in list(self._taken)[-1:] if place in reachable]
        for place in [*latest, *reachable]:
            scans = self._taken.get(place, 0)
            if scans < len(yaws):
                self._taken[place] = scans + 1
                return place, yaws[scans]
        return NONE, 0.0


def raster_rows(places: np.ndarray, step: int, size: tuple[int, ...]) -> np.ndarray:
    """Return which of some places lie on a lattice, in row order: along x, then y, then z.

    Args:
        places: (N, D) indices along D axes.
        step: Of the lattice, whose first place is half a step from the lower corner.
        size: (D,) number of indices along each axis.
    """
    first = np.minimum(step // 2, np.array(size) - 1)
    on_it = np.flatnonzero((places % step == first).all(axis=1))
    return on_it[np.lexsort(places[on_it].T)]


class Raster(FrontierRule):
    """Scans from the places of a lattice, row by row, each as soon as it is known to be free."""

    rule = "raster"
    until_reached, refines, turns_first = True, False, False

    def reset(self, scenario: Scenario, rng: np.random.Generator) -> None:
        """Begin a mission."""
        super().reset(scenario, rng)
        self._scans = [RasterScan(turning=True) for _ in range(scenario.robots)]

    def pick(self, scene: Scene) -> Goal:
        """Return the next place and gaze; see `FrontierRule`."""
        view, voxels = scene.view, reachable_voxels(scene.cells.traversal_cost, scene.paths)
        voxel, yaw = self._scans[view.robot].next_scan(view, voxels, self._spacing_m(view.kind))
        return NOWHERE if voxel == NONE else Goal(voxel, voxel, gaze=(yaw, 0.0))

    def arrive(self, view: RobotKnowledge, cells: VoxelFrontiers, here: int) -> None:
        """Learn nothing: the next gaze is the raster's."""

    def _spacing_m(self, kind: RobotKind) -> float:
        range_m = kind.sensor.max_range_m
        return _SPACING * (0.1 * max(self._scenario.grid.size_m) if math.isinf(range_m) else range_m)
