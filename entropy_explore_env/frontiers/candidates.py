"""Candidates of a robot's own belief, and what is expected to be seen from them: one form for all kinds.

Two kinds: voxel/candidates.py, in plans and in any 3-D space, and terrain/candidates.py, over a height field.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Generic, Literal, NamedTuple, Protocol, TypeVar

import numpy as np

from entropy_explore_env.frontiers.knowledge import RobotKnowledge
from entropy_explore_env.frontiers.voxel_map import (
    EXCLUDED,
    NONE,
    queue_block,
)
from entropy_explore_env.frontiers.voxel_visibility import (
    VisibilityCounter,
    clear_promises,
)
from entropy_explore_env.scenario import Scenario
from entropy_explore_env.settings import RobotKind
from entropy_explore_env.validation import check, check_choice, check_positive

Visibility = Literal["ray-cast", "naive"]
UnexploredGround = Literal["falling", "level"]
KNOWN_SIGMA = 0.5
"""σ from which on a voxel is known: a single measurement of our sensors brings it far below."""
BATCH_CELLS = 7500
"""Cells that are visited in about the time of a Python call."""


@dataclass(frozen=True)
class FrontierConfig:
    """Where candidates lie, and how V is counted.

    Attributes:
        spacing_m: Distance between candidates, at least a voxel; None = a sixth of the range.
        rise_m: Vertical distance between candidates, over terrain; None = a sixth of the range.
        visibility: `ray-cast`, or the `naive` count of all unexplored points in a ball.
        gamma: γ of the height factor: relative height against absolute height. None = no height factor.
        patch_m: Half the width of the patch whose mean ground is z_av.
        unexplored_ground: Over terrain, the assumed shape of unexplored ground: `falling` from z_av
            at the candidate to the workspace's floor where the range ends (sect. 3.4), or `level` at z_av.
        too_high: Candidates higher above z_av than this share of the range are dropped.

    Raises:
        SettingError: A field has another value.
    """

    spacing_m: float | None = None
    rise_m: float | None = None
    visibility: Visibility = "ray-cast"
    gamma: float | None = 0.5
    patch_m: float = 5.0
    unexplored_ground: UnexploredGround = "falling"
    too_high: float = 0.9

    def __post_init__(self) -> None:
        """Check every field."""
        for name in ("spacing_m", "rise_m"):
            if getattr(self, name) is not None:
                check_positive(self, name)
        check_choice(self, "visibility", Visibility)
        check_choice(self, "unexplored_ground", UnexploredGround)
        if self.gamma is not None:
            check(self, "gamma", "None, or a number from 0 to 1", lambda v: 0.0 <= v <= 1.0)
        check_positive(self, "patch_m", "too_high")

    def levels(self, sigma: float, prior_precision: float) -> tuple[np.float32, np.float32]:
        """The precisions from which on a voxel counts as explored now, at σ, and as mapped."""
        explored, mapped = (
            np.float32(max(level**-2, prior_precision * (1.0 + 1e-6))) for level in (sigma, KNOWN_SIGMA)
        )
        return explored, mapped


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


class BlockMap(Protocol):
    """What candidates of both kinds need of their map; B slots, V voxels."""

    @property
    def traversal_cost(self) -> np.ndarray:
        """(V,) float32 traversal costs."""
        ...

    @property
    def voxel(self) -> np.ndarray:
        """(B,) int32, the candidate in a slot; NONE = there is none."""
        ...

    @property
    def seen(self) -> np.ndarray:
        """(B,) float32, upper bounds of the points that can be seen from it."""
        ...


Map = TypeVar("Map", bound=BlockMap)


class Candidates(ABC, Generic[Map]):
    """Candidates of one robot's belief, in a few slots for each block of its map, and their V in points.

    Attributes:
        reach: Of the sensor, in voxel edges; no more than the workspace is wide.
        point: Size of a point: m² in plans and over terrain, else m³.
        batch: How many candidates are counted in one call; it changes no result.
        traversal_cost: (V,) float32, 1 in the mapped region, else inf; read-only.
    """

    _map: Map
    _size: tuple[int, int, int]
    _counter: VisibilityCounter
    _excluded: np.ndarray
    """(V,) uint8, EXCLUDED where a scan was taken."""
    point: float
    batch: int

    def __init__(self, scenario: Scenario, kind: RobotKind, frontiers: FrontierConfig) -> None:
        """Nothing is explored yet."""
        grid = scenario.grid
        self._config, self._size = frontiers, grid.shape
        self._prior = scenario.sigma_prior**-2
        self.reach = min(kind.sensor.max_range_m / grid.voxel_size_m, float(sum(grid.shape)))

    @property
    def traversal_cost(self) -> np.ndarray:
        """See above."""
        view = self._map.traversal_cost.view()
        view.setflags(write=False)
        return view

    @abstractmethod
    def update(self, view: RobotKnowledge, sigma: float) -> None:
        """Bring the candidates up to date with the belief; σ is the level that counts as explored now."""

    @abstractmethod
    def mapped_share(self) -> float:
        """Share of all points that are mapped."""

    @abstractmethod
    def chart(self) -> Chart:
        """What is known, seen from above; in 3-D the union over all heights."""

    @abstractmethod
    def upper_bounds(self, slots: np.ndarray) -> np.ndarray:
        """(K,) upper bounds of V·(height factor) in points; inf = unknown."""

    @abstractmethod
    def greatest_visibility(self) -> float:
        """An upper bound of V·(height factor) of any place."""

    @abstractmethod
    def count(self, slots: np.ndarray, voxels: np.ndarray) -> np.ndarray:
        """(K,) V·(height factor): points expected to be seen, weighted by promises."""

    @abstractmethod
    def count_together(self, slot: int, places: np.ndarray) -> float:
        """V·(height factor) of a candidate whose V was counted, seen from any of (N, 3), grid units."""

    @abstractmethod
    def promise(self, place: np.ndarray) -> None:
        """Note that a robot will scan at (3,), grid units: it promises to see the points visible there."""

    @abstractmethod
    def replace_unreached(self, cost: np.ndarray) -> None:
        """Replace candidates that no path reaches by others of their blocks; (V,) float64 path costs."""

    @abstractmethod
    def gaze(self, place: np.ndarray, view: RobotKnowledge) -> tuple[float, float]:
        """(yaw, pitch) in which most is seen from (3,), grid units; unchanged if it does not matter."""

    @abstractmethod
    def _block_of(self, x: int, y: int, z: int) -> int:
        """Number of the block of a voxel."""

    @abstractmethod
    def _update_blocks(self, count: int) -> None:
        """Update the candidates of the first `count` queued blocks."""

    def listed(self, all_of_them: bool = False) -> tuple[np.ndarray, np.ndarray]:
        """(K,) slots of the candidates, and (K,) int32 their voxels; not those from which nothing is seen."""
        slots = np.flatnonzero((self._map.voxel != NONE) & (all_of_them | (self._map.seen > 0.0)))
        return slots, self._map.voxel[slots]

    def voxels_of(self, slots: np.ndarray | slice) -> np.ndarray:
        """(K,) int32, voxels of the candidates in some slots; NONE = there is none."""
        return self._map.voxel[slots]

    def expected(self, place: np.ndarray) -> np.ndarray:
        """(X, Y) bool, columns with points that are expected to be seen from (3,), grid units."""
        self.promise(place)
        found = np.zeros(self._counter.stamp.size, bool)
        found[self._counter.promised_points[: self._counter.promised_count[0]]] = True
        self.release()
        return np.asarray(found.reshape(*self._size[:2], -1).any(2))

    def release(self) -> None:
        """Forget all promises."""
        clear_promises(self._counter)

    def exclude(self, voxel: int) -> None:
        """A scan was taken in a voxel: it is no candidate any more."""
        self._excluded[voxel] |= EXCLUDED
        self._update_blocks(queue_block(self._map, self._block_of(*self._axes_of(voxel)), 0))

    def readmit(self) -> None:
        """Let all excluded places be candidates again, for a finer level."""
        excluded, count = np.flatnonzero(self._excluded & EXCLUDED), 0
        self._excluded[excluded] &= np.uint8(~EXCLUDED & 0xFF)
        for voxel in excluded:
            count = queue_block(self._map, self._block_of(*self._axes_of(int(voxel))), count)
        self._update_blocks(count)

    def is_known_free(self, voxel: int) -> bool:
        """Whether the body may be in a voxel, by what is known."""
        return math.isfinite(self._map.traversal_cost[voxel])

    def open_start(self, voxel: int) -> list[int]:
        """Make the place where a robot stands passable; returns the numbers of the voxels that were not."""
        del voxel
        return []

    def close(self, voxels: list[int]) -> None:
        """Make the voxels of `open_start` impassable again."""
        self._map.traversal_cost[voxels] = np.inf

    def _axes_of(self, voxel: int) -> tuple[int, int, int]:
        x, y, z = np.unravel_index(voxel, self._size)
        return int(x), int(y), int(z)

    def _spacing(self, wanted_m: float | None, edge_m: float) -> int:
        """Voxels between candidates for a distance in metres; None = a sixth of the range."""
        return max(round((wanted_m or self.reach * edge_m / 6.0) / edge_m), 1)


def as_tuple(place: np.ndarray) -> tuple[float, float, float]:
    """(x, y, z), for which kernels are compiled."""
    return float(place[0]), float(place[1]), float(place[2])
