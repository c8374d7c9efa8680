"""The strategy `cliff-raster`: raster scanning from above a cliff (Sujan, sect. 3.2, methods 1-2).

A rover takes the next place of a lattice on its plateau, row by row. It looks in all directions there (method
2) or, as `cliff-raster-fixed-yaw`, along x alone (method 1).

Ours: it looks 30° down, from places a metre apart, and, where no place is left, scans again from where it is.
"""

from __future__ import annotations

import math

import numpy as np

from baselines.strategies.next_best_view.ground_map import GroundMap
from baselines.strategies.next_best_view.plateau_rule import PlateauRule, pose_at
from baselines.strategies.next_best_view.pose_samples import next_of_raster, raster_rows, yaws_around
from entropy_explore_env.frontiers.blocks import NONE
from entropy_explore_env.frontiers.knowledge import RobotKnowledge
from entropy_explore_env.scenario import Scenario

_AHEAD_RAD = math.radians(30.0)
"""How far rovers look down."""
_SPACING_M = 1.0
"""Between places."""


class CliffRaster(PlateauRule):
    """Scans from the places of a lattice, row by row."""

    rule = "cliff-raster"

    def __init__(self, turning: bool = True) -> None:
        """Take the method.

        Args:
            turning: Whether rovers look in all directions from each place, or always along x.
        """
        self._turning = turning

    def reset(self, scenario: Scenario, rng: np.random.Generator) -> None:
        """Begin a mission."""
        super().reset(scenario, rng)
        self._taken: dict[int, dict[int, int]] = {robot: {} for robot in range(scenario.robots)}
        """Robot → number of a column → how many looks it has chosen there."""

    def pick(self, view: RobotKnowledge, ground: GroundMap, reachable: np.ndarray) -> np.ndarray:
        """Return the next place and gaze, the rover's own where none is left; see `PlateauRule`."""
        yaws = yaws_around(view.kind.sensor.field_of_view_rad[0]) if self._turning else [0.0]
        step = max(round(_SPACING_M / self._scenario.grid.voxel_size_m), 1)
        columns, taken = np.argwhere(reachable), self._taken[view.robot]
        places = np.flatnonzero(reachable)[raster_rows(columns, step, reachable.shape)].tolist()
        place = next_of_raster(taken, places, len(yaws))
        if place == NONE:
            return view.pose.copy()
        column = np.array(np.unravel_index(place, reachable.shape))
        return pose_at(view, column, yaws[taken[place] - 1], _AHEAD_RAD)
