"""Where a rover can drive on its plateau, and how it gets there: over columns that it knows to carry it."""

from __future__ import annotations

import math

import numpy as np
from scipy.ndimage import distance_transform_edt

from entropy_explore_env.belief.paths.lattice import costs_of, new_lattice
from entropy_explore_env.belief.paths.planning import search_paths
from entropy_explore_env.belief.paths.search import costs_to_all, extract_path, new_search
from entropy_explore_env.belief.paths.string_pulling import string_pulled

_ANY_GOAL = -1
_HALF_DIAGONAL = 0.5 * math.sqrt(2.0)


def safe_columns(carrying: np.ndarray, body_radius: float) -> np.ndarray:
    """(X, Y) bool, in the middle of which columns all of a body's circle is carried.

    Args:
        carrying: (X, Y) bool, which columns are known to carry the rover.
        body_radius: In columns.
    """
    gaps = np.asarray(distance_transform_edt(np.pad(carrying, 1)))[1:-1, 1:-1]
    return gaps >= body_radius + _HALF_DIAGONAL


class PlateauPaths:
    """Shortest paths over safe columns; one search at a time."""

    def __init__(self, shape: tuple[int, int]) -> None:
        """Memory for a grid of (X, Y) columns."""
        self._shape = shape
        self._lattice = new_lattice((*shape, 1))
        self._search = new_search(shape[0] * shape[1])

    def start(self, safe: np.ndarray, here: tuple[int, int]) -> np.ndarray:
        """(X, Y) bool, which columns can be reached from the rover's; a new search.

        Args:
            safe: (X, Y) bool; the rover's own column counts as safe.
            here: The rover's column.
        """
        traversal_cost = np.where(safe, np.float32(1.0), np.float32(math.inf))
        traversal_cost[here] = 1.0
        self._costs = costs_of(traversal_cost.reshape(-1), 1.0)
        source = np.array([self._number(here)], np.int32)
        search_paths(self._search, self._lattice, self._costs, source, _ANY_GOAL, math.inf)
        lengths = np.empty(self._shape[0] * self._shape[1])
        costs_to_all(self._search, lengths)
        return np.isfinite(lengths).reshape(self._shape)

    def first_corner(self, start: np.ndarray, goal: np.ndarray) -> np.ndarray:
        """(2,) the end of the first straight piece of the path to a reachable goal, by the latest search.

        Args:
            start: (2,) where the rover is, in columns.
            goal: (2,) in columns.
        """
        last = self._number((int(goal[0]), int(goal[1])))
        path = np.empty(extract_path(self._search, self._lattice, last, np.empty(0, np.int32)), np.int32)
        if len(path) < 2:
            return goal
        extract_path(self._search, self._lattice, last, path)
        ends = [np.array([*place, 0.5]) for place in (start, goal)]
        corners = string_pulled(self._search, self._lattice, self._costs, path, ends[0], ends[1])
        return np.asarray(corners[0, :2]) if len(corners) else goal

    def _number(self, column: tuple[int, int]) -> int:
        return column[0] * self._shape[1] + column[1]
