"""Strategies that drive robots to poses in known free space, a scan after each drive; which, a subclass says.

Where nothing known can be reached, or a teammate is in the way, a robot goes to a random viewpoint; where a
drive was stopped otherwise a pose is chosen anew. Where teammates stop it again before it has reached a goal,
it parts from them, for longer the more often that happens: it goes to a place in known free space to which
its own way is shorter than theirs.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from baselines.strategies.protocol import random_viewpoint
from entropy_explore_env.belief.paths.search import new_search
from entropy_explore_env.errors import SettingError
from entropy_explore_env.frontiers.frontier_map import KNOWN_SIGMA
from entropy_explore_env.frontiers.knowledge import voxel_of
from entropy_explore_env.frontiers.path_lengths import KnownPaths
from entropy_explore_env.frontiers.voxel_frontiers import VoxelFrontiers
from entropy_explore_env.missions.view import RobotView
from entropy_explore_env.planner.stops import apart_m, stop_towards
from entropy_explore_env.robots.motion import MoveEnd
from entropy_explore_env.scenario import Scenario

_GOES_ON = (MoveEnd.ARRIVED, MoveEnd.CORNERS, MoveEnd.UNDER_WAY)
"""Ends of a drive after which a robot keeps its goal."""
_SAME_PLACE = 0.75
"""Voxel edges: a robot this near has arrived."""
_MOST_PARTING = 4
"""Most decisions for which a robot parts from its teammates after a block: they need time to part, too."""
_PARTING_DRAWS = 8
"""Places of which a robot that parts from its teammates takes the farthest from them."""


@dataclass
class Memory:
    """What is kept of a robot from one decision to the next."""

    cells: VoxelFrontiers
    paths: KnownPaths
    interest: np.ndarray
    """(V,) float32, eq. 9."""
    goal: np.ndarray | None = None
    """(5,) pose that it is under way to."""
    occupancy: np.ndarray | None = None
    """(V,) float32 as extrapolated at the latest decision."""
    measured: int = 0
    """Voxels that were measured at the latest decision."""
    scanned: bool = False
    """Whether the first scan was taken."""
    blocked: int = 0
    """Drives that a teammate's body stopped since a goal was reached."""
    parting: int = 0
    """Decisions for which it still parts from its teammates."""
    expected: np.ndarray = field(default_factory=lambda: np.zeros(0, np.int32))
    """Unknown voxels that should be visible from the goal."""


class KnownSpace(ABC):
    """Drives robots to poses in known free space; a subclass says to which, with `pick`."""

    interest_decay = 0.0
    """β of eq. 9; 0 = no interest is ever lost."""

    def reset(self, scenario: Scenario, rng: np.random.Generator) -> None:
        """A new mission begins."""
        self._scenario, self._rng = scenario, rng
        self._search = new_search(scenario.grid.voxels)
        self._voxels = np.arange(scenario.grid.voxels, dtype=np.int32)
        self._memories: dict[int, Memory] = {}

    def choose(self, views: Sequence[RobotView]) -> list[np.ndarray]:
        """(5,) viewpoint of each view, map frame, by its own belief.

        Raises:
            SettingError: The world has an exposure surface.
        """
        return [self._choose(view) for view in views]

    @abstractmethod
    def pick(self, view: RobotView, memory: Memory, reachable: np.ndarray) -> np.ndarray | None:
        """(5,) the pose to go to, map frame; None = there is none.

        Args:
            view: Of the robot.
            memory: Of the robot; `expected` may be set.
            reachable: (N,) int32 voxels in which the body is known to fit, with a known free way there.
        """

    def _choose(self, view: RobotView) -> np.ndarray:
        memory = self._memory(view)
        if not memory.scanned:
            memory.scanned = True
            return view.pose.copy()
        memory.cells.update(view, KNOWN_SIGMA)
        here, arrived_m = voxel_of(view, view.pose), _SAME_PLACE * self._scenario.grid.voxel_size_m
        if view.move_end is MoveEnd.TEAMMATE:
            memory.blocked += 1
            memory.parting = min(memory.blocked - 1, _MOST_PARTING)
        if memory.parting > 0:
            memory.parting -= 1
            if (away := self._away_from_teammates(view, memory, here)) is not None:
                memory.goal = None
                return away
        if memory.goal is not None:
            if view.move_end not in _GOES_ON:
                memory.goal = None
                if view.move_end is MoveEnd.TEAMMATE:
                    return random_viewpoint(view, self._rng)
            elif not view.under_way and apart_m(view, memory.goal) < arrived_m:
                self._lose_interest(view, memory)
                memory.goal, memory.blocked = None, 0
        if memory.goal is None:
            memory.expected = memory.expected[:0]
            memory.paths.start(here)
            memory.paths.extend(math.inf)
            memory.goal = self.pick(view, memory, self._reachable(memory))
        if memory.goal is None:
            return random_viewpoint(view, self._rng)
        return self._stop(view, memory, here, memory.goal)

    def _away_from_teammates(self, view: RobotView, memory: Memory, here: int) -> np.ndarray | None:
        """(5,) a pose to which the robot has a shorter known free way than any teammate has; None = none.

        Teammates of whom it never heard do not count: where it heard of none there is no such pose. Of some
        that are drawn the one that is farthest from teammates, or a stop on the way there. It looks in
        any direction: a robot that has seen nothing behind it knows no path there.
        """
        mates_m = []
        for seen in view.teammates.values():
            if seen.heard_s >= 0.0:
                memory.paths.start(voxel_of(view, seen.pose))
                memory.paths.extend(math.inf)
                mates_m.append(memory.paths.lengths_to(self._voxels))
        if not mates_m:
            return None
        memory.paths.start(here)
        memory.paths.extend(math.inf)
        voxels = self._reachable(memory)
        nearest_m = np.min([each[voxels] for each in mates_m], axis=0)
        ours = np.flatnonzero((memory.paths.lengths_to(voxels) < nearest_m) & (voxels != here))
        if len(ours) == 0:
            return None
        drawn = self._rng.choice(ours, _PARTING_DRAWS)
        goal = int(voxels[drawn[np.argmax(nearest_m[drawn])]])
        yaw = float(self._rng.uniform(-math.pi, math.pi))
        return self._stop(view, memory, here, self.pose_in(view, goal, yaw, float(view.pose[4])))

    def _memory(self, view: RobotView) -> Memory:
        if view.ceiling is not None:
            raise SettingError("strategy", "next-best-view", "a world without an exposure surface")
        if view.robot not in self._memories:
            cells = VoxelFrontiers(self._scenario, view.kind)
            paths = KnownPaths(self._scenario, view.kind, cells, self._search)
            interest = np.ones(self._scenario.grid.voxels, np.float32)
            self._memories[view.robot] = Memory(cells, paths, interest)
        return self._memories[view.robot]

    def _lose_interest(self, view: RobotView, memory: Memory) -> None:
        """Eq. 9 for the voxels that should have been seen and were not; their visibility counts as 1."""
        silent = memory.expected[
            view.precision.reshape(-1)[memory.expected] <= np.float32(self._scenario.sigma_prior**-2)
        ]
        memory.interest[silent] *= math.exp(-self.interest_decay)

    def _reachable(self, memory: Memory) -> np.ndarray:
        """(N,) int32 voxels to which the search of the robot's paths has come."""
        voxels = np.flatnonzero(np.isfinite(memory.cells.traversal_cost)).astype(np.int32)
        return voxels[np.isfinite(memory.paths.lengths_to(voxels))]

    def _stop(self, view: RobotView, memory: Memory, here: int, goal: np.ndarray) -> np.ndarray:
        """The goal, or a stop on the way to it, with the goal's gaze."""
        stop = goal.copy()
        axes = 2 if view.planar else 3
        stop[:axes] = stop_towards(view, memory.paths, here, goal)[:axes]
        return stop

    def pose_in(self, view: RobotView, voxel: int, yaw: float, pitch: float) -> np.ndarray:
        """(5,) a pose in the middle of a voxel; planar robots stay at their height."""
        grid = self._scenario.grid
        place = grid.centre_of(np.stack(np.unravel_index(voxel, grid.shape)))
        if view.planar:
            place[2] = view.pose[2]
        if view.level:
            pitch = 0.0
        return np.array([*place, yaw, pitch])
