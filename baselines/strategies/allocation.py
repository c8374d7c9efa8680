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
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import NamedTuple

import numpy as np

from baselines.strategies.metrics import Options, Value
from baselines.strategies.rules.coordinated_frontier import taken
from entropy_explore_env.frontiers.knowledge import centres_of, stays, under_way, voxel_of
from entropy_explore_env.planner.scene import Scene
from entropy_explore_env.planner.stops import apart_m
from entropy_explore_env.robots.knowledge import RobotKnowledge
from entropy_explore_env.robots.motion import driving_time
from entropy_explore_env.settings.scenario import Scenario

_FIRST_REACH = 0.25
"""Paths are searched so far at first, in sensor ranges: most choices are nearer, and a search over a whole
range costs more than counting the few candidates beyond that could be better."""
_EXTENSION = 1.4
"""Then they are searched this many times as far until that is enough."""
_driving_times = np.vectorize(driving_time, otypes=[float])
_DELAY = 1.5
"""Others may be under way this many times the estimated time, which does not include stops at corners."""


@dataclass(frozen=True)
class Choice:
    """A candidate that was allocated to a robot."""

    voxel: int
    """The voxel in which it lies."""
    value: float
    """By the metric."""
    seconds: float
    """Of travel and scan."""


class _Lengths(NamedTuple):
    """Lengths of a robot's paths to candidates."""

    reach: float
    """Up to which length they were searched, in voxel edges."""
    edges: np.ndarray
    """(S,) float64, by the candidates' slots; inf = no path up to that length."""


class Allocator:
    """Allocates the candidates of one robot's map, at one of its decisions."""

    def __init__(self, scene: Scene, value: Value) -> None:
        """Take what the robot knows, and the metric."""
        self._view, self._candidates, self._paths = scene.view, scene.cells, scene.paths
        self._centres, self._grid, self._value = scene.centres, scene.view.scenario.grid, value
        self._lengths: dict[int, _Lengths] = {}
        self._searched = scene.view.robot
        """The robot of the latest search."""

    def allocate(
        self, stopped: Sequence[int], targets: Sequence[np.ndarray], everybody: bool = False
    ) -> dict[int, Choice]:
        """Allocate candidates to the robot and to those that come before it.

        Args:
            stopped: Teammates that are allocated something at the same time.
            targets: (3,) places in grid units to which others are under way.
            everybody: Whether the allocation continues after this robot's turn.

        Returns:
            Robot → candidate. The robot is missing if from no candidate that it reaches anything unexplored
            can be seen.
        """
        aims = list(targets)
        for target in targets:
            self._candidates.promise(target)
        unassigned, found = [self._view.robot, *sorted(stopped)], dict[int, Choice]()
        while unassigned:
            choices = {robot: self._best(robot, aims) for robot in unassigned}
            best = max(sorted(unassigned), key=lambda robot: _value_of(choices[robot]))
            choice = choices[best]
            if choice is None:
                break
            found[best] = choice
            unassigned.remove(best)
            if best == self._view.robot and not everybody:
                break
            place = self._centres(np.array([choice.voxel]))[0]
            self._candidates.promise(place)
            aims.append(place)
        self._candidates.release()
        return found

    def _best(self, robot: int, targets: Sequence[np.ndarray]) -> Choice | None:
        """Return a robot's best candidate; if it has none, after those that no path reaches are replaced."""
        choice = self._best_listed(robot, targets)
        if choice is not None or robot != self._view.robot:
            return choice
        if len(self._candidates.listed(all_of_them=True)[0]) == 0:
            return None
        self._search(robot, math.inf)
        everywhere = self._paths.lengths_to(np.arange(self._grid.voxels, dtype=np.int32))
        self._candidates.replace_unreached(everywhere)
        self._lengths.clear()  # candidates have moved
        return self._best_listed(robot, targets)

    def _best_listed(self, robot: int, targets: Sequence[np.ndarray]) -> Choice | None:
        """Return the best of a robot's candidates, counting V and searching paths only as far as that needs.

        A candidate beyond the search has at most the value that it has for the shortest path that is still
        possible. While it is the best by that, paths are searched farther.
        """
        slots, voxels = self._candidates.listed()
        if robot not in self._lengths:
            self._search(robot, _FIRST_REACH * self._candidates.reach)
        start, places = self._centres(np.array([self._voxel_of(robot)])), self._centres(voxels)
        apart, takes = np.linalg.norm(places - start, axis=1), np.zeros(len(slots))
        for target in targets:
            takes += taken(places, target[:3], self._candidates.reach)
        counted = np.full(len(slots), np.nan)
        while True:
            reach, edges = self._lengths[robot].reach, self._lengths[robot].edges[slots]
            if math.isinf(reach):
                near = np.flatnonzero(np.isfinite(edges))
                slots, voxels, edges, apart = slots[near], voxels[near], edges[near], apart[near]
                takes, counted = takes[near], counted[near]
            if len(slots) == 0:
                return None
            least = np.where(np.isfinite(edges), edges, np.maximum(reach, apart - 2.0))  # centre to centre
            seconds = seconds_of(self._view.scenario, robot, least)
            worth = partial(self._worth, Options(counted, seconds, least, takes))
            value = self._candidates.worths(slots, voxels, counted, worth)
            best = int(np.argmax(value))
            if value[best] == -math.inf:
                return None
            if math.isfinite(edges[best]):
                return Choice(int(voxels[best]), float(value[best]), float(seconds[best]))
            self._search(robot, _EXTENSION * reach)

    def _worth(self, options: Options, seen: np.ndarray, which: np.ndarray) -> np.ndarray:
        """Return (N,) values of some options from which (N,) points are seen; -inf where nothing is."""
        seen_of = Options(seen * self._candidates.point, *(array[which] for array in options[1:]))
        return np.where(seen > 0.0, self._value(seen_of), -np.inf)

    def _search(self, robot: int, reach: float) -> None:
        """Search a robot's paths up to a length, and keep the lengths of those that lead to candidates."""
        if self._searched != robot:
            self._paths.start(self._voxel_of(robot))
            self._searched = robot
        farthest = float(sum(self._grid.shape))
        self._paths.extend(reach if reach < farthest else math.inf)
        slots, voxels = self._candidates.listed(all_of_them=True)
        lengths = self._paths.lengths_to(voxels)
        edges = np.full(len(self._candidates.voxels_of(slice(None))), np.inf)
        edges[slots] = np.where(lengths <= self._paths.reach, lengths, np.inf)
        self._lengths[robot] = _Lengths(self._paths.reach, edges)

    def _voxel_of(self, robot: int) -> int:
        """Return the voxel in which a robot was when it was last heard, in the layer of planar robots."""
        view = self._view
        voxel = voxel_of(view, view.pose if robot == view.robot else view.teammates[robot].pose)
        layer, layers = self._paths.lattice.layer, self._grid.shape[2]
        return voxel if layer < 0 else voxel - voxel % layers + layer


def seconds_of(scenario: Scenario, robot: int, edges: np.ndarray) -> np.ndarray:
    """Return (K,) seconds of a robot's drives along paths of (K,) voxel edges, and of the scans at stops."""
    kind = scenario.kind_of(robot)
    length_m = edges * scenario.grid.voxel_size_m
    stops = np.maximum(np.ceil(length_m / kind.robot.reach_m), 1.0)
    hops_s = _driving_times(length_m / stops, kind.robot.max_speed_m_s, kind.robot.acceleration_m_s2)
    return stops * (hops_s + kind.sensor.scan_time_s)


@dataclass
class Round:
    """What a robot of a synchronous team remembers of its latest drive, to know whether others end theirs."""

    arrived_s: float = 0.0
    """When it had scanned at its latest candidate."""
    left: bool = False
    """Whether it has left for a candidate since then."""
    plan: dict[int, tuple[np.ndarray, float]] = field(default_factory=dict)
    """Estimated targets (3,), map frame, of the others when it chose its own, and their arrival times."""

    def arrive(self, view: RobotKnowledge) -> None:
        """Note that the robot chooses anew, if it had left."""
        if self.left:
            self.arrived_s, self.left = view.time_s, False

    def leave(self, view: RobotKnowledge, found: dict[int, Choice]) -> None:
        """Note what was allocated to the robot and to others."""
        self.left = view.robot in found
        self.plan = {
            mate: (centres_of(view, choice.voxel), view.time_s + _DELAY * choice.seconds)
            for mate, choice in found.items()
        }

    def over(self, view: RobotKnowledge) -> bool:
        """Return whether all teammates have scanned at their targets.

        A teammate has if it waits, or if it left after the robot arrived, since it had waited for all others
        then. Where robots stop at corners, leaving a corner looks like leaving for a new target. There a
        teammate has to stand at the target that the robot estimated, or the time for its drive has to be
        over. The estimate may be wrong, as robots do not know from where others have scanned.
        """
        axes = 2 if view.planar else 3
        for mate, seen in view.teammates.items():
            if seen.announced_s < 0.0 or stays(view, seen):
                continue
            if seen.announced_s < self.arrived_s and under_way(view, seen, mate):
                return False
            robot = view.scenario.kind_of(mate).robot
            at_once = robot.navigator == "planned" and math.isinf(robot.reach_m)
            if mate in self.plan and not at_once:
                target, due_s = self.plan[mate]
                apart_m = float(np.linalg.norm(seen.pose[:axes] - target[:axes]))
                if apart_m > 1.5 * view.scenario.grid.voxel_size_m and view.time_s < due_s:
                    return False
                del self.plan[mate]  # it has been there: now it is on its way to its next target
        return True


def _value_of(choice: Choice | None) -> float:
    return -math.inf if choice is None else choice.value


def bodies_touch(view: RobotKnowledge, mate: int) -> bool:
    """Return whether a teammate's body was last heard to be no farther than a voxel edge from the robot's."""
    scenario, apart = view.scenario, apart_m(view, view.teammates[mate].pose)
    bodies_m = view.kind.robot.body_radius_m + scenario.kind_of(mate).robot.body_radius_m
    return apart <= bodies_m + scenario.grid.voxel_size_m
