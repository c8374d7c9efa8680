"""Which robot goes to which candidate: synchronous and asynchronous allocation (Sawhney 2009, sect. 3.2).

The pair of a robot and a candidate with the greatest value is allocated first. The points that are seen from
there count as promised, and the next pair is chosen by what remains. Asynchronously only stopped robots take
part, and the promises of robots under way hold until they have scanned; synchronously all robots wait for
each other and take part together. Each robot allocates by its own belief and the messages that reached it
(poses, announcements): it simulates the choices of the others, and makes its own. With perfect messages that
is the paper's central procedure. Teammates of another kind are assumed to have the robot's own sensor and
body. A robot counts as stopped if it was heard since it announced its latest viewpoint, that is, its scan
arrived; or if nothing was heard of it for longer than any drive takes.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from entropy_explore_env.belief.paths.lattice import Lattice, costs_of, new_lattice
from entropy_explore_env.belief.paths.planning import resume_search, search_paths, start_search
from entropy_explore_env.belief.paths.search import Search, cost_to, costs_to_all
from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.frontiers.blocks import NONE
from entropy_explore_env.frontiers.frontier_map import FrontierConfig, FrontierMap
from entropy_explore_env.frontiers.terrain_frontiers import TerrainFrontiers
from entropy_explore_env.frontiers.voxel_frontiers import VoxelFrontiers
from entropy_explore_env.missions.view import RobotView
from entropy_explore_env.robots.motion import driving_time
from entropy_explore_env.scenario import Scenario
from entropy_explore_env.settings import RobotKind

_FIRST_REACH = 0.25
"""Paths are searched so far at first, in sensor ranges: most choices are nearer, and a search over a whole
range costs more than counting the few candidates beyond that could be better."""
_EXTENSION = 1.4
"""Then they are searched this many times as far until that is enough."""
_PARTING_DRAWS = 8
"""So many places away from teammates are drawn, of which the farthest from them is taken."""


class Value(Protocol):
    """Values of candidates; never greater for less V, or for a longer path."""

    def __call__(
        self, seen: np.ndarray, seconds: np.ndarray, edges: np.ndarray, taken: np.ndarray
    ) -> np.ndarray:
        """(K,) values; -inf = no candidate.

        Args:
            seen: (K,) V·(height factor) in points' size.
            seconds: (K,) travel and scan.
            edges: (K,) length of the path in voxel edges.
            taken: (K,) share of a frontier's utility that robots take which go near it, ≥ 0 (Burgard 2005).
        """
        ...


@dataclass(frozen=True)
class Choice:
    """A candidate that was allocated to a robot."""

    slot: int
    """Of the candidate in its map."""
    voxel: int
    """The voxel in which it lies."""
    value: float
    """By the metric."""
    seconds: float
    """Of travel and scan."""


@dataclass(frozen=True)
class _PathCosts:
    """Lengths of a robot's paths to all candidates."""

    start: np.ndarray
    """(3,) where they start, grid units."""
    reach: float
    """Up to which length they were searched, in voxel edges."""
    edges: np.ndarray
    """(B,) float64, lengths by the candidates' slots; inf = no path up to that length."""
    search: int
    """Number of their search, which can be resumed as long as it is the latest."""


class Allocator:
    """Candidates of one robot's belief, and their allocation.

    Attributes:
        candidates: See candidates.py.
        search: Memory of path searches, shared with other robots.
        counted: How many candidates were counted in all.
    """

    def __init__(
        self,
        scenario: Scenario,
        kind: RobotKind,
        frontiers: FrontierConfig,
        value: Value,
        search: Search,
        ceiling: np.ndarray | None,
        lazy: bool,
    ) -> None:
        """Nothing is explored yet.

        Args:
            scenario: The mission's settings.
            kind: Of the robot.
            frontiers: Where candidates lie, and how V is counted.
            value: The metric.
            search: Memory of path searches.
            ceiling: (X, Y) the exposure surface in layers; None = candidates are voxels.
            lazy: Whether candidates are counted only as far as a choice needs.
        """
        self._value, self._lazy, self.search = value, lazy, search
        self._edge, self._scenario = scenario.grid.voxel_size_m, scenario
        layer = scenario.layer_of(kind.robot)
        self.lattice: Lattice = new_lattice(scenario.grid.shape, 0.0, layer)
        self.candidates: FrontierMap = (
            VoxelFrontiers(scenario, kind, frontiers)
            if ceiling is None
            else TerrainFrontiers(scenario, kind, frontiers, ceiling)
        )
        self.costs = costs_of(self.candidates.traversal_cost, 1.0)
        self.counted = 0

    def allocate(
        self, view: RobotView, stopped: Sequence[int], targets: Sequence[np.ndarray], everybody: bool = False
    ) -> dict[int, Choice]:
        """The candidates that are allocated to a robot and to those before it.

        Args:
            view: Of the robot; the candidates are up to date with its belief.
            stopped: Teammates that are allocated something at the same time.
            targets: (3,) places in grid units to which others are under way.
            everybody: Whether the allocation continues after this robot's turn.

        Returns:
            Robot → candidate. The robot is missing if from no candidate that it reaches anything unexplored
            can be seen.
        """
        candidates, taken = self.candidates, list(targets)
        for target in targets:
            candidates.promise(target)
        unassigned, found = [view.robot, *sorted(stopped)], dict[int, Choice]()
        path_costs: dict[int, _PathCosts] = {}
        while unassigned:
            choices = {robot: self._best(view, robot, path_costs, taken) for robot in unassigned}
            best = max(sorted(unassigned), key=lambda robot: _value_of(choices[robot]))
            choice = choices[best]
            if choice is None:
                break
            found[best] = choice
            unassigned.remove(best)
            if best == view.robot and not everybody:
                break
            place = self.place_of(choice.voxel)
            candidates.promise(place)
            taken.append(place)
        candidates.release()
        return found

    def options(self, view: RobotView) -> tuple[np.ndarray, np.ndarray]:
        """What the robot can choose from now: (K,) seconds and (K,) V·(height factor) of each candidate.

        The candidates must be up to date with the belief; no promises count.
        """
        path_costs = self._path_costs(view.pose, math.inf)
        slots, voxels = self.candidates.listed()
        reached = np.isfinite(path_costs.edges[slots])
        slots, voxels = slots[reached], voxels[reached]
        seen = self.candidates.count(slots, voxels) * self.candidates.point
        return self.seconds(view.robot, path_costs.edges[slots]), seen

    def away_from(self, view: RobotView, rng: np.random.Generator) -> int:
        """A voxel to which the robot has a shorter path than any teammate of which it heard; NONE = none.

        Of some that are drawn the one that is farthest from teammates.
        """
        heard = [mate.pose for mate in view.teammates.values() if mate.heard_s >= 0.0]
        if not heard:
            return NONE
        apart = np.min([self._costs_everywhere(pose) for pose in heard], axis=0)
        own = self._costs_everywhere(view.pose)
        own[self.start_of(view.pose)] = math.inf
        nearer = np.flatnonzero(own < apart)
        if len(nearer) == 0:
            return NONE
        drawn = rng.choice(nearer, _PARTING_DRAWS)
        return int(drawn[np.argmax(apart[drawn])])

    def _costs_everywhere(self, pose: np.ndarray) -> np.ndarray:
        """(V,) float64 lengths of the paths from a pose to all voxels; inf = no path through mapped space."""
        costs = np.empty(self._scenario.grid.voxels)
        with self._passable_start(pose) as source:
            start_search(self.search, self.lattice, self.costs, source)
            resume_search(self.search, self.lattice, self.costs, math.inf)
        costs_to_all(self.search, costs)
        return costs

    def place_of(self, voxel: int) -> np.ndarray:
        """(3,) centre of a voxel, grid units."""
        return np.stack(np.unravel_index(voxel, self._scenario.grid.shape)).astype(float) + 0.5

    def start_of(self, pose: np.ndarray) -> int:
        """Number of the voxel of a pose (5,), map frame."""
        grid = self._scenario.grid
        place = np.clip(grid.voxel_of(pose[:3]), 0, np.array(grid.shape) - 1)
        if self.lattice.layer >= 0:
            place[2] = self.lattice.layer
        return int(np.ravel_multi_index(tuple(place), grid.shape))

    def search_path(self, pose: np.ndarray, goal: int) -> None:
        """Search the path from a pose to a voxel, through the mapped region."""
        with self._passable_start(pose) as source:
            search_paths(self.search, self.lattice, self.costs, source, goal, math.inf)

    @contextmanager
    def _passable_start(self, pose: np.ndarray) -> Iterator[np.ndarray]:
        """(1,) int32, the voxel of a pose, which is made passable meanwhile."""
        start = self.start_of(pose)
        opened = self.candidates.open_start(start)
        try:
            yield np.array([start], np.int32)
        finally:
            self.candidates.close(opened)

    def _path_costs(self, pose: np.ndarray, reach: float, before: _PathCosts | None = None) -> _PathCosts:
        """Shortest-path costs from a robot's last known pose; extends `before` where it can."""
        arrays = self.search, self.lattice, self.costs
        with self._passable_start(pose) as source:
            if before is None or before.search != self.search.searches[0]:
                start_search(*arrays, source)
            resume_search(*arrays, reach)
        voxels = self.candidates.voxels_of(slice(None))
        edges = np.full(len(voxels), np.inf)
        ask_costs(self.search, voxels, reach, edges)
        return _PathCosts(self.place_of(int(source[0])), reach, edges, int(self.search.searches[0]))

    def _best(
        self, view: RobotView, robot: int, path_costs: dict[int, _PathCosts], taken: Sequence[np.ndarray]
    ) -> Choice | None:
        """The best candidate of a robot; paths are searched, and stored, no farther than is needed."""
        pose = view.pose if robot == view.robot else view.teammates[robot].pose
        whole = float(sum(self._scenario.grid.shape))
        if robot not in path_costs:
            near = _FIRST_REACH * self.candidates.reach if self._lazy else math.inf
            path_costs[robot] = self._path_costs(pose, near if near < whole else math.inf)
        weighed = np.full(len(path_costs[robot].edges), np.nan)
        choice, sure = self._best_of(robot, path_costs[robot], taken, weighed)
        while not sure:
            farther = _EXTENSION * path_costs[robot].reach
            path_costs[robot] = self._path_costs(
                pose, farther if farther < whole else math.inf, path_costs[robot]
            )
            choice, sure = self._best_of(robot, path_costs[robot], taken, weighed)
        if choice is None and robot == view.robot and len(self.candidates.listed(all_of_them=True)[0]) > 0:
            whole_map = self._path_costs(pose, math.inf, path_costs[robot])
            everywhere = np.empty(self._scenario.grid.voxels)
            costs_to_all(self.search, everywhere)
            self.candidates.replace_unreached(everywhere)
            path_costs.clear()  # candidates have moved
            path_costs[robot] = self._path_costs(pose, math.inf, whole_map)
            weighed = np.full_like(weighed, np.nan)
            choice, _ = self._best_of(robot, path_costs[robot], taken, weighed)
        return choice

    def _best_of(
        self, robot: int, path_costs: _PathCosts, taken: Sequence[np.ndarray], weighed: np.ndarray
    ) -> tuple[Choice | None, bool]:
        """The best of the candidates that were reached, and whether none beyond can be better.

        Counts are stored in `weighed`, (B,) by slot; NaN = not counted yet.
        """
        slots, voxels = self.candidates.listed(all_of_them=not self._lazy)
        edges, point = path_costs.edges[slots], self.candidates.point
        reached = np.isfinite(edges)
        beyond = slots[~reached]
        slots, voxels, edges = slots[reached], voxels[reached], edges[reached]
        seconds = self.seconds(robot, edges)
        takes = self._taken(voxels, taken)
        most = self.candidates.upper_bounds(slots) if self._lazy else np.full(len(slots), np.inf)
        bound = self._value(most * point, seconds, edges, takes)
        order = np.argsort(-bound, kind="stable")
        value = np.full(len(slots), -np.inf)
        size = self.candidates.batch
        for first in range(0, len(order), size):
            batch = order[first : first + size]
            if self._lazy and bound[batch[0]] < value.max():
                break
            seen = self._seen(slots[batch], weighed)
            worth = self._value(seen, seconds[batch], edges[batch], takes[batch])
            value[batch] = np.where(seen > 0.0, worth, -np.inf)
        best = int(np.argmax(value)) if len(value) else -1
        choice = None
        if best >= 0 and value[best] > -np.inf:
            choice = Choice(int(slots[best]), int(voxels[best]), float(value[best]), float(seconds[best]))
        if len(beyond) == 0 or math.isinf(path_costs.reach):
            return choice, True
        return choice, choice is not None and self._none_is_better(robot, beyond, path_costs, choice, weighed)

    def _seen(self, slots: np.ndarray, weighed: np.ndarray) -> np.ndarray:
        """(K,) V·(height factor) of candidates in points' size; `weighed` as in `_best_of`."""
        new = slots[np.isnan(weighed[slots])]
        weighed[new] = self.candidates.count(new, self.candidates.voxels_of(new))
        self.counted += len(new)
        return weighed[slots] * self.candidates.point

    def _none_is_better(
        self, robot: int, slots: np.ndarray, path_costs: _PathCosts, choice: Choice, weighed: np.ndarray
    ) -> bool:
        """Whether no candidate beyond the search's reach can have the value of one that was found.

        Its path is longer than the reach, and than the straight line. The most promising ones are counted,
        since that takes less time than a longer search; `weighed` as in `_best_of`.
        """
        apart = np.linalg.norm(self._places(self.candidates.voxels_of(slots)) - path_costs.start, axis=1)
        edges = np.maximum(path_costs.reach, apart - 2.0)  # paths lead from centre to centre
        seconds, none_taken = self.seconds(robot, edges), np.zeros(len(slots))
        most = self.candidates.upper_bounds(slots)
        bound = self._value(most * self.candidates.point, seconds, edges, none_taken)
        better = np.flatnonzero(bound >= choice.value)
        order, size = better[np.argsort(-bound[better], kind="stable")], self.candidates.batch
        for first in range(0, len(order), size):
            batch = order[first : first + size]
            seen = self._seen(slots[batch], weighed)
            worth = self._value(seen, seconds[batch], edges[batch], none_taken[batch])
            if (worth[seen > 0.0] >= choice.value).any():
                return False
        return True

    def seconds(self, robot: int, edges: np.ndarray) -> np.ndarray:
        """(K,) seconds of the drives along paths of these lengths, and of the scans at their stops."""
        kind = self._scenario.kind_of(robot)
        length_m = edges * self._edge
        stops = np.maximum(np.ceil(length_m / kind.robot.reach_m), 1.0)
        hops_s = np.empty(len(edges))
        fill_driving_times(length_m / stops, kind.robot.max_speed_m_s, kind.robot.acceleration_m_s2, hops_s)
        return stops * (hops_s + kind.sensor.scan_time_s)

    def _taken(self, voxels: np.ndarray, taken: Sequence[np.ndarray]) -> np.ndarray:
        """(K,) Σ over targets of P(d) = 1 - d/range, within the range (Burgard 2005, eq. 6)."""
        places = self._places(voxels)
        total = np.zeros(len(voxels))
        for target in taken:
            apart = np.linalg.norm(places - target[:3], axis=1)
            total += np.maximum(1.0 - apart / self.candidates.reach, 0.0)
        return total

    def _places(self, voxels: np.ndarray) -> np.ndarray:
        """(K, 3) centres of (K,) voxels, grid units."""
        return np.stack(np.unravel_index(voxels, self._scenario.grid.shape), axis=-1) + 0.5


@lean_kernel
def ask_costs(search: Search, voxels: np.ndarray, reach: float, out: np.ndarray) -> None:
    """Fill (K,) with the costs of (K,) voxels in the latest search, inf above the reach; skips NONE."""
    for place in range(len(voxels)):
        if voxels[place] >= 0:
            cost = cost_to(search, voxels[place])
            out[place] = cost if cost <= reach else math.inf


@lean_kernel
def fill_driving_times(
    lengths_m: np.ndarray, max_speed_m_s: float, acceleration_m_s2: float, out: np.ndarray
) -> None:
    """Fill (K,) with the seconds of drives from rest to rest; inf for infinite lengths."""
    for place in range(len(lengths_m)):
        out[place] = math.inf
        if lengths_m[place] < math.inf:
            out[place] = driving_time(lengths_m[place], max_speed_m_s, acceleration_m_s2)


def _value_of(choice: Choice | None) -> float:
    return -math.inf if choice is None else choice.value
