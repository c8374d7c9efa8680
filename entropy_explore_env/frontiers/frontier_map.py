"""The frontier of one robot's belief: candidates to scan from, and how much is expected to be seen from them.

One interface for two kinds of maps: `voxel_frontiers`, for plans and any 3-D space, and `terrain_frontiers`,
over a height field.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from entropy_explore_env.frontiers.blocks import EXCLUDED, NONE
from entropy_explore_env.frontiers.knowledge import RobotKnowledge
from entropy_explore_env.frontiers.visibility import VisibilityCounter
from entropy_explore_env.frontiers.voxel_states import VoxelStates
from entropy_explore_env.scenario import Scenario
from entropy_explore_env.settings import RobotKind
from entropy_explore_env.validation import check, check_choice, check_positive
from entropy_explore_env.viewpoints.evaluation import sees_all_around

Visibility = Literal["ray-cast", "naive"]
UnexploredGround = Literal["falling", "level"]
KNOWN_SIGMA = 0.5
"""σ from which on a voxel is known: a single measurement of our sensors brings it far below."""
BATCH_CELLS = 7500
"""Cells that are visited in about the time of a Python call."""
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
        unexplored_ground: Over terrain, the assumed shape of unexplored ground: `falling` from z_av
            at the candidate to the workspace's floor where the range ends (sect. 3.4), or `level` at z_av.

    Raises:
        SettingError: A field has another value.
    """

    spacing_m: float | None = None
    visibility: Visibility = "ray-cast"
    gamma: float | None = 0.5
    unexplored_ground: UnexploredGround = "falling"

    def __post_init__(self) -> None:
        """Check every field."""
        if self.spacing_m is not None:
            check_positive(self, "spacing_m")
        check_choice(self, "visibility", Visibility)
        check_choice(self, "unexplored_ground", UnexploredGround)
        if self.gamma is not None:
            check(self, "gamma", "None, or a number from 0 to 1", lambda v: 0.0 <= v <= 1.0)


class Chart(NamedTuple):
    """What a robot knows, seen from above, for pictures; (X, Y) each."""

    mapped: np.ndarray
    """bool"""
    covered: np.ndarray
    """bool, walls; over terrain none."""
    edge: np.ndarray
    """bool, mapped beside unexplored."""
    ground: np.ndarray
    """float64, height of the ground above the floor in voxel edges; NaN = not mapped, or a plan."""


class FrontierMap(ABC):
    """Candidates of one robot's belief, each in a slot, and V(height factor) of each in points.

    Attributes:
        reach: Of the sensor, in voxel edges; no more than the workspace is wide.
        point: Size of a point: m² in plans and over terrain, else m³.
        batch: How many candidates are counted in one call; it changes no result.
        traversal_cost: (V,) float32, 1 in the mapped region, else inf; read-only.
        body_reach: Voxels that the body extends beyond its own, along an axis.
    """

    point: float
    batch: int
    body_reach: int
    _states: VoxelStates
    _counter: VisibilityCounter
    _costs: np.ndarray
    """(V,) float32 traversal costs."""
    _voxels: np.ndarray
    """(S,) int32, the voxel of the candidate in each slot; NONE = there is none."""
    _bounds: np.ndarray
    """(S,) float64, upper bounds of its V·(height factor); inf = unknown."""
    _marks: np.ndarray
    """(V,) uint8, EXCLUDED where a scan was taken."""

    def __init__(self, scenario: Scenario, kind: RobotKind, frontiers: FrontierConfig) -> None:
        """Nothing is explored yet."""
        grid = scenario.grid
        self._config, self._size, self._edge = frontiers, grid.shape, grid.voxel_size_m
        self._prior, self._naive = scenario.sigma_prior**-2, frontiers.visibility == "naive"
        self.reach = min(kind.sensor.max_range_m / self._edge, float(sum(grid.shape)))
        self._spacing = max(round((frontiers.spacing_m or self.reach * self._edge / 6.0) / self._edge), 1)
        """Voxels between candidates."""

    @property
    def traversal_cost(self) -> np.ndarray:
        """See above."""
        view = self._costs.view()
        view.setflags(write=False)
        return view

    @abstractmethod
    def update(self, view: RobotKnowledge, sigma: float) -> None:
        """Bring the map up to date with the belief; σ is the level that counts as explored now."""

    @abstractmethod
    def mapped_share(self) -> float:
        """Return the share of all points that are mapped."""

    @abstractmethod
    def chart(self) -> Chart:
        """Return what is known, seen from above; in 3-D the union over all heights."""

    @abstractmethod
    def upper_bounds(self, slots: np.ndarray) -> np.ndarray:
        """Return (K,) upper bounds of V·(height factor) of the candidates in (K,) slots."""

    @abstractmethod
    def count(self, slots: np.ndarray, voxels: np.ndarray) -> np.ndarray:
        """Return (K,) V·(height factor): points expected to be seen, weighted by promises."""

    @abstractmethod
    def promise(self, place: np.ndarray) -> None:
        """Note that a robot will scan at (3,), grid units: it promises to see the points visible there."""

    @abstractmethod
    def replace_unreached(self, cost: np.ndarray) -> None:
        """Replace candidates that no path reaches by others of their blocks; (V,) float64 path costs."""

    @abstractmethod
    def _refresh(self, voxels: np.ndarray, radius: int) -> None:
        """Find the candidates anew within a radius of (K,) voxels."""

    @abstractmethod
    def _gaze_pitches(self, view: RobotKnowledge) -> Sequence[float]:
        """Return the pitches between which a gaze is chosen."""

    @abstractmethod
    def _points_ahead(
        self, place: np.ndarray, view: RobotKnowledge, pitch: float, yaws: Sequence[float]
    ) -> list[int]:
        """Return how many points are seen from (3,), grid units, with gazes of one pitch."""

    def listed(self, all_of_them: bool = False) -> tuple[np.ndarray, np.ndarray]:
        """Return (K,) slots and (K,) int32 voxels of candidates: all, or those that may see something."""
        slots = np.flatnonzero((self._voxels != NONE) & (all_of_them | (self._bounds > 0.0)))
        return slots, self._voxels[slots]

    def voxels_of(self, slots: np.ndarray | slice) -> np.ndarray:
        """Return (K,) int32 voxels of the candidates in some slots; NONE = there is none."""
        return self._voxels[slots]

    def expected(self, place: np.ndarray) -> np.ndarray:
        """Return (X, Y) bool, columns with points that are expected to be seen from (3,), grid units."""
        self.promise(place)
        found = self._counter.promised > 0
        self.release()
        return np.asarray(found.reshape(*self._size[:2], -1).any(2))

    def release(self) -> None:
        """Forget all promises."""
        counter = self._counter
        counter.promised[counter.promised_points[: counter.promised_count[0]]] = 0
        counter.promised_count[0] = 0

    def exclude(self, voxel: int) -> None:
        """Note that a scan was taken in a voxel: it is no candidate any more."""
        self._marks[voxel] |= EXCLUDED
        self._refresh(np.array([voxel]), 0)

    def drop(self, voxel: int, with_edges: bool) -> None:
        """Take out a candidate that could not be reached, or from which a scan explored nothing."""
        del with_edges
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
        del voxel
        return []

    def close(self, voxels: list[int]) -> None:
        """Make the voxels of `open_start` impassable again."""
        self._costs[voxels] = np.inf

    def gaze(self, place: np.ndarray, view: RobotKnowledge) -> tuple[float, float]:
        """Return the (yaw, pitch) in which most is seen from (3,), grid units; as it is if none sees more."""
        turns = 1 if sees_all_around(view.kind.sensor) else _HEADINGS
        yaws = [float(view.pose[3]) + turn * (_TURN / _HEADINGS) for turn in range(turns)]
        pitches = self._gaze_pitches(view)
        if len(pitches) * turns == 1:
            return yaws[0], pitches[0]
        best = int(np.argmax([self._points_ahead(place, view, pitch, yaws) for pitch in pitches]))
        return (yaws[best % turns] + math.pi) % _TURN - math.pi, pitches[best // turns]

    def _levels(self, sigma: float) -> tuple[np.float32, np.float32]:
        """Return the precisions from which on a voxel counts as explored now, at σ, and as mapped."""
        least = self._prior * (1.0 + 1e-6)
        return np.float32(max(sigma**-2, least)), np.float32(max(KNOWN_SIGMA**-2, least))

    def _axes_of(self, voxels: np.ndarray) -> np.ndarray:
        """Return (K, 3) indices of (K,) voxels."""
        return np.stack(np.unravel_index(voxels, self._size), axis=-1)
