"""Rules that send robots to voxels in known free space, above all to frontier cells: goals, stops and gazes.

Each call decides anew, so robots follow the rule as closely as they are asked: at every stop, or at every
scan under way (`Robot.redecide`). An unchanged map is an unchanged choice: the same viewpoint, bit by bit.

Ours, where the rules say nothing:

- A frontier cell from which a scan explored nothing is dropped, and what it alone touches with it, until the
  map changes around it; so is a cell to which a drive was blocked.
- Without a frontier, a finer σ counts as known, half the one before, down to the mission's σ_end, since a
  mission may require more than having seen everything once.
- A sensor that looks one way is turned to where most is unknown.
- A rule may name a place from which its frontier cell is looked at. Where a scan from there leaves the cell a
  frontier, or the drive there was blocked, the robot goes on to the cell itself.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from entropy_explore_env.belief.paths.search import Search, new_search
from entropy_explore_env.errors import ActionError, SettingError
from entropy_explore_env.frontiers.blocks import NONE
from entropy_explore_env.frontiers.frontier_map import KNOWN_SIGMA
from entropy_explore_env.frontiers.knowledge import centres_of, voxel_of
from entropy_explore_env.frontiers.path_lengths import KnownPaths
from entropy_explore_env.frontiers.voxel_frontiers import VoxelFrontiers
from entropy_explore_env.planner.driver import Driver
from entropy_explore_env.planner.scene import NOWHERE, ROOM, STAY, Goal, Scene, scanned_here
from entropy_explore_env.planner.stops import apart_m, stop_towards
from entropy_explore_env.robots.knowledge import RobotKnowledge
from entropy_explore_env.settings.scenario import Scenario

_GAZES = 4
"""A cell is dropped when the robot has looked from it in this many directions."""


@dataclass
class _Memory:
    """What is kept of a robot from one decision to the next."""

    cells: VoxelFrontiers
    paths: KnownPaths
    level: float
    """σ from which on a voxel counts as known."""
    goal: Goal = NOWHERE
    viewpoint: np.ndarray | None = None
    """(5,) on the way to the goal, chosen last."""
    scanned: bool = False
    """Whether the first scan was taken."""
    gazes: int = 0
    """Number of directions in which it has looked from where it stands."""


class FrontierRule(Driver):
    """Drives robots to goals in known free space: a rule is a subclass with `pick`; see the top of the file.

    A rule may read what it needs from the Scene, and change nothing in it but the state of the path search.
    """

    most_blocked = 0
    stops_at_corners = False
    """Whether robots that plan their paths, no farther than a reach, stop and scan at corners, too."""
    until_reached = False
    """Whether a target holds, once picked, until it is reached; else until the map changes."""
    refines = True
    """Whether a finer σ counts as known where the rule finds no goal."""
    turns_first = True
    """Whether a robot turns to where most is unknown for its first scan."""

    @abstractmethod
    def pick(self, scene: Scene) -> int | Goal:
        """Return the voxel to go to, in which the body may stand, or a Goal; NONE = none can be reached."""

    def reset(self, scenario: Scenario, rng: np.random.Generator) -> None:
        """Begin a mission."""
        super().reset(scenario, rng)
        self.search: Search = new_search(scenario.grid.voxels)
        self._memories: dict[int, _Memory] = {}
        refines = self.refines and not scenario.ending.return_to_start  # all is seen, and may stay uncertain
        self._finest = min(scenario.ending.sigma_end, KNOWN_SIGMA) if refines else KNOWN_SIGMA

    def observe(self, view: RobotKnowledge) -> None:
        """Bring the robot's cells up to date."""
        memory = self._memory_of(view)
        memory.cells.update(view, memory.level)

    def _memory_of(self, view: RobotKnowledge) -> _Memory:
        """Return what is kept of a robot, which is made at its first choice: see `new_cells`."""
        if view.robot not in self._memories:
            cells = self.new_cells(view)
            paths = KnownPaths(self._scenario, view.kind, cells, self.search)
            self._memories[view.robot] = _Memory(cells, paths, KNOWN_SIGMA)
        return self._memories[view.robot]

    def new_cells(self, view: RobotKnowledge) -> VoxelFrontiers:
        """Return the empty frontier cells of a robot; an exposure surface is not known before its first view.

        Raises:
            SettingError: The world has an exposure surface.
        """
        if view.ceiling is not None:
            allowed = "a world without an exposure surface: there frontiers are columns of ground, which"
            raise SettingError("strategy", self.rule, f"{allowed} per-time-visibility knows")
        return VoxelFrontiers(self._scenario, view.kind)

    def note_blocked(self, view: RobotKnowledge) -> None:
        """Drop the cell to which the drive was blocked, or go on to it where it was to be looked at."""
        memory = self._memories[view.robot]
        target, place = memory.goal[:2]
        memory.viewpoint = None
        if place != target:
            memory.goal = Goal(target, target, looked=True)
        elif target != NONE:
            memory.goal = NOWHERE
            memory.cells.drop(target, with_edges=False)

    def take_over(self, view: RobotKnowledge) -> None:
        """Begin to decide for a robot that has scanned, and for which something else has decided so far."""
        self.forget_drive(view.robot)
        self._memory_of(view).scanned = True
        self.forget_goal(view)

    def forget_goal(self, view: RobotKnowledge) -> None:
        """Choose anew at the next decision."""
        memory = self._memories[view.robot]
        memory.goal, memory.viewpoint = NOWHERE, None

    def make_room(self, view: RobotKnowledge) -> np.ndarray:
        """Return the viewpoint on the way to a place that the robot reaches sooner than its teammates."""
        memory, here = self._memories[view.robot], voxel_of(view, view.pose)
        heard = [voxel_of(view, mate.pose) for mate in view.teammates.values() if mate.heard_s >= 0.0]
        away = memory.paths.place_away_from(here, heard, self._rng)
        if away == NONE:
            return super().make_room(view)
        stop = stop_towards(view, memory.paths, here, centres_of(view, away))
        return self._look(view, memory, stop)

    def go_to(self, view: RobotKnowledge, pose: np.ndarray) -> np.ndarray:
        """Return the viewpoint at a pose, or at a stop on the known path to it that is within reach."""
        paths, here = self._memories[view.robot].paths, voxel_of(view, view.pose)
        paths.start(here)
        stop = stop_towards(view, paths, here, pose)
        return np.array([*stop, *pose[3:]]) if len(stop) == 3 else stop

    def decide(self, view: RobotKnowledge) -> np.ndarray | None:
        """Return the viewpoint on the way to the rule's goal; see `Driver`."""
        memory, here = self._memories[view.robot], voxel_of(view, view.pose)
        if not memory.scanned:
            memory.scanned = True
            gaze = None if self.turns_first else (float(view.pose[3]), float(view.pose[4]))
            return self._look(view, memory, view.pose, gaze)
        target, place, _, gaze = memory.goal
        reached = here == target and not (view.under_way and gaze is not None)
        if reached and memory.viewpoint is not None:
            turned = self.arrive(view, memory.cells, here)
            if turned is not None:
                return turned
        kept = target != NONE and not reached and self._holds(memory.cells, target)
        arrived = here == place != target
        if kept and not arrived and (self.until_reached or not memory.cells.changed):
            return self._towards(view, memory, here, memory.goal)
        goal = self._goal(view, memory, here, target if kept else NONE)
        if goal.target == NONE:
            memory.goal, memory.viewpoint = NOWHERE, None
            return None
        if goal.target == STAY:
            memory.goal = NOWHERE
            return self._look(view, memory, view.pose)
        if goal.target == ROOM:
            memory.goal = NOWHERE
            return self.make_room(view)
        return self._towards(view, memory, here, goal)

    def arrive(self, view: RobotKnowledge, cells: VoxelFrontiers, here: int) -> np.ndarray | None:
        """Learn from the scan at the target; return a viewpoint (5,) that turns the robot there, or None."""
        if not (cells.is_frontier(here) and scanned_here(view)):
            return None
        memory = self._memories[view.robot]
        memory.gazes += 1
        gaze = cells.gaze(self._scenario.grid.in_grid_units(view.pose)[:3], view)
        turned = abs(gaze[0] - view.pose[3]) + abs(gaze[1] - view.pose[4]) > 0.1
        if turned and memory.gazes < _GAZES:
            return np.array([*view.pose[:3], *gaze])
        cells.drop(here, with_edges=True)
        return None

    def _holds(self, cells: VoxelFrontiers, target: int) -> bool:
        """Return whether a target is one still."""
        return cells.is_known_free(target) if self.until_reached else cells.is_frontier(target)

    def _goal(self, view: RobotKnowledge, memory: _Memory, here: int, target: int) -> Goal:
        """Return what the rule says; where there is no frontier, among those at finer levels."""
        while True:
            memory.paths.start(here)
            looked = target if memory.goal.looked else NONE
            picked = self.pick(Scene(view, memory.cells, memory.paths, here, target, looked))
            goal = self._checked(picked, memory.cells, here)
            if goal.target != NONE or memory.level <= self._finest:
                return goal
            memory.level = max(0.5 * memory.level, self._finest)
            memory.cells.readmit()
            memory.cells.update(view, memory.level)

    def _checked(self, picked: object, cells: VoxelFrontiers, here: int) -> Goal:
        """Return what a rule picked as a Goal.

        Raises:
            ActionError: It is no voxel in which the body is known to fit.
        """
        goal = picked if isinstance(picked, Goal) else Goal(picked, picked)  # type: ignore[arg-type]
        for voxel in goal[:2]:
            whole = isinstance(voxel, (int, np.integer)) and not isinstance(voxel, bool)
            if not whole or not ROOM <= voxel < self._scenario.grid.voxels:
                numbers = f"0 to {self._scenario.grid.voxels - 1}"
                raise ActionError(f"pick of {self.rule}", voxel, f"the number of a voxel, {numbers}, or NONE")
            if voxel >= 0 and voxel != here and not cells.is_known_free(int(voxel)):
                raise ActionError(
                    f"pick of {self.rule}", voxel, "a voxel in which the robot's body is known to fit"
                )
        return goal

    def _towards(self, view: RobotKnowledge, memory: _Memory, here: int, goal: Goal) -> np.ndarray:
        """Return the viewpoint at a goal's place, or at a stop on the path to it that is within reach."""
        if goal[:2] != memory.goal[:2] or goal.gaze != memory.goal.gaze:
            memory.viewpoint, memory.gazes = None, 0
        memory.goal = goal
        robot = view.kind.robot
        at_once = robot.navigator == "planned" and math.isinf(robot.reach_m)
        if memory.viewpoint is not None and (at_once or not self._stands_at(view, memory.viewpoint)):
            return memory.viewpoint.copy()
        end = centres_of(view, goal.place)
        stop = end if at_once else stop_towards(view, memory.paths, here, end, self.stops_at_corners)
        return self._look(view, memory, stop, goal.gaze)

    def _look(
        self,
        view: RobotKnowledge,
        memory: _Memory,
        place: np.ndarray,
        gaze: tuple[float, float] | None = None,
    ) -> np.ndarray:
        """Return the viewpoint at a place (3,) with a gaze; None = where most is unknown."""
        viewpoint = view.pose.copy()
        axes = 2 if view.planar else 3
        viewpoint[:axes] = place[:axes]
        at = self._scenario.grid.in_grid_units(viewpoint)[:3]
        viewpoint[3:] = memory.cells.gaze(at, view) if gaze is None else gaze
        memory.viewpoint = viewpoint
        return viewpoint.copy()

    def _stands_at(self, view: RobotKnowledge, viewpoint: np.ndarray) -> bool:
        return apart_m(view, viewpoint) < 0.5 * self._scenario.grid.voxel_size_m


class PickRule(FrontierRule):
    """A rule that is a function of a Scene."""

    def __init__(self, pick: Callable[[Scene], int | Goal]) -> None:
        """Take the function; its name is the rule's."""
        self._pick, self.rule = pick, getattr(pick, "__name__", "pick")

    def pick(self, scene: Scene) -> int | Goal:
        """Return what the function returns."""
        return self._pick(scene)
