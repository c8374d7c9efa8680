"""The strategy `per-time-visibility` (Sawhney, Krishna & Srinathan 2009): the most new visibility per time.

    v* = argmax over candidates v of V(v)/t(v)

or by another metric; that, and which robot gets which candidate, is in `allocation`. V is what v is expected
to show and no robot has promised to see, in m² of plan or ground (in 3-D without an exposure surface m³); t
is the time of the drive to v and of the scan there, in seconds, without stops on the path. Over terrain V is
multiplied by (z_f - z_av)^γ z_f^(1 - γ) (sect. 3.3), heights in metres. A robot drives to its candidate
before it chooses again.

Ours, where the paper says nothing: there is one candidate per block of the map, and none where the robot has
scanned, so that slivers which its rays miss do not stop it. A robot without candidates waits and scans while
teammates are under way, and makes room for one whose body touches its own; then a finer σ counts as explored,
unless robots explore only once. V is counted all around; a sensor that looks one way is turned to where most
of it lies.
"""

from __future__ import annotations

from typing import cast

import numpy as np

from baselines.strategies.allocation import Allocator, Choice, ExplorationConfig, Round, bodies_touch
from entropy_explore_env.errors import SettingError
from entropy_explore_env.frontiers.blocks import NONE
from entropy_explore_env.frontiers.frontier_map import KNOWN_SIGMA
from entropy_explore_env.frontiers.knowledge import stays, teammates_that_share, under_way
from entropy_explore_env.frontiers.terrain_frontiers import TerrainFrontiers
from entropy_explore_env.frontiers.voxel_frontiers import VoxelFrontiers
from entropy_explore_env.planner.frontier_rule import FrontierRule
from entropy_explore_env.planner.scene import ROOM, STAY, Scene
from entropy_explore_env.robots.knowledge import RobotKnowledge
from entropy_explore_env.settings.scenario import Scenario


class PerTimeVisibility(FrontierRule):
    """Goes to frontier candidates by a metric; see `ExplorationConfig`.

    Attributes:
        config: The settings.
        idle: Robot by robot, whether it found nothing unexplored at its latest decision, at the first level.
    """

    rule = "per-time-visibility"
    until_reached = True
    stops_at_corners = True
    repeats = True

    def __init__(self, config: ExplorationConfig | None = None) -> None:
        """Take the settings; None = the defaults.

        Raises:
            SettingError: The settings are of another type.
        """
        if not isinstance(config, ExplorationConfig | None):
            raise SettingError("config", config, "None, or an ExplorationConfig")
        self.config = config or ExplorationConfig()

    def reset(self, scenario: Scenario, rng: np.random.Generator) -> None:
        """Begin a mission."""
        super().reset(scenario, rng)
        if self.config.once:
            self._finest = KNOWN_SIGMA
        self.idle = [False] * scenario.robots
        self._rounds = [Round() for _ in range(scenario.robots)]

    def new_cells(self, view: RobotKnowledge) -> VoxelFrontiers:
        """Return the empty map of a robot's candidates; see `FrontierRule`."""
        kind, frontiers = view.kind, self.config.frontiers
        if view.ceiling is None:
            return VoxelFrontiers(self._scenario, kind, frontiers)
        # This rule and what drives it need of a map what candidates of both kinds have.
        return cast("VoxelFrontiers", TerrainFrontiers(self._scenario, kind, frontiers, view.ceiling))

    def mapped_share(self) -> float:
        """Return the largest share of points that a robot has mapped: of columns over terrain."""
        return max((memory.cells.mapped_share() for memory in self._memories.values()), default=0.0)

    def arrive(self, view: RobotKnowledge, cells: VoxelFrontiers, here: int) -> None:
        """Take out the candidate from which the robot has scanned."""
        cells.exclude(here)

    def pick(self, scene: Scene) -> int:
        """Return the voxel of the candidate of greatest value that is the robot's; see `FrontierRule`."""
        view, together = scene.view, self.config.allocation == "synchronous"
        latest = self._rounds[view.robot]
        latest.arrive(view)
        if together and not latest.over(view):
            return STAY
        known = {mate: seen for mate, seen in teammates_that_share(view).items() if seen.heard_s >= 0.0}
        moving = [m for m, seen in known.items() if under_way(view, seen, m) and not stays(view, seen)]
        found = self._allocated(scene, list(known), [] if together else moving)
        latest.leave(view, found)
        if self._memories[view.robot].level >= KNOWN_SIGMA:
            self.idle[view.robot] = view.robot not in found
        if view.robot in found:
            return found[view.robot].voxel
        if any(bodies_touch(view, mate) for mate in moving):
            return ROOM
        return STAY if moving or self.config.once else NONE

    def _allocated(self, scene: Scene, known: list[int], moving: list[int]) -> dict[int, Choice]:
        """Return what is allocated to the robot and to teammates that choose with it."""
        view, config = scene.view, self.config
        allocator = Allocator(scene, config)
        if not config.promises:
            return allocator.allocate([], [])
        grid, stopped = self._scenario.grid, [mate for mate in known if mate not in moving]
        targets = [grid.in_grid_units(view.teammates[mate].viewpoint)[:3] for mate in moving]
        return allocator.allocate(stopped, targets, everybody=config.allocation == "synchronous")
