"""From where a rule sends a robot to what the robot does: the one place where robots get out of trouble.

- A robot that a teammate stopped waits for one scan if its number is the lower one. Otherwise, or if it is
  stopped again, it steps aside to a random viewpoint, and after two of these it makes room: for some
  decisions it goes to places that it reaches sooner than its teammates do.
- A robot that is blocked by what does not move is told so, and goes to a random viewpoint after a number of
  such drives in a row.
- A robot goes to a random viewpoint, too, where its rule gives none, until that drive has ended, and where it
  would take the same scan again although the latest one brought nothing.
- A robot that drifts is wrong about its place, and so is its map. Blocked twice in a row, or sent again to
  where it was blocked, it drives a few voxels in a random direction that leads away from there, once more
  with each further block. After many decisions at the same place it goes to a random viewpoint.

A rule overrides one of the methods `give_way`, `make_room` and `note_blocked` where its paper says what a
robot does.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field

import numpy as np

from entropy_explore_env.frontiers.knowledge import random_viewpoint
from entropy_explore_env.robots.knowledge import RobotKnowledge
from entropy_explore_env.robots.motion import MoveEnd
from entropy_explore_env.settings.scenario import Scenario

_ASIDE = 2
"""How often in a row a robot steps aside before it makes room."""
_MOST_DECISIONS = 4
"""Most decisions for which a robot makes room, or backs off, after a block."""
_NOTHING = 0.01
"""A scan that brings less than this share of the most that one brought has brought nothing."""
_SAME_EDGES = 1.5
"""Places nearer than this, in voxel edges, are the same to a robot that drifts."""
_STANDS = 15
"""Decisions at the same place after which it goes elsewhere: one for each direction of a narrow view."""
_DRAWS = 16
"""Directions drawn at most until one leads away from where it was blocked."""
_BACK_EDGES = 2.0, 6.0
"""Shortest and longest way back, in voxel edges: a far goal would lead through the same first corner."""


@dataclass
class Trail:
    """What the driver keeps of a robot from one decision to the next."""

    viewpoint: np.ndarray = field(default_factory=lambda: np.full(5, np.nan))
    """(5,) chosen at the latest decision."""
    follows: bool = False
    """Whether the rule chose it."""
    random: np.ndarray | None = None
    """(5,) a random viewpoint to which the robot is driving because its rule gave none."""
    stopped: int = 0
    """Number of drives in a row that a teammate stopped since the robot stepped aside."""
    aside: int = 0
    """How often it stepped aside since a drive of its rule was not stopped."""
    waited: bool = False
    """Whether the robot waited for a teammate at its latest decision."""
    room: int = 0
    """Decisions for which it still makes room."""
    blocked: int = 0
    """Number of drives of its rule in a row that were blocked by what does not move."""
    most_bits: float = 0.0
    """Most bits that a scan brought."""
    blocks: int = 0
    """Number of any drives in a row that were blocked; like what follows, of robots that drift."""
    blocked_aim: np.ndarray = field(default_factory=lambda: np.full(3, np.nan))
    """(3,) where it meant to go when it was blocked last."""
    away: int = 0
    """Decisions for which it still backs off."""
    stood_at: np.ndarray = field(default_factory=lambda: np.full(3, np.inf))
    stands: int = 0
    """Number of decisions in a row near `stood_at`."""
    home: np.ndarray = field(default_factory=lambda: np.full(5, np.nan))
    """(5,) where it was when it decided first."""


class Driver(ABC):
    """Drives robots to where a rule sends them: the rule is a subclass with `decide`."""

    rule = "this rule"
    """Name of the rule, for errors."""
    most_blocked = 2
    """Number of blocked drives in a row after which a robot goes to a random viewpoint; 0 = it never does."""
    repeats = False
    """Whether robots may take the same scan again although it brought nothing."""
    backs_off = True
    """Whether robots that drift back off from what blocks them."""

    def reset(self, scenario: Scenario, rng: np.random.Generator) -> None:
        """Begin a mission."""
        self._scenario, self._rng = scenario, rng
        self._trails = [Trail() for _ in range(scenario.robots)]
        self._back_off_rng = rng.spawn(1)[0] if scenario.drifts and self.backs_off else None

    def found_nothing(self, robot: int) -> bool:
        """Return whether the rule gave a robot no viewpoint at its latest decision, so that it wanders."""
        return self._trails[robot].random is not None

    @abstractmethod
    def decide(self, view: RobotKnowledge) -> np.ndarray | None:
        """Return the viewpoint (5,) by the rule, map frame; None = the rule gives none."""

    def observe(self, view: RobotKnowledge) -> None:
        """Bring up to date what the rule keeps of a robot; called first at each decision."""
        return None

    def note_blocked(self, view: RobotKnowledge) -> None:
        """Learn that something that does not move ended the drive to the latest viewpoint of the rule."""
        return None

    def forget_goal(self, view: RobotKnowledge) -> None:
        """Forget where the robot was going, since it goes elsewhere now."""
        return None

    def make_room(self, view: RobotKnowledge) -> np.ndarray:
        """Return the viewpoint (5,) of a robot that is in its teammates' way."""
        return random_viewpoint(view, self._rng)

    def give_way(self, view: RobotKnowledge, trail: Trail) -> np.ndarray | None:
        """Return the viewpoint (5,) of a robot that a teammate stopped; None = it goes on by its rule."""
        if trail.stopped == 1 and nearest_teammate(view) > view.robot:
            trail.waited = True
            return view.pose.copy()
        self.forget_goal(view)
        trail.stopped, trail.aside = 0, trail.aside + 1
        if trail.aside <= _ASIDE:
            return random_viewpoint(view, self._rng)
        trail.room = min(trail.aside - _ASIDE, _MOST_DECISIONS) - 1
        return self.make_room(view)

    def choose(self, view: RobotKnowledge) -> np.ndarray:
        """Return the viewpoint (5,) of a robot that decides, map frame, by what it knows.

        Raises:
            SettingError: The rule cannot act in this scenario.
            ActionError: The rule gave no place to which a robot can go.
        """
        trail = self._trails[view.robot]
        self.start_from(view)
        self.observe(view)
        viewpoint = self._after_drive(view, trail)
        trail.follows = viewpoint is None or trail.waited
        if viewpoint is None:
            viewpoint = self.decide(view)
            if viewpoint is None:
                viewpoint, trail.follows = self._wander(view, trail), False
            elif not self.repeats and self._in_vain(view, trail, viewpoint):
                viewpoint, trail.follows = random_viewpoint(view, self._rng), False
        if trail.follows:
            trail.random = None
        if self._back_off_rng is not None and not view.under_way and view.covariance.any():
            viewpoint = self._backed_off(view, trail, viewpoint, self._back_off_rng)
        trail.viewpoint = viewpoint.copy()
        return viewpoint

    def start_from(self, view: RobotKnowledge) -> None:
        """Note where a robot started, unless that was noted before."""
        trail = self._trails[view.robot]
        if np.isnan(trail.home[0]):
            trail.home = view.pose.copy()

    def forget_drive(self, robot: int) -> None:
        """Forget how a robot's latest drives ended, and where they led."""
        trail = self._trails[robot]
        self._trails[robot] = Trail(home=trail.home, most_bits=trail.most_bits)

    def _after_drive(self, view: RobotKnowledge, trail: Trail) -> np.ndarray | None:
        """Learn from how the latest drive ended; return a viewpoint where that alone decides."""
        if trail.room > 0:
            trail.room -= 1
            return self.make_room(view)
        if not trail.follows:
            return None
        if view.move_end is MoveEnd.TEAMMATE:
            trail.stopped += 1
            return self.give_way(view, trail)
        if not trail.waited:  # a robot that waited has not arrived anywhere
            trail.stopped = trail.aside = 0
        trail.waited = False
        if not view.move_end.blocked:
            trail.blocked = 0
            return None
        trail.blocked += 1
        self.note_blocked(view)
        if trail.blocked != self.most_blocked:
            return None
        trail.blocked = 0
        self.forget_goal(view)
        return random_viewpoint(view, self._rng)

    def go_to(self, view: RobotKnowledge, pose: np.ndarray) -> np.ndarray:
        """Return the viewpoint (5,) of a robot on its way to a pose."""
        return pose.copy()

    def _wander(self, view: RobotKnowledge, trail: Trail) -> np.ndarray:
        """Return a viewpoint (5,) where the rule gives none: a random one, until the drive there has ended.

        Where the mission ends at the start, the robot drives there.
        """
        if self._scenario.ending.return_to_start:
            trail.random = self.go_to(view, trail.home)
        elif trail.random is None or not view.under_way:
            trail.random = random_viewpoint(view, self._rng)
        return trail.random.copy()

    def _in_vain(self, view: RobotKnowledge, trail: Trail, viewpoint: np.ndarray) -> bool:
        """Return whether a scan at a viewpoint would only repeat the latest one, which brought nothing."""
        came_bits = float(view.scan.utility_bits.sum())
        trail.most_bits = max(trail.most_bits, came_bits)
        stands = not view.under_way and self._is_near(viewpoint[:3], view.pose[:3], 0.5)
        same = bool(np.allclose(viewpoint, trail.viewpoint))
        return stands and same and came_bits < _NOTHING * trail.most_bits

    def _backed_off(
        self, view: RobotKnowledge, trail: Trail, viewpoint: np.ndarray, rng: np.random.Generator
    ) -> np.ndarray:
        """Return the viewpoint (5,) that was chosen, or one away from what blocks a robot that drifts."""
        if view.move_end.blocked:
            trail.blocks, trail.blocked_aim = trail.blocks + 1, trail.viewpoint[:3]
            if trail.blocks >= 2:
                trail.away = min(trail.blocks - 1, _MOST_DECISIONS)
        else:
            trail.blocks = 0
        if self._is_near(view.pose[:3], trail.stood_at, _SAME_EDGES):
            trail.stands += 1
        else:
            trail.stood_at, trail.stands = view.pose[:3].copy(), 0
        again = self._is_near(viewpoint[:3], trail.blocked_aim, _SAME_EDGES)
        if trail.away > 0 or (trail.blocks > 0 and again):
            trail.away = max(trail.away - 1, 0)
            return self._back(view, trail.blocked_aim, rng)
        if trail.stands < _STANDS:
            return viewpoint
        trail.stands = 0
        return random_viewpoint(view, rng)

    def _is_near(self, place: np.ndarray, other: np.ndarray, edges: float) -> bool:
        return bool(np.linalg.norm(place - other) < edges * self._scenario.grid.voxel_size_m)

    def _back(self, view: RobotKnowledge, blocked_aim: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Return a viewpoint (5,) a few voxels off, away from where the robot was blocked, with any gaze."""
        viewpoint, grid, here = random_viewpoint(view, rng), self._scenario.grid, view.pose[:3]
        axes = 2 if view.planar else 3
        for _ in range(_DRAWS):
            step = np.zeros(3)
            step[:axes] = rng.normal(size=axes)
            if float((blocked_aim - here) @ step) <= 0.0:
                break
        far_m = min(rng.uniform(*_BACK_EDGES) * grid.voxel_size_m, view.kind.robot.reach_m)
        low = np.asarray(grid.origin_m)
        place = here + far_m * step / max(float(np.linalg.norm(step)), 1e-9)
        viewpoint[:axes] = np.clip(place, low, low + grid.size_m)[:axes]
        return viewpoint


def nearest_teammate(view: RobotKnowledge) -> int:
    """Return the number of the teammate that was last heard nearest; -1 = none was heard."""
    heard = [number for number, mate in view.teammates.items() if mate.heard_s >= 0.0]
    apart_m = [float(np.linalg.norm(view.teammates[mate].pose[:3] - view.pose[:3])) for mate in heard]
    return heard[int(np.argmin(apart_m))] if heard else -1
