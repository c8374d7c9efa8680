"""The strategy `cliff-raster`: raster scanning from above a cliff (Sujan, sect. 3.2, methods 1-2).

A rover takes the next place of a lattice on its plateau, row by row. It looks in all directions there (method
2) or, as `cliff-raster-fixed-yaw`, along x alone (method 1).

Ours: it looks 30° down, from places a metre apart, and, where no place is left, scans again from where it is.
"""

from __future__ import annotations

import math

import numpy as np

from baselines.strategies.next_best_view.ground_map import GroundMap
from baselines.strategies.next_best_view.plateau_rule import PlateauRule
from baselines.strategies.next_best_view.poses import poses_in
from baselines.strategies.rules.raster import RasterScan
from entropy_explore_env.frontiers.blocks import NONE
from entropy_explore_env.robots.knowledge import RobotKnowledge
from entropy_explore_env.settings.scenario import Scenario

_AHEAD_RAD = math.radians(30.0)
"""How far rovers look down."""
_SPACING_M = 1.0
"""Between places."""


class CliffRaster(PlateauRule):
    """Scans from the places of a lattice, row by row."""

    rule = "cliff-raster"

    def __init__(self, turning: bool = True) -> None:
        """Take whether rovers look in all directions from each place, or always along x."""
        self._turning = turning

    def reset(self, scenario: Scenario, rng: np.random.Generator) -> None:
        """Begin a mission."""
        super().reset(scenario, rng)
        self._scans = [RasterScan(self._turning) for _ in range(scenario.robots)]

    def pick(self, view: RobotKnowledge, ground: GroundMap, reachable: np.ndarray) -> np.ndarray:
        """Return the next place and gaze, the rover's own where none is left; see `PlateauRule`."""
        voxel, yaw = self._scans[view.robot].next_scan(view, reachable, _SPACING_M)
        gaze = np.array([yaw, _AHEAD_RAD])
        return view.pose.copy() if voxel == NONE else poses_in(view, voxel, gaze)
