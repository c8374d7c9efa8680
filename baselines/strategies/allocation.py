"""Which robot goes to which candidate, and by which metric: settings and allocation of `per-time-visibility`.

    per-time       V/t, or V - βt; or (V + bonus)/t, a finishing rule of ours
    nearest        the shortest path (Yamauchi 1998)
    coordinated    1 - Σ P(d) - β·length, with P(d) = 1 - d/range within the range of a frontier that another
                   robot goes to, and β = 0.01 (Burgard et al. 2005, eqs. 5-7, who find 0.01 … 50 alike)

The rules of the last two papers as their authors run them are `nearest-frontier` and `coordinated-frontier`.

The pair of a robot and a candidate with the greatest value is allocated first (Sawhney 2009, sect. 3.2). The
points that are seen from there count as promised, and the next pair is chosen by what remains. Asynchronously
only stopped robots take part, and the promises of others hold until they have scanned; synchronously all
wait for each other. Each robot allocates by its own belief and the messages that reached it: with perfect
messages that is the paper's central procedure. Teammates are assumed to have the robot's own sensor and body.
A robot counts as stopped if it was heard since it announced its latest viewpoint, that is, its scan arrived;
or if nothing was heard of it for longer than any drive takes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from baselines.strategies.rules.coordinated_frontier import taken
from entropy_explore_env.frontiers.frontier_map import FrontierConfig
from entropy_explore_env.frontiers.knowledge import centres_of, stays, under_way, voxel_of
from entropy_explore_env.planner.scene import Scene
from entropy_explore_env.planner.stops import apart_m
from entropy_explore_env.robots.knowledge import RobotKnowledge
from entropy_explore_env.robots.motion import driving_time
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.settings.validation import check, check_choice, check_kind, check_not_negative

Metric = Literal["per-time", "nearest", "coordinated"]
Allocation = Literal["asynchronous", "synchronous"]
_COORDINATED_BETA = 0.01


@dataclass(frozen=True)
class ExplorationConfig:
    """How robots choose frontiers.

    Attributes:
        metric: The values of candidates: see the top of the file.
        beta: β of `per-time`; None = V/t.
        bonus: Value of any frontier in addition to V of `per-time`, in V's units: slivers nearby are then
            explored in passing instead of at the end. 0 = the paper's metric.
        allocation: Whether robots choose when they stop, or all together.
        promises: Whether points that teammates announced to see have less weight.
        frontiers: Where candidates lie and what is seen from them.
        once: Whether no finer σ counts as explored where no candidate is left: robots wait then.
    """

    metric: Metric = "per-time"
    beta: float | None = None
    bonus: float = 0.0
    allocation: Allocation = "asynchronous"
    promises: bool = True
    frontiers: FrontierConfig = field(default_factory=FrontierConfig)
    once: bool = False

    def __post_init__(self) -> None:
        """Check every field."""
        check_choice(self, "metric")
        if self.beta is not None:
            check(self, "beta", "None, or a number ≥ 0", lambda v: 0.0 <= v < math.inf)
        check_not_negative(self, "bonus")
        check_choice(self, "allocation")
        check_kind(self, "promises", bool)
        check_kind(self, "frontiers", FrontierConfig)
        check_kind(self, "once", bool)

    def values(
        self, seen: np.ndarray, seconds: np.ndarray, edges: np.ndarray, taken: np.ndarray
    ) -> np.ndarray:
        """Return the values (K,) of candidates: never greater for less V, or for a longer path.

        Args:
            seen: (K,) V·(height factor) in points' size.
            seconds: (K,) of the drives, and of the scans at their stops.
            edges: (K,) lengths of the paths in voxel edges.
            taken: (K,) Σ P(d) ≥ 0.
        """
        if self.metric == "nearest":
            return -edges
        if self.metric == "coordinated":
            return 1.0 - taken - _COORDINATED_BETA * edges
        worth = seen + self.bonus
        return worth / seconds if self.beta is None else worth - self.beta * seconds


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


class Allocator:
    """Allocates the candidates of one robot's map, at one of its decisions."""

    def __init__(self, scene: Scene, config: ExplorationConfig) -> None:
        """Take what the robot knows, and the settings."""
        self._view, self._candidates, self._paths = scene.view, scene.cells, scene.paths
        self._centres, self._grid, self._config = scene.centres, scene.view.scenario.grid, config
        self._lengths: dict[int, np.ndarray] = {}
        """Robot → (V,) lengths of its paths to all voxels, in voxel edges."""

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
        self._candidates.replace_unreached(self._lengths_from(robot))
        return self._best_listed(robot, targets)

    def _best_listed(self, robot: int, targets: Sequence[np.ndarray]) -> Choice | None:
        """Return the best of a robot's candidates; None where it reaches none that shows anything."""
        voxels = self._candidates.listed()
        edges = self._lengths_from(robot)[voxels]
        voxels, edges = voxels[np.isfinite(edges)], edges[np.isfinite(edges)]
        if len(voxels) == 0:
            return None
        places, takes = self._centres(voxels), np.zeros(len(voxels))
        for target in targets:
            takes += taken(places, target[:3], self._candidates.reach)
        seconds = seconds_of(self._view.scenario, robot, edges)

        def worth(seen: np.ndarray, which: np.ndarray) -> np.ndarray:
            options = seen * self._candidates.point, seconds[which], edges[which], takes[which]
            return np.where(seen > 0.0, self._config.values(*options), -np.inf)

        value = self._candidates.worths(voxels, worth)
        best = int(np.argmax(value))
        if value[best] == -math.inf:
            return None
        return Choice(int(voxels[best]), float(value[best]), float(seconds[best]))

    def _lengths_from(self, robot: int) -> np.ndarray:
        """Return (V,) lengths of a robot's paths to all voxels; inf = no path."""
        if robot not in self._lengths:
            self._paths.start(self._voxel_of(robot))
            self._paths.extend(math.inf)
            self._lengths[robot] = self._paths.lengths_to(np.arange(self._grid.voxels, dtype=np.int32))
        return self._lengths[robot]

    def _voxel_of(self, robot: int) -> int:
        """Return the voxel in which a robot was when it was last heard, in the layer of planar robots."""
        view = self._view
        return voxel_of(view, view.pose if robot == view.robot else view.teammates[robot].pose)


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
