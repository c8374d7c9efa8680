"""The frontier of one robot's belief: candidates to scan from, and how much is expected to be seen from them.

One interface for two maps: `voxel_frontiers`, for plans and 3-D space, and `terrain_frontiers`.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from entropy_explore_env.frontiers.blocks import EXCLUDED, FIND_EDGES, NONE, Blocks, mark_around
from entropy_explore_env.frontiers.visibility import VisibilityCounter, forget_in_range, new_counter
from entropy_explore_env.frontiers.voxel_states import UNMAPPED, VoxelStates
from entropy_explore_env.robots.knowledge import RobotKnowledge
from entropy_explore_env.settings.robot_kind import RobotKind
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.settings.validation import check, check_choice, check_positive
from entropy_explore_env.viewpoints.evaluation import sees_all_around

Visibility = Literal["ray-cast", "naive"]
KNOWN_SIGMA = 0.5
"""σ from which on a voxel is known: a single measurement of our sensors brings it far below."""
_BATCH = 4
"""Candidates that are counted in one call; it changes no result."""
_TURN = 2.0 * math.pi
_HEADINGS = 16
"""Headings that are compared for a sensor that looks one way."""


@dataclass(frozen=True)
class FrontierConfig:
    """What counts as explored, where candidates lie, and how V is counted.

    Attributes:
        spacing_m: Distance between candidates, at least a voxel; None = a sixth of the range.
        visibility: `ray-cast`, or the `naive` count of all unexplored points in a ball.
        gamma: γ of the height factor: relative height against absolute height. None = no height factor.

    Raises:
        SettingError: A field has another value.
    """

    spacing_m: float | None = None
    visibility: Visibility = "ray-cast"
    gamma: float | None = 0.5

    def __post_init__(self) -> None:
        """Check every field."""
        if self.spacing_m is not None:
            check_positive(self, "spacing_m")
        check_choice(self, "visibility")
        if self.gamma is not None:
            check(self, "gamma", "None, or a number from 0 to 1", lambda v: 0.0 <= v <= 1.0)


class FrontierMap(ABC):
    """Candidates of one robot's belief, and V(height factor) of each in points.

    Counts are reused as upper bounds: while the map grows, no more unexplored points can be seen from a place
    than before. Near voxels that turn free, or are unexplored again, the bounds are forgotten.

    Attributes:
        reach: Of the sensor, in voxel edges; no more than the workspace is wide.
        changed: How many voxels the latest update found in another state.
    """

    point: float
    """Size of a point: m² in plans and over terrain, else m³."""
    _states: VoxelStates
    _blocks: Blocks
    _costs: np.ndarray
    """(V,) float32 traversal costs."""
    _voxels: np.ndarray
    """(S,) int32, the candidates; NONE = a place of the array holds none."""
    _marks: np.ndarray
    """(V,) uint8, EXCLUDED where a scan was taken."""
    _rays: np.ndarray
    """Imagined rays all around."""
    _gaze_pitches: Sequence[float]
    """Pitches between which a gaze is chosen."""
    _sight: tuple[float, float]
    """Voxel edges within which a change may show more, and how much distances upwards count in that."""
    _most: float
    """No more V·(height factor) is seen from any place."""

    def __init__(self, scenario: Scenario, kind: RobotKind, frontiers: FrontierConfig) -> None:
        """Take the settings; nothing is explored yet."""
        grid = scenario.grid
        self._size, self._edge = grid.shape, grid.voxel_size_m
        self._prior, self._naive = scenario.sigma_prior**-2, frontiers.visibility == "naive"
        self.reach = min(kind.sensor.max_range_m / self._edge, float(sum(grid.shape)))
        self._spacing = max(round((frontiers.spacing_m or self.reach * self._edge / 6.0) / self._edge), 1)
        """Voxels between candidates."""
        self.changed, self._has_bounds = 0, False

    @cached_property
    def _counter(self) -> VisibilityCounter:
        """Counts of points; rules that count none need no memory for it."""
        return new_counter(len(self._blocks.state), self._size)

    @cached_property
    def _bounds(self) -> np.ndarray:
        """(V,) float64, upper bounds of V·(height factor) in voxels; inf = unknown."""
        return np.full(len(self._costs), np.inf)

    @property
    def body_reach(self) -> int:
        """Voxels that the body extends beyond its own, along an axis."""
        return self._blocks.reach

    @property
    def traversal_cost(self) -> np.ndarray:
        """(V,) float32, 1 in the mapped region, else inf; read-only."""
        costs = self._costs.view()
        costs.flags.writeable = False
        return costs

    def update(self, view: RobotKnowledge, sigma: float) -> None:
        """Bring the map up to date with the belief; σ is the level that counts as explored now."""
        least = self._prior * (1.0 + 1e-6)
        levels = np.float32(max(sigma**-2, least)), np.float32(max(KNOWN_SIGMA**-2, least))
        self.changed = int(self._read(view.mean.reshape(-1), view.precision.reshape(-1), levels))
        opened = self._states.opened[: self._states.opened_count[0]]
        self._states.opened_count[0] = 0
        if len(opened) and self._has_bounds:
            counted = np.flatnonzero(np.isfinite(self._bounds)).astype(np.int32)
            forget_in_range(self._size, opened, counted, self._sight, self._bounds)

    def _refresh(self, voxels: np.ndarray, radius: int) -> None:
        """Find the candidates anew within a radius of (K,) voxels."""
        layers = len(self._costs) // len(self._blocks.state)
        for voxel in voxels.tolist():
            mark_around(self._blocks, voxel // layers, radius, FIND_EDGES)
        self._find_candidates()

    @abstractmethod
    def _read(self, mean: np.ndarray, precision: np.ndarray, levels: tuple[np.float32, np.float32]) -> int:
        """Read a (V,) belief; return how many voxels changed. See `update_states`."""

    @abstractmethod
    def _find_candidates(self) -> None:
        """Find the candidates of the blocks that have to be updated."""

    @abstractmethod
    def replace_unreached(self, cost: np.ndarray) -> None:
        """Replace candidates that no path reaches by others of their blocks; (V,) float64 path costs."""

    @abstractmethod
    def _count_from(self, voxels: np.ndarray, seen: np.ndarray, weighed: np.ndarray) -> None:
        """Fill in (K,) points seen from (K,) int32 voxels all around, and (K,) these weighed by promises."""

    @abstractmethod
    def _count_rays(self, place: np.ndarray, rays: np.ndarray, marking: bool) -> tuple[int, float]:
        """Count the points that rays from (3,), grid units, meet: their number, and weight."""

    @abstractmethod
    def _rays_ahead(self, view: RobotKnowledge, gazes: np.ndarray) -> Sequence[np.ndarray]:
        """Return the rays of each of (G, 2) gazes, yaw and pitch."""

    @abstractmethod
    def _count_ball(self, place: np.ndarray, marking: bool) -> tuple[int, float]:
        """Count the naive V at (3,), grid units: points in a ball, seen or not."""

    def mapped_share(self) -> float:
        """Return the share of all points that are mapped."""
        return float((self._blocks.state & UNMAPPED == 0).mean())

    def count(self, voxels: np.ndarray) -> np.ndarray:
        """Return (K,) V·(height factor): points expected to be seen, weighted by promises."""
        self._bounds[voxels], weighed = self._counted(voxels)
        self._has_bounds = True
        return weighed

    def _counted(self, voxels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return (K,) V·(height factor) of (K,) int32 voxels without promises, and (K,) weighted by them."""
        seen, weighed = np.empty(len(voxels)), np.empty(len(voxels))
        if self._naive:
            for place, centre in enumerate(self._axes_of(voxels) + 0.5):
                seen[place], weighed[place] = self._count_ball(centre, marking=False)
        else:
            self._count_from(voxels, seen, weighed)
        return seen, weighed

    def worths(self, voxels: np.ndarray, worth: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> np.ndarray:
        """Return what candidates are worth, counting V only of those that can be worth most.

        Args:
            voxels: (K,) int32, of the candidates.
            worth: (N,) V·(height factor) in points and (N,) indices of candidates → (N,) what these are
                worth, never less for a greater V.

        Returns:
            (K,); -inf for candidates that cannot be worth most.
        """
        bound = worth(np.minimum(self._bounds[voxels], self._most), np.arange(len(voxels)))
        found = np.full(len(voxels), -np.inf)
        order = np.argsort(-bound, kind="stable")
        for first in range(0, len(order), _BATCH):
            batch = order[first : first + _BATCH]
            if bound[batch[0]] < found.max():
                break
            found[batch] = worth(self.count(voxels[batch]), batch)
        return found

    def listed(self, all_of_them: bool = False) -> np.ndarray:
        """Return (K,) int32 voxels of candidates: all, or those that may see something."""
        voxels = self._voxels[self._voxels != NONE]
        return voxels if all_of_them else voxels[self._bounds[voxels] > 0.0]

    def promise(self, place: np.ndarray) -> None:
        """Note that a robot will scan at (3,), grid units: it promises to see the points visible there."""
        if self._naive:
            self._count_ball(place, marking=True)
        else:
            self._count_rays(place, self._rays, marking=True)

    def release(self) -> None:
        """Forget all promises."""
        self._counter.promised[:] = 0

    def exclude(self, voxel: int) -> None:
        """Note that a scan was taken in a voxel: it is no candidate any more."""
        self._marks[voxel] |= EXCLUDED
        self._refresh(np.array([voxel]), 0)

    def drop(self, voxel: int, with_edges: bool) -> None:
        """Take out a candidate that could not be reached, or from which a scan explored nothing."""
        self.exclude(voxel)

    def is_known_free(self, voxel: int) -> bool:
        """Return whether the body may stand in a voxel, by what is known."""
        return math.isfinite(self._costs[voxel])

    def readmit(self) -> None:
        """Let all excluded places be candidates again, for a finer level."""
        excluded = np.flatnonzero(self._marks & EXCLUDED)
        self._marks[excluded] ^= EXCLUDED
        self._refresh(excluded, 0)

    def open_start(self, voxel: int) -> list[int]:
        """Make the place where a robot stands passable; return the numbers of the voxels that were not."""
        return []

    def close(self, voxels: list[int]) -> None:
        """Make the voxels of `open_start` impassable again."""
        self._costs[voxels] = np.inf

    def gaze(self, place: np.ndarray, view: RobotKnowledge) -> tuple[float, float]:
        """Return the (yaw, pitch) in which most is seen from (3,), grid units; as it is if none sees more."""
        turns = 1 if sees_all_around(view.kind.sensor) else _HEADINGS
        gazes = [
            (float(view.pose[3]) + turn * (_TURN / _HEADINGS), pitch)
            for pitch in self._gaze_pitches
            for turn in range(turns)
        ]
        if len(gazes) == 1:
            return gazes[0]
        fans = self._rays_ahead(view, np.array(gazes))
        seen = [self._count_rays(place, rays, marking=False)[0] for rays in fans]
        yaw, pitch = gazes[int(np.argmax(seen))]
        return (yaw + math.pi) % _TURN - math.pi, pitch

    def _axes_of(self, voxels: np.ndarray) -> np.ndarray:
        """Return (K, 3) indices of (K,) voxels."""
        return np.stack(np.unravel_index(voxels, self._size), axis=-1)
