"""The strategy `per-time-visibility` (Sawhney, Krishna & Srinathan 2009), and what others of frontiers share.

A robot goes to the frontier candidate that promises most new visibility V per time t of travel and scan, V/t,
or by the rivals' metric V - βt; over terrain V is multiplied by (z_f - z_av)^γ z_f^(1 - γ) (sect. 3.3), in
both. V is in m² of plan or ground (in 3-D without an exposure surface m³; over terrain with the height factor
m³, heights in metres), t in seconds: β is in these units a second.

Ours, where the paper says nothing: candidates are sampled one to a block; a place from which a robot has
scanned is no candidate of it any more, so that slivers that its rays miss do not hold it; where nothing is
left while teammates are under way it waits, scanning; and then a finer σ counts as explored, half the one
before, until the mission's σ_end: a mission may ask for more than having seen everything once. Where nothing
is left at that level either, it goes to random viewpoints. Robots that drive straight, or no farther than a
reach, stop and scan at corners, which t does not count, and promise what they see from there first. V is what
is seen all around; a sensor that looks one way is turned to where most of it lies.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np

from baselines.strategies.frontier.allocation import Allotter, Choice, Value, stays, under_way
from baselines.strategies.frontier.candidates import Looking
from baselines.strategies.protocol import random_viewpoint
from entropy_explore_env.belief.paths.search import extract_path, new_search
from entropy_explore_env.belief.paths.string_pulling import string_pulled
from entropy_explore_env.errors import SettingError
from entropy_explore_env.missions.view import RobotView
from entropy_explore_env.robots.motion import MoveEnd
from entropy_explore_env.scenario import Scenario
from entropy_explore_env.validation import check, check_choice, check_kind, check_not_negative

Allotment = Literal["asynchronous", "synchronous"]
_NOT_QUITE = 0.999
"""Of the reach, so that rounding does not pull a place towards the robot."""
_SLACK = 1.5
"""How many times as long as reckoned others may be under way: t does not count stops at corners."""
_EARLY = (MoveEnd.OBSTACLE, MoveEnd.GROUND, MoveEnd.CEILING, MoveEnd.WALL, MoveEnd.TEAMMATE, MoveEnd.NO_PATH)


@dataclass(frozen=True)
class Metric:
    """V/t, or V - βt; or (V + bonus)/t, a finishing rule of ours.

    Attributes:
        beta: β; None = V/t.
        bonus: What closing a frontier is worth besides what is seen, in V's units: slivers nearby are then
            seen to on the way, and not returned to at the end. 0 = the paper's metric.

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
class Exploring:
    """How robots share frontiers.

    Attributes:
        metric: What going to a candidate is worth.
        allotment: Whether robots choose when they stop, or all together.
        promises: Whether what teammates announced to see weighs less.
        looking: Where candidates lie and what is seen from them.
        finest_sigma: The last σ that counts as explored, no more than that of `looking`; None = the mission's
            σ_end.
        lazy: Candidates are counted only as far as is needed; the results are the same.

    Raises:
        SettingError: A field is none of these.
    """

    metric: Value = field(default_factory=Metric)
    allotment: Allotment = "asynchronous"
    promises: bool = True
    looking: Looking = field(default_factory=Looking)
    finest_sigma: float | None = None
    lazy: bool = True

    def __post_init__(self) -> None:
        """Check every field."""
        if isinstance(self.metric, type) or not callable(self.metric):
            raise SettingError("Exploring.metric", self.metric, "a Metric, or another Value")
        check_choice(self, "allotment", Allotment)
        check_kind(self, "promises", bool)
        check_kind(self, "looking", Looking)
        check_kind(self, "lazy", bool)
        if self.finest_sigma is not None:
            allowed = "None, or a number above 0 and no more than looking.sigma"
            check(self, "finest_sigma", allowed, lambda v: 0.0 < v <= self.looking.sigma)


@dataclass
class _Errand:
    """What a robot remembers from one decision to the next."""

    stops: list[np.ndarray] = field(default_factory=list)
    """(3,) places on the way to its target that are still ahead, map frame."""
    target: int = -1
    """Voxel to scan from; -1 = none."""
    departed_s: float = 0.0
    """When it left for its latest target …"""
    arrived_s: float = 0.0
    """… and when it had scanned there."""
    journeys: int = 0
    """Targets that it left for."""
    failures: int = 0
    """Drives in a row that something ended early."""
    scanned: bool = False
    """Whether it has taken its first scan."""
    level: float = 0.0
    """σ that counts as explored."""
    plan: dict[int, tuple[np.ndarray, float]] = field(default_factory=dict)
    """Where (3,), map frame, it reckoned that others were sent when it was, and when they would be there."""


class Journey(NamedTuple):
    """A way to a target and the scan there."""

    robot: int
    number: int
    """Of the robot's journeys, from 1."""
    seconds: float
    ended_s: float


class FrontierStrategy:
    """Goes to frontier candidates by a metric; see `Exploring`.

    Attributes:
        exploring: The settings.
        idle: Robot by robot, whether it found nothing unexplored at its latest decision, at its first level.
        journeys: Those of this mission that ended.
    """

    def __init__(self, exploring: Exploring | None = None) -> None:
        """Take the settings; None = the defaults.

        Raises:
            SettingError: They are something else.
        """
        if not isinstance(exploring, Exploring | None):
            raise SettingError("exploring", exploring, "None, or an Exploring")
        self.exploring = exploring or Exploring()

    def reset(self, scenario: Scenario, rng: np.random.Generator) -> None:
        """A new mission begins."""
        self._scenario, self._rng = scenario, rng
        sigma = self.exploring.looking.sigma
        self._errands = [_Errand(level=sigma) for _ in range(scenario.robots)]
        self._allotters: dict[int, Allotter] = {}
        self._search = new_search(scenario.grid.voxels)
        finest = self.exploring.finest_sigma
        self._finest = min(scenario.ending.sigma_end if finest is None else finest, sigma)
        self.idle = [False] * scenario.robots
        self.journeys = list[Journey]()

    def choose(self, views: Sequence[RobotView]) -> list[np.ndarray]:
        """(5,) viewpoint of each view, map frame, by its own belief and what it has heard."""
        return [self._choose(view) for view in views]

    def mapped_share(self) -> float:
        """Share of the points in the map of a robot that knows most of them: of columns over terrain."""
        return max((allotter.candidates.mapped_share() for allotter in self._allotters.values()), default=0.0)

    def allotter_of(self, robot: int) -> Allotter:
        """What a robot keeps of frontiers; there is none before it first chose."""
        return self._allotters[robot]

    def counted(self) -> int:
        """How many candidates were counted in this mission."""
        return sum(allotter.counted for allotter in self._allotters.values())

    def _choose(self, view: RobotView) -> np.ndarray:
        errand, allotter = self._errands[view.robot], self._allotter(view)
        if not errand.scanned:
            errand.scanned = True
            return self._gazing(view, allotter, view.pose[:3])
        self._note_drive(view, errand, allotter)
        if errand.failures > 1:  # choosing again from the same belief would lead here again
            errand.failures, errand.stops, errand.target = 0, [], -1
            return random_viewpoint(view, self._rng)
        if errand.stops:
            return self._onward(view, errand, allotter)
        if self.exploring.allotment == "synchronous" and self._others_are_busy(view, errand):
            return self._gazing(view, allotter, view.pose[:3])
        choice = self._allotted(view, errand, allotter)
        if choice is None:
            busy = any(self._under_way(view, mate) for mate in view.teammates)
            if busy or self._finest >= self.exploring.looking.sigma:
                return self._gazing(view, allotter, view.pose[:3])
            return random_viewpoint(view, self._rng)
        errand.target, errand.departed_s = choice.voxel, view.time_s
        errand.journeys += 1
        errand.stops = self._way(view, allotter, choice)
        return self._onward(view, errand, allotter)

    def _allotter(self, view: RobotView) -> Allotter:
        """That of the robot, made when it is first needed: only then the exposure surface is known."""
        if view.robot not in self._allotters:
            exploring = self.exploring
            self._allotters[view.robot] = Allotter(
                self._scenario,
                view.kind,
                exploring.looking,
                exploring.metric,
                self._search,
                view.ceiling,
                exploring.lazy,
            )
        return self._allotters[view.robot]

    def _note_drive(self, view: RobotView, errand: _Errand, allotter: Allotter) -> None:
        """Take in what the latest drive and its scan brought."""
        allotter.candidates.update(view, errand.level)
        early = view.move_end in _EARLY and errand.target >= 0
        errand.failures = errand.failures + 1 if early else 0
        away = bool(errand.stops) and _apart_m(view, errand.stops[0]) > view.kind.robot.reach_m
        if early or away:
            errand.stops = []
        if early and view.move_end is not MoveEnd.TEAMMATE:  # nobody gets there, whatever the belief says
            allotter.candidates.spend(errand.target)
        if errand.target >= 0 and not errand.stops:
            errand.arrived_s = view.time_s
            self.journeys.append(
                Journey(view.robot, errand.journeys, view.time_s - errand.departed_s, view.time_s)
            )
            allotter.candidates.spend(allotter.start_of(view.pose))
            errand.target = -1

    def _under_way(self, view: RobotView, mate: int) -> bool:
        seen = view.teammates[mate]
        return under_way(view, seen, mate) and not stays(view, seen)

    def _others_are_busy(self, view: RobotView, errand: _Errand) -> bool:
        """Whether a teammate has not scanned at its target yet.

        It has if it waits, or if it has left since the robot arrived: then it had waited for everybody. Where
        robots stop on their way, it has to stand where the robot reckoned that it was sent, or time has to be
        up for that: leaving a corner looks like leaving for a new target. As robots do not know from where
        others have scanned, they may reckon wrongly.
        """
        for mate, seen in view.teammates.items():
            if seen.announced_s < 0.0 or stays(view, seen):
                continue
            left_later = seen.announced_s >= errand.arrived_s
            if self._under_way(view, mate) and not left_later:
                return True
            robot = self._scenario.kind_of(mate).robot
            at_once = robot.navigator == "planned" and math.isinf(robot.reach_m)
            if mate in errand.plan and not at_once:
                target, due_s = errand.plan[mate]
                apart_m = np.linalg.norm(seen.pose[:3] - target)
                if apart_m > 1.5 * self._scenario.grid.voxel_size_m and view.time_s < due_s:
                    return True
                del errand.plan[mate]  # it has been there: wherever it goes now, it goes to its next target
        return False

    def _allotted(self, view: RobotView, errand: _Errand, allotter: Allotter) -> Choice | None:
        """The robot's candidate; where nothing is left a finer σ counts as explored."""
        known = {mate: seen for mate, seen in view.teammates.items() if seen.heard_s >= 0.0}
        together = self.exploring.allotment == "synchronous"
        moving = [] if together else [mate for mate in known if self._under_way(view, mate)]
        grid = self._scenario.grid
        targets = [grid.in_grid_units(known[mate].viewpoint)[:3] for mate in moving]
        stopped = [mate for mate in known if mate not in moving]
        if not self.exploring.promises:
            targets, stopped = [], []
        while True:
            plan = allotter.allot(view, stopped, targets, everybody=together)
            choice = plan.get(view.robot)
            errand.plan = {
                mate: (self._place(view, other.voxel), view.time_s + _SLACK * other.seconds)
                for mate, other in plan.items()
            }
            if errand.level >= self.exploring.looking.sigma:
                self.idle[view.robot] = choice is None
            if choice is not None or errand.level <= self._finest:
                return choice
            if any(self._under_way(view, mate) for mate in known):
                return None
            errand.level = max(0.5 * errand.level, self._finest)
            allotter.candidates.unspend()
            allotter.candidates.update(view, errand.level)

    def _place(self, view: RobotView, voxel: int) -> np.ndarray:
        """(3,) a voxel's centre in the map frame; of planar robots at their sensor's height."""
        grid = self._scenario.grid
        place = grid.centre_of(np.stack(np.unravel_index(voxel, grid.shape)))
        if view.planar:
            place[2] = view.pose[2]
        return place

    def _way(self, view: RobotView, allotter: Allotter, choice: Choice) -> list[np.ndarray]:
        """Stops on the way to a candidate, none farther from the one before than the robot reaches."""
        grid, robot = self._scenario.grid, view.kind.robot
        goal = self._place(view, choice.voxel)
        if robot.navigator == "planned" and math.isinf(robot.reach_m):
            return [goal]
        allotter.seek(view.pose, choice.voxel)
        search, lattice = allotter.search, allotter.lattice
        path = np.empty(extract_path(search, lattice, choice.voxel, np.empty(0, np.int32)), np.int32)
        if extract_path(search, lattice, choice.voxel, path) == 0:
            return [goal]
        start = grid.in_grid_units(view.pose)[:3]
        end = np.stack(np.unravel_index(choice.voxel, grid.shape)) + 0.5
        if lattice.layer >= 0:
            end[2] = start[2]
        points = string_pulled(search, lattice, allotter.costs, path, start, end)
        reach = min(robot.reach_m * _NOT_QUITE / grid.voxel_size_m, float(sum(grid.shape)))
        stops, at = [], start
        for point in points:
            hops = max(1, math.ceil(float(np.linalg.norm(point - at)) / reach))
            stops += [at + (point - at) * (hop + 1) / hops for hop in range(hops)]
            at = point
        return [np.asarray(grid.origin_m) + stop * grid.voxel_size_m for stop in stops] or [goal]

    def _onward(self, view: RobotView, errand: _Errand, allotter: Allotter) -> np.ndarray:
        """The viewpoint at the next stop."""
        return self._gazing(view, allotter, errand.stops.pop(0))

    def _gazing(self, view: RobotView, allotter: Allotter, place: np.ndarray) -> np.ndarray:
        """(5,) a place (3,) and where to look from it."""
        viewpoint = view.pose.copy()
        viewpoint[: 2 if view.planar else 3] = place[: 2 if view.planar else 3]
        grid_place = self._scenario.grid.in_grid_units(viewpoint)[:3]
        viewpoint[3:] = allotter.candidates.gaze(grid_place, view)
        return viewpoint


def _apart_m(view: RobotView, place: np.ndarray) -> float:
    """How far a robot has to drive straight to a place (3,), map frame."""
    axes = 2 if view.planar else 3
    return float(np.linalg.norm(place[:axes] - view.pose[:axes]))
