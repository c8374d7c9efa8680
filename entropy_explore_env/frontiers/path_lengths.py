"""Lengths of paths through known free space, in voxel edges: from a robot, and on average from around it.

A path leads from voxel centre to voxel centre through voxels in which the body may stand, with diagonal
steps: the navigator's own paths before they are pulled straight, where nothing is unknown. Lengths for drones
in fine grids are those of steps between cells of several voxels (`cell_edge`).
"""

from __future__ import annotations

import math

import numpy as np

from entropy_explore_env.belief.paths.lattice import Costs, Lattice, costs_of, new_lattice
from entropy_explore_env.belief.paths.layer_lengths import fill_layer_lengths
from entropy_explore_env.belief.paths.planning import resume_search, search_paths, start_search
from entropy_explore_env.belief.paths.search import Search, extract_path, length_to, new_search
from entropy_explore_env.belief.paths.string_pulling import line_of_sight_cost, string_pulled
from entropy_explore_env.belief.raycast import distance_between
from entropy_explore_env.belief.voxel_index import grid_index
from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.frontiers.blocks import NONE
from entropy_explore_env.frontiers.voxel_frontiers import VoxelFrontiers
from entropy_explore_env.frontiers.voxel_map import voxels_around
from entropy_explore_env.settings.robot_kind import RobotKind
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.viewpoints.evaluation import cell_edge

_ROOM, _ROOM_DRAWS = 40, 64
"""Voxels along each axis within which places are drawn that make room for others, and how many are drawn."""
_FIRST_REACH = 8.0
_EXTENSION = 1.5
"""Searches go so far at first, in voxel edges, and then this many times as far until that is enough."""
_FARTHER = 1.3
"""As _EXTENSION, of searches that need all of some lengths."""


class KnownPaths:
    """Shortest paths through the known free space of one robot's map.

    Lines, and paths that a robot drives along, are always found voxel by voxel.

    Attributes:
        search: Memory of the searches for lengths; one at a time, so that robots can share it.
        lattice: Steps between voxels.
        reach: How far the latest search of `start` goes: lengths up to this are final.
    """

    def __init__(self, scenario: Scenario, kind: RobotKind, cells: VoxelFrontiers, search: Search) -> None:
        """Search paths in the map of `cells`, which may change between searches."""
        self._cells, self.search, self._grid = cells, search, scenario.grid
        shape, layer, edge = scenario.grid.shape, scenario.layer_of(kind.robot), cell_edge(scenario, kind)
        self.lattice = new_lattice(shape, 0.0, layer)
        self._coarse = self.lattice if edge == 1 else new_lattice(shape, 0.0, layer, edge)
        self._by_voxels = search if edge == 1 else new_search(scenario.grid.voxels)
        """Memory of what leads from voxel to voxel: paths that are driven along, and lines."""
        self.costs = costs_of(cells.traversal_cost, 1.0)
        self.reach, self._start = 0.0, NONE

    def start(self, voxel: int) -> None:
        """Begin a search from a voxel in which a robot stands, whether or not its body is known to fit."""
        opened = self._cells.open_start(voxel)
        self._start, indices = voxel, np.unravel_index(voxel, self._grid.shape)
        source = np.ravel_multi_index([n // self._coarse.edge for n in indices], self._coarse.size)
        start_search(self.search, self._coarse, self.costs, np.array([source], np.int32))
        if self._coarse.edge > 1:  # lines are looked up in the map of today
            start_search(self._by_voxels, self.lattice, self.costs, np.array([voxel], np.int32))
        self._search_within(max(_FIRST_REACH, 4.0 * self._cells.body_reach))
        self._cells.close(opened)

    def _search_within(self, reach: float) -> None:
        """Continue the search of `start` until all lengths up to `reach` are final."""
        resume_search(self.search, self._coarse, self.costs, reach / self._coarse.edge)
        self.reach = reach

    def extend(self, reach: float) -> None:
        """Continue the search of `start` until all lengths up to `reach` are final; inf = all."""
        if reach > self.reach:
            self._search_within(reach)

    def exhausted(self) -> bool:
        """Return whether the search has found all that can be reached."""
        return math.isinf(self.reach) or self.search.queue.state[0]["entries"] == 0

    def frontiers_within(self, reach: float) -> tuple[np.ndarray, np.ndarray]:
        """Return (K,) voxels and lengths of the nearest frontier cells of blocks, up to a length.

        `VoxelFrontiers.nearest_of_blocks` says which ones drones find in fine grids.
        """
        self.extend(reach)
        return self._cells.nearest_of_blocks(self.lengths_to, reach)

    def nearest_frontiers(self) -> tuple[np.ndarray, np.ndarray]:
        """Return (K,) frontier cells and lengths, one a block, among them the nearest of all."""
        while True:
            if self.exhausted():
                return self.frontiers_within(math.inf)
            voxels, lengths = self._cells.nearest_of_blocks(self.lengths_to, self.reach)
            if len(voxels):
                return voxels, lengths
            self.extend(_EXTENSION * self.reach)

    def lengths_to(self, voxels: np.ndarray) -> np.ndarray:
        """Return (K,) lengths to (K,) int32 voxels by the latest search, inf where it has not come."""
        lengths = np.empty(len(voxels))
        fill_lengths(self.search, self._coarse, self.costs, voxels, lengths)
        return lengths

    def all_frontiers(self, here: int) -> tuple[np.ndarray, np.ndarray]:
        """Return (K,) voxels and lengths of the frontier cells of blocks nearest to a voxel; a new search."""
        if self.lattice.layer >= 0:
            return self._cells.nearest_of_blocks(lambda cells: self.lengths_from(here, cells))
        self.start(here)
        return self.frontiers_within(math.inf)

    def lengths_from(self, voxel: int, others: np.ndarray, most: float = math.inf) -> np.ndarray:
        """Return (K,) lengths of the paths from a voxel to (K,) int32 others; inf = no path.

        What the latest search found is lost: `start` another one.

        Args:
            voxel: Where a robot stands, whether or not its body is known to fit.
            others: Where the paths end.
            most: No path is longer.
        """
        if self.lattice.layer < 0:
            return self._lengths_by_search(voxel, others, 0.0, most)
        lengths, opened = np.empty(len(others)), self._cells.open_start(voxel)
        fill_layer_lengths(self.search, self.lattice, self.costs, voxel, others, lengths)
        self._cells.close(opened)
        return lengths

    def _lengths_by_search(self, voxel: int, others: np.ndarray, least: float, most: float) -> np.ndarray:
        """Return what `lengths_from` does, by a new search that goes `least` to `most` far."""
        self.start(voxel)
        self.extend(least)
        lengths = self.lengths_to(others)
        while self.reach < most and len(left := np.flatnonzero(~(lengths <= self.reach))):
            self.extend(most if math.isinf(most) else min(_FARTHER * self.reach, most))
            lengths[left] = self.lengths_to(others[left])
        return lengths

    def mean_length(self, voxel: int, others: np.ndarray, least: float, most: float) -> float:
        """Return the mean length of the paths from (N,) int32 voxels to a voxel.

        It makes a new search, which `lengths_to` reads.

        Args:
            voxel: Where the paths end.
            others: Where they begin; those that no path of length `most` connects do not count.
            least: Some path is at least this long.
            most: No path is longer; finite.
        """
        lengths = self._lengths_by_search(voxel, others, least, most)
        lengths = lengths[lengths <= self.reach]
        return float(lengths.sum()) / max(len(lengths), 1)

    def lengths_between(self, places: np.ndarray, lengths: np.ndarray) -> np.ndarray:
        """Return (1 + K, 1 + K) lengths of the shortest paths between the robot and K places; new searches.

        Args:
            places: (K,) int32 voxels, near ones first.
            lengths: (K,) of the paths from the robot to them.
        """
        between = np.zeros((1 + len(places), 1 + len(places)))
        between[0, 1:], between[1:, 0] = lengths, lengths
        # From far places first: near ones then need no long searches.
        for last in range(len(places) - 1, 0, -1):
            most = float((lengths[last] + lengths[:last]).max())
            row = self.lengths_from(int(places[last]), places[:last], most)
            between[1 + last, 1 : 1 + last] = between[1 : 1 + last, 1 + last] = row
        return between

    def around(self, voxel: int, radius: int) -> np.ndarray:
        """Return (N,) int32 voxels that the latest search reached, within a radius along every axis."""
        near = voxels_around(self._grid.shape, voxel, radius, self.lattice.layer)
        lengths = self.lengths_to(near)
        return near[(lengths <= self.reach) & np.isfinite(lengths)]

    def place_away_from(self, here: int, others: list[int], rng: np.random.Generator) -> int:
        """Return a voxel to which the path from a voxel is shorter than from all others; a new search.

        Args:
            here: Where the robot stands.
            others: Where its teammates stand.
            rng: Draws some places, of which the farthest from the others is taken.

        Returns:
            A voxel in which the body is known to fit; NONE = none was found, or there are no others.
        """
        if not others:
            return NONE
        self.start(here)
        self.extend(2.0 * _ROOM)
        around = self.around(here, _ROOM)
        if len(around) == 0:
            return NONE
        drawn = rng.choice(around, _ROOM_DRAWS)
        own = self.lengths_to(drawn)
        apart = np.min([self.lengths_from(other, drawn) for other in others], axis=0)
        nearer = np.flatnonzero((own < apart) & (drawn != here))
        return int(drawn[nearer[np.argmax(apart[nearer])]]) if len(nearer) else NONE

    def is_line_free(self, first: np.ndarray, second: np.ndarray) -> bool:
        """Return whether the straight line between two places (3,), in voxel edges, is known to be free."""
        ends = [(float(p[0]), float(p[1]), float(p[2])) for p in (first, second)]
        cost = line_of_sight_cost(self._by_voxels, self.lattice, self.costs, ends[0], ends[1])
        return math.isfinite(cost)

    def free_lines(self, places: np.ndarray, farthest: float) -> np.ndarray:
        """Return (K, K) bool, pairs of (K, 3) places with a known free line up to `farthest` between them."""
        seen = np.zeros((len(places), len(places)), np.bool_)
        lines = self._by_voxels, self.lattice, self.costs
        fill_free_lines(*lines, np.ascontiguousarray(places), farthest, seen)
        return seen

    def route_to(self, goal: int) -> np.ndarray:
        """Return (N,) int32 voxels of the path to a voxel from where the latest search of `start` began."""
        return self._path_found(goal) if self._coarse.edge == 1 else self.path_to(self._start, goal)

    def _path_found(self, goal: int) -> np.ndarray:
        """Return (N,) int32 voxels of the path to a voxel by the latest search from voxel to voxel."""
        search, nothing = self._by_voxels, np.empty(0, np.int32)
        path = np.empty(extract_path(search, self.lattice, goal, nothing), np.int32)
        extract_path(search, self.lattice, goal, path)
        return path

    def path_to(self, start: int, goal: int) -> np.ndarray:
        """Return (N,) int32 voxels of the shortest path between two voxels; N is 0 without one.

        What the latest search found is lost, where cells are voxels.
        """
        opened = self._cells.open_start(start)
        source = np.array([start], np.int32)
        search_paths(self._by_voxels, self.lattice, self.costs, source, goal, math.inf)
        self._cells.close(opened)
        return self._path_found(goal)

    def corners_of(self, path: np.ndarray, start: np.ndarray, goal: np.ndarray) -> np.ndarray:
        """Return (M, 3) points, grid units, where the latest path, pulled straight, turns; the goal last."""
        return string_pulled(self._by_voxels, self.lattice, self.costs, path, start, goal)


@lean_kernel
def fill_lengths(
    search: Search, lattice: Lattice, costs: Costs, voxels: np.ndarray, lengths: np.ndarray
) -> None:
    """Fill (K,) float64 with the lengths of paths to (K,) int32 voxels by the latest search."""
    for place in range(len(voxels)):
        voxel = grid_index(lattice.grid, np.int64(voxels[place]))
        lengths[place] = length_to(search, lattice, costs, voxel)


@lean_kernel
def fill_free_lines(
    search: Search, lattice: Lattice, costs: Costs, places: np.ndarray, farthest: float, seen: np.ndarray
) -> None:
    """Fill in (K, K) bool; see `KnownPaths.free_lines`."""
    for first in range(len(places)):
        seen[first, first] = True
        for second in range(first):
            a = (places[first, 0], places[first, 1], places[first, 2])
            b = (places[second, 0], places[second, 1], places[second, 2])
            if distance_between(a, b) <= farthest:
                cost = line_of_sight_cost(search, lattice, costs, a, b)
                seen[first, second] = seen[second, first] = not math.isinf(cost)
