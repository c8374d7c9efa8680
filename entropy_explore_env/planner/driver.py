"""What explorers share: a rule names the voxel to go to, and this drives there by way of stops.

Each call decides anew, so robots follow the rule as closely as they are asked: at every stop, or at every
scan under way (`Robot.redecide`). An unchanged map is an unchanged choice: the same viewpoint, bit by bit.

Ours, where the rules say nothing:

- A frontier cell from which a scan explored nothing is dropped, and what it alone touches with it, until the
  map changes around it; so is a cell to which a drive ended early.
- Without a frontier, a finer σ counts as known, half the one before, down to the mission's σ_end, since a
  mission may require more than having seen everything once. Then robots go to random viewpoints, each until
  its drive has ended, by however many scans the robot decides under way.
- A robot that a teammate stops waits for one scan if its number is the lower, and steps aside, to a random
  viewpoint, if it is the higher or has waited before.
- A sensor that looks one way is turned to where most is unknown.
- A rule may name a place from which its frontier cell is looked at. Where a scan from there leaves the cell a
  frontier, or the drive there ended early, the robot goes on to the cell itself.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from entropy_explore_env.belief.paths.search import Search, new_search
from entropy_explore_env.errors import SettingError
from entropy_explore_env.frontiers.blocks import NONE
from entropy_explore_env.frontiers.frontier_map import KNOWN_SIGMA
from entropy_explore_env.frontiers.knowledge import RobotKnowledge, random_viewpoint, voxel_of
from entropy_explore_env.frontiers.path_lengths import KnownPaths
from entropy_explore_env.frontiers.voxel_frontiers import VoxelFrontiers
from entropy_explore_env.planner.stops import apart_m, stop_towards
from entropy_explore_env.robots.motion import MoveEnd
from entropy_explore_env.scenario import Scenario

_STOPPED = (
    MoveEnd.OBSTACLE,
    MoveEnd.GROUND,
    MoveEnd.CEILING,
    MoveEnd.EDGE,
    MoveEnd.WALL,
    MoveEnd.NO_PATH,
)
"""Ends of a drive to a place that cannot be reached, whatever the belief says."""
_GAZES = 4
"""A place is dropped when the robot has looked from it in so many directions."""


@dataclass
class Scene:
    """What one robot knows and remembers, as a rule needs it.

    Attributes:
        view: Of the robot, now.
        cells: Its frontier cells, up to date.
        paths: Paths through its known free space; a search from where it stands has begun.
        here: The voxel in which it stands.
        target: The voxel that it chose last and has not reached, if it is a frontier cell still; else NONE.
        looked: The target, if the robot goes on to it after a look from elsewhere; else NONE.
    """

    view: RobotKnowledge
    cells: VoxelFrontiers
    paths: KnownPaths
    here: int
    target: int
    looked: int = NONE


class Goal(NamedTuple):
    """Where a rule sends a robot."""

    target: int
    """The voxel that it explores, one in which the body may stand; NONE = no frontier can be reached."""
    place: int
    """The voxel to which the robot drives for that: the target itself, or one from which it is in sight."""
    looked: bool = False
    """Whether the target was looked at from elsewhere in vain, or could not be; it is then driven to."""


NOWHERE = Goal(NONE, NONE)
"""No frontier can be reached."""


@dataclass
class _Memory:
    """What is kept of a robot from one decision to the next."""

    cells: VoxelFrontiers
    paths: KnownPaths
    level: float = KNOWN_SIGMA
    """σ from which on a voxel counts as known."""
    goal: Goal = NOWHERE
    viewpoint: np.ndarray | None = None
    """(5,) that was chosen last."""
    scanned: bool = False
    """Whether the first scan was taken."""
    gazes: int = 0
    """How often it has looked from where it stands."""
    blocked: int = 0
    """How many drives in a row a teammate stopped."""
    elsewhere: np.ndarray | None = None
    """(5,) a random viewpoint to which it is driving."""
    waited: bool = False
    """Whether it let a teammate pass at its latest decision."""


def scanned_here(view: RobotKnowledge) -> bool:
    """Whether a robot took its latest scan where it is, up to half a voxel."""
    return view.since_scan_m < 0.5 * view.scenario.grid.voxel_size_m


class Explorer(ABC):
    """Drives robots to where a rule wants them; see the top of the file.

    A rule is a subclass with `pick`; one that looks from elsewhere overrides `goal`, too. It may read what it
    needs from the Scene, and change nothing in it but the state of the path search.
    """

    rule = "this rule"
    """Its name, for errors."""
    until_reached = False
    """Whether a target holds, once picked, until it is reached; else until the map changes."""

    @abstractmethod
    def pick(self, scene: Scene) -> int:
        """The voxel to go to, one in which the body may stand; NONE = no frontier can be reached."""

    def goal(self, scene: Scene) -> Goal:
        """What to explore, and from where: what `pick` says, on the spot."""
        target = self.pick(scene)
        return Goal(target, target)

    def reset(self, scenario: Scenario, rng: np.random.Generator) -> None:
        """A new mission begins."""
        self._scenario, self._rng = scenario, rng
        self._search: Search = new_search(scenario.grid.voxels)
        self._memories: dict[int, _Memory] = {}
        self._finest = min(scenario.ending.sigma_end, KNOWN_SIGMA)

    def choose(self, views: Sequence[RobotKnowledge]) -> list[np.ndarray]:
        """(5,) viewpoint of each view, map frame, by its own belief and what it has heard.

        Raises:
            SettingError: The world has an exposure surface.
        """
        return [self._choose(view) for view in views]

    def cells_of(self, robot: int) -> VoxelFrontiers:
        """The frontier cells of a robot; available after its first choice."""
        return self._memories[robot].cells

    def _choose(self, view: RobotKnowledge) -> np.ndarray:
        memory = self._memory(view)
        if not memory.scanned:
            memory.scanned = True
            return self._look(view, memory, view.pose)
        memory.cells.update(view, memory.level)
        here = voxel_of(view, view.pose)
        stopped = self._note_end(view, memory, here)
        if stopped is not None:
            return stopped
        target, place, _ = memory.goal
        kept = target not in (NONE, here) and self._holds(memory.cells, target)
        arrived = here == place != target
        if kept and not arrived and (self.until_reached or not memory.cells.changed):
            return self._towards(view, memory, here, memory.goal)
        goal = self._goal(view, memory, here, target if kept else NONE)
        if goal.target == NONE:
            memory.goal, memory.viewpoint = NOWHERE, None
            if memory.elsewhere is None or not view.under_way:
                memory.elsewhere = random_viewpoint(view, self._rng)
            return memory.elsewhere.copy()
        memory.elsewhere = None
        return self._towards(view, memory, here, goal)

    def _holds(self, cells: VoxelFrontiers, target: int) -> bool:
        """Whether a target is one still."""
        return cells.is_known_free(target) if self.until_reached else cells.is_frontier(target)

    def _memory(self, view: RobotKnowledge) -> _Memory:
        """The robot's memory, made at its first choice: an exposure surface is not known before."""
        if view.ceiling is not None:
            raise SettingError(
                "strategy",
                self.rule,
                "a world without an exposure surface: there frontiers are columns of ground, which"
                " per-time-visibility, nearest-candidate and coordinated-candidate know",
            )
        if view.robot not in self._memories:
            cells = VoxelFrontiers(self._scenario, view.kind)
            paths = KnownPaths(self._scenario, view.kind, cells, self._search)
            self._memories[view.robot] = _Memory(cells, paths)
        return self._memories[view.robot]

    def _note_end(self, view: RobotKnowledge, memory: _Memory, here: int) -> np.ndarray | None:
        """Learn from how the latest drive ended; a viewpoint where that alone decides."""
        target, place, _ = memory.goal
        if memory.viewpoint is None or target == NONE:
            return None
        if view.move_end is MoveEnd.TEAMMATE:
            memory.blocked += 1
            return self._give_way(view, memory)
        if not memory.waited:  # having waited is no arrival
            memory.blocked = 0
        memory.waited = False
        if view.move_end in _STOPPED:
            memory.viewpoint = None
            if place != target:
                memory.goal = Goal(target, target, looked=True)
            else:
                memory.goal = NOWHERE
                memory.cells.drop(target, with_edges=False)
        elif here == target and memory.cells.is_frontier(here) and scanned_here(view):
            memory.gazes += 1
            gaze = memory.cells.gaze(self._scenario.grid.in_grid_units(view.pose)[:3], view)
            turned = abs(gaze[0] - view.pose[3]) + abs(gaze[1] - view.pose[4]) > 0.1
            if turned and memory.gazes < _GAZES:
                return np.array([*view.pose[:3], *gaze])
            memory.cells.drop(here, with_edges=True)
        return None

    def _give_way(self, view: RobotKnowledge, memory: _Memory) -> np.ndarray | None:
        """What a robot does that a teammate stopped; None = it goes on by its rule."""
        near = self._nearest_mate(view)
        if memory.blocked == 1 and near > view.robot:
            memory.waited = True
            return view.pose.copy()
        memory.goal, memory.viewpoint, memory.blocked = NOWHERE, None, 0
        return random_viewpoint(view, self._rng)

    def _nearest_mate(self, view: RobotKnowledge) -> int:
        """Number of the teammate that was last heard nearest; -1 = none was heard."""
        heard = [mate for mate, seen in view.teammates.items() if seen.heard_s >= 0.0]
        apart = [float(np.linalg.norm(view.teammates[mate].pose[:3] - view.pose[:3])) for mate in heard]
        return heard[int(np.argmin(apart))] if heard else -1

    def _goal(self, view: RobotKnowledge, memory: _Memory, here: int, target: int) -> Goal:
        """What the rule says; where there is no frontier, of those at finer levels."""
        while True:
            memory.paths.start(here)
            looked = target if memory.goal.looked else NONE
            goal = self.goal(Scene(view, memory.cells, memory.paths, here, target, looked))
            if goal.target != NONE or memory.level <= self._finest:
                return goal
            memory.level = max(0.5 * memory.level, self._finest)
            memory.cells.readmit()
            memory.cells.update(view, memory.level)

    def _towards(self, view: RobotKnowledge, memory: _Memory, here: int, goal: Goal) -> np.ndarray:
        """The viewpoint at a goal's place, or at a stop on the path to it that is within reach."""
        if goal[:2] != memory.goal[:2]:
            memory.viewpoint, memory.gazes = None, 0
        memory.goal = goal
        robot = view.kind.robot
        at_once = robot.navigator == "planned" and math.isinf(robot.reach_m)
        if memory.viewpoint is not None and (at_once or not self._stands_at(view, memory.viewpoint)):
            return memory.viewpoint.copy()
        end = self._centre(view, goal.place)
        return self._look(view, memory, end if at_once else stop_towards(view, memory.paths, here, end))

    def _look(self, view: RobotKnowledge, memory: _Memory, place: np.ndarray) -> np.ndarray:
        """The viewpoint at a place (3,), with the gaze in which most is unknown."""
        viewpoint = view.pose.copy()
        axes = 2 if view.planar else 3
        viewpoint[:axes] = place[:axes]
        viewpoint[3:] = memory.cells.gaze(self._scenario.grid.in_grid_units(viewpoint)[:3], view)
        memory.viewpoint = viewpoint
        return viewpoint.copy()

    def _stands_at(self, view: RobotKnowledge, viewpoint: np.ndarray) -> bool:
        return apart_m(view, viewpoint) < 0.5 * self._scenario.grid.voxel_size_m

    def _centre(self, view: RobotKnowledge, voxel: int) -> np.ndarray:
        """(3,) a voxel's centre in the map frame; of planar robots at their sensor's height."""
        grid = self._scenario.grid
        place = grid.centre_of(np.stack(np.unravel_index(voxel, grid.shape)))
        if view.planar:
            place[2] = view.pose[2]
        return place
