"""The strategy `per-time-visibility` (Sawhney, Krishna & Srinathan 2009), and what frontier strategies share.

A robot goes to the frontier candidate with the most new visibility V per time t of travel and scan, V/t, or
by the metric V - βt of earlier work; over terrain V is multiplied by (z_f - z_av)^γ z_f^(1 - γ) (sect. 3.3)
in both. V is in m² of plan or ground (in 3-D without an exposure surface m³; over terrain with the height
factor m³, heights in metres), t in seconds: β is in these units a second.

Ours, where the paper says nothing:

- There is one candidate per block of the map.
- A place from which a robot has scanned is no longer its candidate, so that slivers which its rays miss do
  not stop it.
- A robot without candidates waits and scans while teammates are under way, and makes room for one whose
  body touches its own. Then a finer σ counts as explored, half the one before, down to the mission's σ_end,
  since a mission may require more than having seen everything once. If nothing is left at that level either,
  the robot goes to random viewpoints.
- A robot that cannot get to its candidate twice in a row goes to a random viewpoint. If teammates' bodies
  stop it again after that, it makes room, for longer the more often that happens.
- A robot makes room by going to a place to which its path is shorter than its teammates' paths: so in a row
  in which none can pass the last one moves first. If there is no such place it goes to a random viewpoint.
- Robots that drive straight, or no farther than a reach, stop and scan at corners. t does not include these
  stops, and they first promise to see what is visible from there.
- V is counted all around; a sensor that looks one way is turned to where most of it lies.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np

from baselines.strategies.allocation import Allocator, Choice, Value
from baselines.strategies.protocol import random_viewpoint
from entropy_explore_env.belief.paths.search import extract_path, new_search
from entropy_explore_env.belief.paths.string_pulling import string_pulled
from entropy_explore_env.errors import SettingError
from entropy_explore_env.frontiers.blocks import NONE
from entropy_explore_env.frontiers.frontier_map import FrontierConfig
from entropy_explore_env.frontiers.knowledge import stays, teammates_that_share, under_way
from entropy_explore_env.missions.view import RobotView
from entropy_explore_env.robots.motion import MoveEnd
from entropy_explore_env.scenario import Scenario
from entropy_explore_env.validation import check, check_choice, check_kind, check_not_negative

Allocation = Literal["asynchronous", "synchronous"]
_WITHIN_REACH = 0.999
"""Share of the reach that is used, so that rounding never moves a place towards the robot."""
_MOST_PARTING = 4
"""Most decisions for which a robot makes room after a block."""
_TOUCHING = 1.0
"""Voxel edges: bodies that are no farther apart touch."""
_DELAY = 1.5
"""Others may be under way this many times the estimated time, which does not include stops at corners."""
_EARLY = (
    MoveEnd.OBSTACLE,
    MoveEnd.GROUND,
    MoveEnd.CEILING,
    MoveEnd.EDGE,
    MoveEnd.WALL,
    MoveEnd.TEAMMATE,
    MoveEnd.NO_PATH,
)


@dataclass(frozen=True)
class Metric:
    """V/t, or V - βt; or (V + bonus)/t, a finishing rule of ours.

    Attributes:
        beta: β; None = V/t.
        bonus: Value of any frontier in addition to V, in V's units: slivers nearby are then explored in
            passing instead of at the end. 0 = the paper's metric.

    Raises:
        SettingError: One of them is no number that is allowed.
    """

    beta: float | None = None
    bonus: float = 0.0

    def __post_init__(self) -> None:
        """Check both."""
        if self.beta is not None:
            check(self, "beta", "None, or a number ≥ 0", lambda v: 0.0 <= v < math.inf)
        check_not_negative(self, "bonus")

    def __call__(
        self, seen: np.ndarray, seconds: np.ndarray, edges: np.ndarray, taken: np.ndarray
    ) -> np.ndarray:
        """See `Value`."""
        del edges, taken
        worth = seen + self.bonus
        return worth / seconds if self.beta is None else worth - self.beta * seconds


@dataclass(frozen=True)
class ExplorationConfig:
    """How robots choose frontiers.

    Attributes:
        metric: The values of candidates.
        allocation: Whether robots choose when they stop, or all together.
        promises: Whether points that teammates announced to see have less weight.
        frontiers: Where candidates lie and what is seen from them.
        finest_sigma: The last σ that counts as explored, no more than that of `frontiers`; None = the
            mission's σ_end.
        lazy: Whether V is counted only as far as a choice needs; the results are the same.

    Raises:
        SettingError: A field has another value.
    """

    metric: Value = field(default_factory=Metric)
    allocation: Allocation = "asynchronous"
    promises: bool = True
    frontiers: FrontierConfig = field(default_factory=FrontierConfig)
    finest_sigma: float | None = None
    lazy: bool = True

    def __post_init__(self) -> None:
        """Check every field."""
        if isinstance(self.metric, type) or not callable(self.metric):
            raise SettingError("ExplorationConfig.metric", self.metric, "a Metric, or another Value")
        check_choice(self, "allocation", Allocation)
        check_kind(self, "promises", bool)
        check_kind(self, "frontiers", FrontierConfig)
        check_kind(self, "lazy", bool)
        if self.finest_sigma is not None:
            allowed = "None, or a number above 0 and no more than frontiers.sigma"
            check(self, "finest_sigma", allowed, lambda v: 0.0 < v <= self.frontiers.sigma)


@dataclass
class _Assignment:
    """What a robot remembers from one decision to the next."""

    stops: list[np.ndarray] = field(default_factory=list)
    """(3,) places on the path to its target that are still ahead, map frame."""
    target: int = -1
    """Voxel to scan from; -1 = none."""
    departed_s: float = 0.0
    """When it left for its latest target."""
    arrived_s: float = 0.0
    """When it had scanned at its latest target."""
    trips: int = 0
    """Number of targets for which it left."""
    failures: int = 0
    """Consecutive drives that ended early."""
    detours: int = 0
    """How often it went elsewhere after such drives since it last got to where it wanted."""
    parting: int = 0
    """Decisions for which it still makes room for teammates."""
    scanned: bool = False
    """Whether it has taken its first scan."""
    level: float = 0.0
    """σ that counts as explored."""
    plan: dict[int, tuple[np.ndarray, float]] = field(default_factory=dict)
    """Estimated targets (3,), map frame, of the others when it chose its own, and their arrival times."""


class Trip(NamedTuple):
    """A completed drive to a target and the scan there."""

    robot: int
    number: int
    """Of the robot's trips, from 1."""
    seconds: float
    ended_s: float


class FrontierStrategy:
    """Goes to frontier candidates by a metric; see `ExplorationConfig`.

    Attributes:
        config: The settings.
        idle: Robot by robot, whether it found nothing unexplored at its latest decision, at its first level.
        trips: The completed trips of this mission.
    """

    def __init__(self, config: ExplorationConfig | None = None) -> None:
        """Take the settings; None = the defaults.

        Raises:
            SettingError: The settings are of another type.
        """
        if not isinstance(config, ExplorationConfig | None):
            raise SettingError("config", config, "None, or an ExplorationConfig")
        self.config = config or ExplorationConfig()

    def reset(self, scenario: Scenario, rng: np.random.Generator) -> None:
        """A new mission begins."""
        self._scenario, self._rng = scenario, rng
        sigma = self.config.frontiers.sigma
        self._assignments = [_Assignment(level=sigma) for _ in range(scenario.robots)]
        self._allocators: dict[int, Allocator] = {}
        self._search = new_search(scenario.grid.voxels)
        finest = self.config.finest_sigma
        self._finest = min(scenario.ending.sigma_end if finest is None else finest, sigma)
        self.idle = [False] * scenario.robots
        self.trips = list[Trip]()

    def choose(self, views: Sequence[RobotView]) -> list[np.ndarray]:
        """(5,) viewpoint of each view, map frame, by its own belief and what it has heard."""
        return [self._choose(view) for view in views]

    def mapped_share(self) -> float:
        """Share of the points in the map of a robot that knows most of them: of columns over terrain."""
        return max(
            (allocator.candidates.mapped_share() for allocator in self._allocators.values()), default=0.0
        )

    def allocator_of(self, robot: int) -> Allocator:
        """The candidates of a robot, and their allocation; available after its first choice."""
        return self._allocators[robot]

    def counted(self) -> int:
        """How many times V was counted in this mission."""
        return sum(allocator.counted for allocator in self._allocators.values())

    def _choose(self, view: RobotView) -> np.ndarray:
        assignment, allocator = self._assignments[view.robot], self._allocator(view)
        if not assignment.scanned:
            assignment.scanned = True
            return self._gazing(view, allocator, view.pose[:3])
        self._finish_drive(view, assignment, allocator)
        if assignment.failures > 1:  # the same belief would lead to the same choice
            assignment.failures, assignment.stops, assignment.target = 0, [], -1
            assignment.detours += 1
            stopped = view.move_end is MoveEnd.TEAMMATE
            assignment.parting = min(assignment.detours - 1, _MOST_PARTING) if stopped else 0
            if assignment.parting == 0:
                return random_viewpoint(view, self._rng)
        if assignment.parting > 0:
            assignment.parting -= 1
            return self._making_room(view, allocator)
        if assignment.stops:
            return self._onward(view, assignment, allocator)
        if self.config.allocation == "synchronous" and self._others_are_busy(view, assignment):
            return self._gazing(view, allocator, view.pose[:3])
        choice = self._choice_of(view, assignment, allocator)
        if choice is None:
            busy = [mate for mate in view.teammates if self._under_way(view, mate)]
            if any(self._touches(view, mate) for mate in busy):
                return self._making_room(view, allocator)
            if busy or self._finest >= self.config.frontiers.sigma:
                return self._gazing(view, allocator, view.pose[:3])
            return random_viewpoint(view, self._rng)
        assignment.target, assignment.departed_s = choice.voxel, view.time_s
        assignment.trips += 1
        assignment.stops = self._stops_to(view, allocator, choice.voxel)
        return self._onward(view, assignment, allocator)

    def _allocator(self, view: RobotView) -> Allocator:
        """The robot's allocator, made at its first choice: the exposure surface is not known before."""
        if view.robot not in self._allocators:
            config = self.config
            self._allocators[view.robot] = Allocator(
                self._scenario,
                view.kind,
                config.frontiers,
                config.metric,
                self._search,
                view.ceiling,
                config.lazy,
            )
        return self._allocators[view.robot]

    def _finish_drive(self, view: RobotView, assignment: _Assignment, allocator: Allocator) -> None:
        """Update the candidates and the assignment after a drive and its scan."""
        allocator.candidates.update(view, assignment.level)
        early = view.move_end in _EARLY and assignment.target >= 0
        assignment.failures = assignment.failures + 1 if early else 0
        if assignment.target >= 0 and not early:
            assignment.detours = 0
        away = bool(assignment.stops) and _apart_m(view, assignment.stops[0]) > view.kind.robot.reach_m
        if early or away:
            assignment.stops = []
        if early and view.move_end is not MoveEnd.TEAMMATE:  # it cannot be reached, whatever the belief says
            allocator.candidates.exclude(assignment.target)
        if assignment.target >= 0 and not assignment.stops:
            assignment.arrived_s = view.time_s
            self.trips.append(
                Trip(view.robot, assignment.trips, view.time_s - assignment.departed_s, view.time_s)
            )
            allocator.candidates.exclude(allocator.start_of(view.pose))
            assignment.target = -1

    def _touches(self, view: RobotView, mate: int) -> bool:
        """Whether a teammate's body touched the robot's where it was heard last."""
        seen, grid = view.teammates[mate], self._scenario.grid
        bodies_m = view.kind.robot.body_radius_m + self._scenario.kind_of(mate).robot.body_radius_m
        apart_m = _apart_m(view, seen.pose[:3])
        return seen.heard_s >= 0.0 and apart_m <= bodies_m + _TOUCHING * grid.voxel_size_m

    def _making_room(self, view: RobotView, allocator: Allocator) -> np.ndarray:
        """The viewpoint at a place away from teammates, or at a stop on the path there."""
        away = allocator.away_from(view, self._rng)
        if away == NONE:
            return random_viewpoint(view, self._rng)
        return self._gazing(view, allocator, self._stops_to(view, allocator, away)[0])

    def _under_way(self, view: RobotView, mate: int) -> bool:
        seen = view.teammates[mate]
        return under_way(view, seen, mate) and not stays(view, seen)

    def _others_are_busy(self, view: RobotView, assignment: _Assignment) -> bool:
        """Whether a teammate has not scanned at its target yet.

        It has if it waits, or if it left after the robot arrived, since it had waited for all others then.
        Where robots stop at corners, leaving a corner looks like leaving for a new target. There a teammate
        has to stand at the target that the robot estimated, or its time for the drive has to be over. The
        estimate may be wrong, as robots do not know from where others have scanned.
        """
        for mate, seen in view.teammates.items():
            if seen.announced_s < 0.0 or stays(view, seen):
                continue
            left_later = seen.announced_s >= assignment.arrived_s
            if self._under_way(view, mate) and not left_later:
                return True
            robot = self._scenario.kind_of(mate).robot
            at_once = robot.navigator == "planned" and math.isinf(robot.reach_m)
            if mate in assignment.plan and not at_once:
                target, due_s = assignment.plan[mate]
                apart_m = np.linalg.norm(seen.pose[:3] - target)
                if apart_m > 1.5 * self._scenario.grid.voxel_size_m and view.time_s < due_s:
                    return True
                del assignment.plan[mate]  # it has been there: now it is on its way to its next target
        return False

    def _choice_of(self, view: RobotView, assignment: _Assignment, allocator: Allocator) -> Choice | None:
        """The robot's candidate; if there is none, a finer σ counts as explored."""
        known = {mate: seen for mate, seen in teammates_that_share(view).items() if seen.heard_s >= 0.0}
        together = self.config.allocation == "synchronous"
        moving = [] if together else [mate for mate in known if self._under_way(view, mate)]
        grid = self._scenario.grid
        targets = [grid.in_grid_units(known[mate].viewpoint)[:3] for mate in moving]
        stopped = [mate for mate in known if mate not in moving]
        if not self.config.promises:
            targets, stopped = [], []
        while True:
            plan = allocator.allocate(view, stopped, targets, everybody=together)
            choice = plan.get(view.robot)
            assignment.plan = {
                mate: (self._place(view, other.voxel), view.time_s + _DELAY * other.seconds)
                for mate, other in plan.items()
            }
            if assignment.level >= self.config.frontiers.sigma:
                self.idle[view.robot] = choice is None
            if choice is not None or assignment.level <= self._finest:
                return choice
            if any(self._under_way(view, mate) for mate in known):
                return None
            assignment.level = max(0.5 * assignment.level, self._finest)
            allocator.candidates.readmit()
            allocator.candidates.update(view, assignment.level)

    def _place(self, view: RobotView, voxel: int) -> np.ndarray:
        """(3,) a voxel's centre in the map frame; of planar robots at their sensor's height."""
        grid = self._scenario.grid
        place = grid.centre_of(np.stack(np.unravel_index(voxel, grid.shape)))
        if view.planar:
            place[2] = view.pose[2]
        return place

    def _stops_to(self, view: RobotView, allocator: Allocator, voxel: int) -> list[np.ndarray]:
        """Stops on the path to a voxel, none farther from the one before than the robot reaches."""
        grid, robot = self._scenario.grid, view.kind.robot
        goal = self._place(view, voxel)
        if robot.navigator == "planned" and math.isinf(robot.reach_m):
            return [goal]
        allocator.search_path(view.pose, voxel)
        search, lattice = allocator.search, allocator.lattice
        path = np.empty(extract_path(search, lattice, voxel, np.empty(0, np.int32)), np.int32)
        if extract_path(search, lattice, voxel, path) == 0:
            return [goal]
        start = grid.in_grid_units(view.pose)[:3]
        end = np.stack(np.unravel_index(voxel, grid.shape)) + 0.5
        if lattice.layer >= 0:
            end[2] = start[2]
        points = string_pulled(search, lattice, allocator.costs, path, start, end)
        reach = min(robot.reach_m * _WITHIN_REACH / grid.voxel_size_m, float(sum(grid.shape)))
        stops, at = [], start
        for point in points:
            hops = max(1, math.ceil(float(np.linalg.norm(point - at)) / reach))
            stops += [at + (point - at) * (hop + 1) / hops for hop in range(hops)]
            at = point
        return [np.asarray(grid.origin_m) + stop * grid.voxel_size_m for stop in stops] or [goal]

    def _onward(self, view: RobotView, assignment: _Assignment, allocator: Allocator) -> np.ndarray:
        """The viewpoint at the next stop."""
        return self._gazing(view, allocator, assignment.stops.pop(0))

    def _gazing(self, view: RobotView, allocator: Allocator, place: np.ndarray) -> np.ndarray:
        """(5,) the viewpoint at a place (3,), with the gaze in which most is seen."""
        viewpoint = view.pose.copy()
        viewpoint[: 2 if view.planar else 3] = place[: 2 if view.planar else 3]
        grid_place = self._scenario.grid.in_grid_units(viewpoint)[:3]
        viewpoint[3:] = allocator.candidates.gaze(grid_place, view)
        return viewpoint


def _apart_m(view: RobotView, place: np.ndarray) -> float:
    """Straight distance from a robot to a place (3,), map frame."""
    axes = 2 if view.planar else 3
    return float(np.linalg.norm(place[:axes] - view.pose[:axes]))
