"""What one robot knows and remembers when a rule picks its goal, and what rules read off that."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from entropy_explore_env.frontiers.blocks import NONE
from entropy_explore_env.frontiers.knowledge import stays, teammates_that_share, under_way, voxel_of
from entropy_explore_env.frontiers.path_lengths import KnownPaths
from entropy_explore_env.frontiers.voxel_frontiers import VoxelFrontiers
from entropy_explore_env.robots.knowledge import RobotKnowledge

STAY = -2
"""As a goal: the robot stays where it is, and scans."""
ROOM = -3
"""As a goal: the robot makes room for its teammates."""


class Goal(NamedTuple):
    """Where a rule sends a robot."""

    target: int
    """The voxel that it explores, one in which the body may stand; NONE = none can be reached; STAY; ROOM."""
    place: int
    """The voxel to which the robot drives for that: the target itself, or one from which it is visible."""
    looked: bool = False
    """Whether the target was looked at from elsewhere in vain, or could not be; the robot drives to it."""
    gaze: tuple[float, float] | None = None
    """(yaw, pitch) of the scan at the target, which is reached only when the drive has ended; None = the
    robot looks where most is unknown, and has reached the target as soon as it is in that voxel."""


NOWHERE = Goal(NONE, NONE)
"""No goal can be reached."""


class Team(NamedTuple):
    """Teammates of which a robot has heard and whose scans reach it, in two groups."""

    places: np.ndarray
    """(M,) int32 voxels of those that choose anew now, as far as the robot knows."""
    targets: np.ndarray
    """(N, 3) places in voxel edges to which the others are under way."""


@dataclass
class Scene:
    """What one robot knows and remembers, as a rule needs it.

    Attributes:
        view: What the robot knows now.
        cells: Its frontier cells, up to date.
        paths: Paths through its known free space; a search from where it stands has begun.
        here: The voxel in which it stands.
        target: The voxel that it chose last and has not reached, if that is a frontier cell still; else NONE.
        looked: The target, if the robot drives on to it after a look from elsewhere; else NONE.
    """

    view: RobotKnowledge
    cells: VoxelFrontiers
    paths: KnownPaths
    here: int
    target: int
    looked: int = NONE

    def centres(self, voxels: np.ndarray) -> np.ndarray:
        """Return the centres (K, 3) of (K,) voxels, in voxel edges."""
        return np.stack(np.unravel_index(voxels, self.view.scenario.grid.shape), axis=-1) + 0.5

    def free_around(self, radius: int) -> np.ndarray:
        """Return the voxels (N,) int64 up to `radius` off in which the body is known to fit."""
        shape = self.view.scenario.grid.shape
        low = [max(int(at) - radius, 0) for at in np.unravel_index(self.here, shape)]
        box = tuple(slice(a, a + 2 * radius + 1) for a in low)
        free = np.argwhere(np.isfinite(self.cells.traversal_cost.reshape(shape)[box]))
        return np.asarray(np.ravel_multi_index(tuple((free + low).T), shape))

    def team(self) -> Team:
        """Return where teammates are and where they go, by what the robot heard."""
        view, places, targets = self.view, [], []
        for mate, seen in teammates_that_share(view).items():
            if seen.heard_s < 0.0 and seen.announced_s < 0.0:
                continue
            if under_way(view, seen, mate) and not stays(view, seen):
                targets.append(view.scenario.grid.in_grid_units(seen.viewpoint)[:3])
            elif seen.heard_s >= 0.0:
                places.append(voxel_of(view, seen.pose))
        return Team(np.array(places, np.int32), np.array(targets, np.float64).reshape(-1, 3))

    def nearer_than_teammates(self, voxels: np.ndarray, lengths: np.ndarray) -> np.ndarray:
        """Return which frontier cells are nearer to the robot than to where teammates go; all if none is.

        Args:
            voxels: (K,) int32, the cells.
            lengths: (K,) lengths of the robot's paths to them, in voxel edges.

        Returns:
            (K,) bool.
        """
        own, places = np.ones(len(voxels), bool), self.centres(voxels)
        for target in self.team().targets:
            own &= lengths <= np.linalg.norm(places - target, axis=1)
        return own if own.any() else np.ones(len(voxels), bool)

    def lengths_of_team(self, voxels: np.ndarray, lengths: np.ndarray, places: np.ndarray) -> np.ndarray:
        """Return the lengths (1 + M, K) of paths from the robot, then from M voxels of teammates, to K cells.

        The robot's own are `lengths`. Teammates are assumed to have the robot's own map.
        """
        return np.array([lengths, *(self.paths.lengths_from(int(place), voxels) for place in places)])


def best_of(voxels: np.ndarray, worth: np.ndarray, target: int) -> int:
    """Return the voxel that is worth most, of equals the target; NONE = there is none, or all are worth -inf.

    Args:
        voxels: (K,) candidates.
        worth: (K,) of them.
        target: The voxel that was chosen before; NONE = none was.
    """
    if len(voxels) == 0 or worth.max() == -np.inf:
        return NONE
    kept = np.flatnonzero(voxels == target)
    most = float(worth.max())
    if len(kept) and worth[kept[0]] >= most - 1e-9 * max(abs(most), 1.0):
        return target
    return int(voxels[int(np.argmax(worth))])


def scanned_here(view: RobotKnowledge) -> bool:
    """Return whether a robot took its latest scan where it is, up to half a voxel."""
    return view.since_scan_m < 0.5 * view.scenario.grid.voxel_size_m
