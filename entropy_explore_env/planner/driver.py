"""From where a rule sends a robot to what the robot does: the one place where robots get out of trouble.

A rule says where a robot goes by what it knows, and the driver does what no formula says:

- A robot that a teammate stopped waits for one scan if its number is the lower one. Otherwise, or if it is
  stopped again, it steps aside to a random viewpoint. If that happened twice in a row, it makes room: for
  some decisions it goes to places that it reaches sooner than its teammates do.
- A robot that is blocked by what does not move is told so, since the same drive would end there again; after
  a number of such drives in a row it goes to a random viewpoint.
- A robot to which its rule gives no viewpoint goes to random ones, each until its drive has ended.
- A robot that would take the same scan again, although the latest one brought nothing, goes to a random
  viewpoint.
- Robots that drift back off from what blocks them (`back_off`).

A rule overrides one of the methods `give_way`, `make_room` and `note_blocked` where its paper says what a
robot does.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field

import numpy as np

from entropy_explore_env.frontiers.knowledge import RobotKnowledge, random_viewpoint
from entropy_explore_env.planner.back_off import BackOff
from entropy_explore_env.robots.motion import MoveEnd
from entropy_explore_env.scenario import Scenario

_ASIDE = 2
"""How often in a row a robot steps aside before it makes room."""
_MOST_DECISIONS = 4
"""Most decisions for which a robot makes room after a block."""
_NOTHING = 0.01
"""A scan that brings less than this share of the most that one brought has brought nothing."""


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
    """Number of drives in a row that were blocked by what does not move."""
    most_bits: float = 0.0
    """Most bits that a scan brought."""


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
        self._back_off = BackOff(scenario, rng) if scenario.drifts and self.backs_off else None

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
        if self._back_off is not None:
            viewpoint = self._back_off.mended(view, viewpoint)
        trail.viewpoint = viewpoint.copy()
        return viewpoint

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

    def _wander(self, view: RobotKnowledge, trail: Trail) -> np.ndarray:
        """Return a random viewpoint (5,), the same one until the drive there has ended."""
        if trail.random is None or not view.under_way:
            trail.random = random_viewpoint(view, self._rng)
        return trail.random.copy()

    def _in_vain(self, view: RobotKnowledge, trail: Trail, viewpoint: np.ndarray) -> bool:
        """Whether a scan at a viewpoint would only repeat the latest one, which brought nothing."""
        came_bits = float(view.scan.utility_bits.sum())
        trail.most_bits = max(trail.most_bits, came_bits)
        apart_m = float(np.linalg.norm(viewpoint[:3] - view.pose[:3]))
        stands = not view.under_way and apart_m < 0.5 * self._scenario.grid.voxel_size_m
        same = bool(np.allclose(viewpoint, trail.viewpoint))
        return stands and same and came_bits < _NOTHING * trail.most_bits


def nearest_teammate(view: RobotKnowledge) -> int:
    """Return the number of the teammate that was last heard nearest; -1 = none was heard."""
    heard = [number for number, mate in view.teammates.items() if mate.heard_s >= 0.0]
    apart_m = [float(np.linalg.norm(view.teammates[mate].pose[:3] - view.pose[:3])) for mate in heard]
    return heard[int(np.argmin(apart_m))] if heard else -1
