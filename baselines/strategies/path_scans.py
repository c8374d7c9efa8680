"""V of a candidate with what the scans on the path to it see, too."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from entropy_explore_env.belief.paths.lattice import Lattice
from entropy_explore_env.belief.paths.search import Search, extract_path
from entropy_explore_env.frontiers.candidates import Candidates
from entropy_explore_env.scenario import Scenario
from entropy_explore_env.viewpoints.path_scans import fill_path_scans


class Leg(NamedTuple):
    """A drive to a candidate, in grid units."""

    robot: int
    """Who drives."""
    start: np.ndarray
    """(3,) where from."""
    since_scan: float
    """How far the robot has driven since its latest scan under way."""
    voxel: int
    """The candidate's."""
    goal: np.ndarray
    """(3,) the middle of this voxel."""


class PathScans:
    """Counts what is seen from a candidate or from the places of some scans on the path to it."""

    def __init__(self, scenario: Scenario, search: Search, lattice: Lattice, most: int) -> None:
        """Count at most `most` scans on the paths that a search found in a lattice."""
        self._scenario, self._search, self._lattice = scenario, search, lattice
        self._poses = np.zeros((most + 1, 5))
        self._path = np.empty(scenario.grid.voxels if most > 0 else 0, np.int32)

    def seen(self, candidates: Candidates, slot: int, leg: Leg) -> float:
        """V·(height factor) in points of a candidate, with what scans on the path to it see.

        Args:
            candidates: Of the robot that counts.
            slot: Of the candidate.
            leg: The drive to it, along the path of the latest search.
        """
        here, at = np.zeros(5), np.zeros(5)
        here[:3], at[:3] = leg.start, leg.goal
        grid, kind = self._scenario.grid, self._scenario.kind_of(leg.robot)
        every, reach = kind.sensor.scan_every_m / grid.voxel_size_m, kind.robot.reach_m / grid.voxel_size_m
        voxels = extract_path(self._search, self._lattice, leg.voxel, self._path)
        count = fill_path_scans(
            self._lattice,
            grid.shape,
            self._path,
            voxels,
            here,
            at,
            every,
            leg.since_scan,
            reach,
            self._poses[:-1],
        )
        self._poses[count] = at
        return candidates.count_together(slot, self._poses[: count + 1, :3])
