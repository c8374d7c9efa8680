"""Candidates of a robot's own belief, in plans and in any 3-D space, and the voxels to be seen from them.

What was counted is kept: as no more voxels can be seen from a candidate than before while the map grows, it
is an upper bound of what a new count would give. Only through walls that turned out free more may be seen,
which is added. Over a height field: terrain_candidates.py.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Generic, Literal, NamedTuple, Protocol, TypeVar

import numpy as np

from baselines.expected_view import (
    Tally,
    add_opened,
    clear_promises,
    count_crossed,
    count_from,
    count_in_ball,
    count_in_balls,
    new_tally,
    rays_around,
    rays_towards,
)
from baselines.frontier_map import (
    COVERED,
    EDGE,
    NONE,
    OPENED,
    SPENT,
    UNMAPPED,
    FrontierMap,
    choose_reached,
    look_at_blocks,
    new_frontier_map,
    put_block,
    take_in,
)
from baselines.ray_tree import grow_tree
from entropy_explore_env.config import Scenario
from entropy_explore_env.missions.view import RobotView
from entropy_explore_env.settings import RobotKind
from entropy_explore_env.validation import check, check_choice, check_positive

Visibility = Literal["ray-cast", "naive"]
UnexploredGround = Literal["falling", "level"]
BATCH_CELLS = 7500
"""Cells that are walked in about the time that a call takes."""
_ROWS = 15
"""Rows of imagined rays for robots that look up and down."""


@dataclass(frozen=True)
class Looking:
    """What counts as explored, where candidates lie, and how V is counted.

    Attributes:
        sigma: σ at which a voxel is explored, and mapped.
        spacing_m: Candidates lie about so far apart; never nearer than a voxel. None = a sixth of the range.
        rise_m: The same above each other, over terrain; None = a sixth of the range.
        visibility: `ray-cast`, or the `naive` count of all unexplored points in a ball.
        gamma: γ of the height factor: relative height against absolute height. None = no height factor.
        patch_m: Half the width of the patch whose mean ground is z_av.
        unexplored_ground: Over terrain, what is assumed of ground that is not explored: `falling` from z_av
            at the candidate to the workspace's floor where the range ends (sect. 3.4), or `level` at z_av.
        too_high: Candidates higher above z_av than this share of the range are dropped.

    Raises:
        SettingError: A field is none of these.
    """

    sigma: float = 0.5
    spacing_m: float | None = None
    rise_m: float | None = None
    visibility: Visibility = "ray-cast"
    gamma: float | None = 0.5
    patch_m: float = 5.0
    unexplored_ground: UnexploredGround = "falling"
    too_high: float = 0.9

    def __post_init__(self) -> None:
        """Check every field."""
        check(self, "sigma", "a number from 1e-4 to 1e4", lambda v: 1e-4 <= v <= 1e4)
        for name in ("spacing_m", "rise_m"):
            if getattr(self, name) is not None:
                check_positive(self, name)
        check_choice(self, "visibility", Visibility)
        check_choice(self, "unexplored_ground", UnexploredGround)
        if self.gamma is not None:
            check(self, "gamma", "None, or a number from 0 to 1", lambda v: 0.0 <= v <= 1.0)
        check_positive(self, "patch_m", "too_high")

    def levels(self, sigma: float, prior_precision: float) -> tuple[np.float32, np.float32]:
        """What `take_in` takes, where σ is the level that counts as explored now."""
        explored, mapped = (
            np.float32(max(level**-2, prior_precision * (1.0 + 1e-6))) for level in (sigma, self.sigma)
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
    """What candidates of all kinds need of their map; B slots, V voxels."""

    @property
    def rates(self) -> np.ndarray:
        """(V,) float32, what ways cost."""
        ...

    @property
    def voxel(self) -> np.ndarray:
        """(B,) int32, the candidate in a slot; NONE = there is none."""
        ...

    @property
    def seen(self) -> np.ndarray:
        """(B,) float32, no fewer points than can be seen from it."""
        ...


Map = TypeVar("Map", bound=BlockMap)


class Candidates(ABC, Generic[Map]):
    """Candidates of one robot's belief, a few slots for each block of its map, and V of each: points seen.

    Attributes:
        reach: Of the sensor, in voxel edges; no more than the workspace is wide.
        point: Size of a point: m² in plans and over terrain, else m³.
        batch: How many candidates are worth counting at once; changes no result.
        rates: (V,) float32, what ways cost in the mapped region; read-only.
    """

    _map: Map
    _tally: Tally
    _spent: np.ndarray
    """(V,) uint8, SPENT where a scan was taken."""
    point: float
    batch: int

    def __init__(self, scenario: Scenario, kind: RobotKind, looking: Looking) -> None:
        """Nothing is explored yet."""
        grid = scenario.grid
        self._looking, self._size = looking, grid.shape
        self._prior = scenario.sigma_prior**-2
        self.reach = min(kind.sensor.max_range_m / grid.voxel_size_m, float(sum(grid.shape)))

    @property
    def rates(self) -> np.ndarray:
        """See above."""
        view = self._map.rates.view()
        view.setflags(write=False)
        return view

    @abstractmethod
    def update(self, view: RobotView, sigma: float) -> None:
        """Take the belief in; σ is the level that counts as explored now."""

    @abstractmethod
    def mapped_share(self) -> float:
        """Share of all points that are mapped."""

    @abstractmethod
    def chart(self) -> Chart:
        """What is known, in space all heights laid over each other."""

    @abstractmethod
    def most(self, slots: np.ndarray) -> np.ndarray:
        """(K,) no fewer points than V·(height factor) of each; inf = nothing is known of it yet."""

    @abstractmethod
    def limit(self) -> float:
        """No V·(height factor) is more than this, from anywhere."""

    @abstractmethod
    def count(self, slots: np.ndarray, voxels: np.ndarray) -> np.ndarray:
        """(K,) V·(height factor): points expected to be seen, weighed by promises; 0 = nothing at all."""

    @abstractmethod
    def promise(self, place: np.ndarray) -> None:
        """Somebody will scan at (3,), grid units: what is seen from there is promised once more."""

    @abstractmethod
    def other_of(self, cost: np.ndarray) -> None:
        """Blocks whose candidate was not reached may have one that was; (V,) float64 costs, inf = not."""

    @abstractmethod
    def gaze(self, place: np.ndarray, view: RobotView) -> tuple[float, float]:
        """(yaw, pitch) in which most is seen from (3,), grid units; as it is for who sees all around."""

    @abstractmethod
    def _block_of(self, x: int, y: int, z: int) -> int:
        """Number of the block of a voxel."""

    @abstractmethod
    def _look_at(self, count: int) -> None:
        """Choose the candidates of the blocks that were put first in line."""

    def found(self, all_of_them: bool = False) -> tuple[np.ndarray, np.ndarray]:
        """(K,) slots of the candidates, and (K,) int32 their voxels; those that show nothing if asked for."""
        slots = np.flatnonzero((self._map.voxel != NONE) & (all_of_them | (self._map.seen > 0.0)))
        return slots, self._map.voxel[slots]

    def voxels_of(self, slots: np.ndarray | slice) -> np.ndarray:
        """(K,) int32, voxels of some candidates; NONE = there is none."""
        return self._map.voxel[slots]

    def expected(self, place: np.ndarray) -> np.ndarray:
        """(X, Y) bool, what is expected to be seen from (3,), grid units, above or below each other."""
        self.promise(place)
        found = np.zeros(self._tally.stamp.size, bool)
        found[self._tally.marked[: self._tally.numbers[1]]] = True
        self.release()
        return np.asarray(found.reshape(*self._size[:2], -1).any(2))

    def release(self) -> None:
        """Forget all promises."""
        clear_promises(self._tally)

    def spend(self, voxel: int) -> None:
        """A scan was taken in a voxel: it is no candidate any more."""
        self._spent[voxel] |= SPENT
        self._look_at(put_block(self._map, self._block_of(*self._axes_of(voxel)), 0))

    def unspend(self) -> None:
        """Any place may be a candidate again: more is asked for from now on."""
        spent, count = np.flatnonzero(self._spent & SPENT), 0
        self._spent[spent] &= np.uint8(~SPENT & 0xFF)
        for voxel in spent:
            count = put_block(self._map, self._block_of(*self._axes_of(int(voxel))), count)
        self._look_at(count)

    def open_start(self, voxel: int) -> list[int]:
        """Let a robot leave the place where it stands: voxels by number that were closed."""
        del voxel
        return []

    def close(self, voxels: list[int]) -> None:
        """Close what `open_start` opened."""
        self._map.rates[voxels] = np.inf

    def _axes_of(self, voxel: int) -> tuple[int, int, int]:
        x, y, z = np.unravel_index(voxel, self._size)
        return int(x), int(y), int(z)

    def _spacing(self, wanted_m: float | None, edge_m: float) -> int:
        """Voxels from a candidate to the next: so many metres, or None = a sixth of the range."""
        return max(round((wanted_m or self.reach * edge_m / 6.0) / edge_m), 1)


class VoxelCandidates(Candidates[FrontierMap]):
    """Candidates and counts in a map of voxels; the points of V are voxels."""

    def __init__(self, scenario: Scenario, kind: RobotKind, looking: Looking) -> None:
        """Nothing is explored yet."""
        super().__init__(scenario, kind, looking)
        grid, layer = scenario.grid, scenario.layer_of(kind.robot)
        edge = grid.voxel_size_m
        spacing = self._spacing(looking.spacing_m, edge)
        self._map = new_frontier_map(grid.shape, kind.robot.body_radius_m / edge, layer, spacing)
        self._spent = self._map.flags
        self._tally = new_tally(grid.voxels, grid.shape)
        self._pitches = _pitches(kind, layer is None)
        self._directions = rays_around(self.reach, self._pitches)
        self._tree = grow_tree(self._directions, self.reach, grid.shape)
        self._met = np.empty(self._tree.cells, np.int32)
        self.batch = 1 + BATCH_CELLS // self._tree.cells
        self.point = edge ** (2 if grid.flat else 3)

    def update(self, view: RobotView, sigma: float) -> None:
        """See `Candidates`."""
        mean, precision = view.mean.reshape(-1), view.precision.reshape(-1)
        take_in(self._map, mean, precision, self._looking.levels(sigma, self._prior))
        count, bounds = int(self._map.opened_count[0]), self._map.seen
        self._map.opened_count[0] = 0
        if count > OPENED:
            bounds[:] = math.inf
        elif count > 0 and self._looking.visibility == "ray-cast":
            arrays = self._map.opened[:count], self._map.voxel, self._tree, self._met
            add_opened(self._tally, self._map.state, self._size, *arrays, bounds)

    def mapped_share(self) -> float:
        """See `Candidates`."""
        return float((self._map.state & UNMAPPED == 0).mean())

    def chart(self) -> Chart:
        """See `Candidates`."""
        state, edge = self._map.state.reshape(self._size), self._map.flags.reshape(self._size) & EDGE > 0
        mapped, covered = state & UNMAPPED == 0, state & COVERED > 0
        if self._map.layer >= 0:
            mapped, covered, edge = (a[:, :, self._map.layer, None] for a in (mapped, covered, edge))
        return Chart(mapped.any(2), covered.any(2), edge.any(2), np.full(self._size[:2], np.nan))

    def most(self, slots: np.ndarray) -> np.ndarray:
        """See `Candidates`."""
        return self._map.seen[slots].astype(np.float64)

    def limit(self) -> float:
        """See `Candidates`."""
        wide = self.reach + 2.0
        within = math.pi * wide**2 if self._size[2] == 1 else 4.0 / 3.0 * math.pi * wide**3
        return float(min(within, self._tally.stamp.size))

    def count(self, slots: np.ndarray, voxels: np.ndarray) -> np.ndarray:
        """See `Candidates`."""
        seen, weighed = np.empty(len(slots)), np.empty(len(slots))
        arrays = self._tally, self._map.state, self._size, voxels
        if self._looking.visibility == "naive":
            count_in_balls(*arrays, self.reach, seen, weighed)
        else:
            count_from(*arrays, self._tree, self._met, seen, weighed)
        self._map.seen[slots] = seen
        return weighed

    def promise(self, place: np.ndarray) -> None:
        """See `Candidates`."""
        start = as_tuple(place)
        if self._looking.visibility == "naive":
            count_in_ball(self._tally, self._map.state, self._size, start, self.reach, True)
        else:
            count_crossed(self._tally, self._map.state, self._size, start, self._directions, self.reach, True)

    def _block_of(self, x: int, y: int, z: int) -> int:
        """See `Candidates`."""
        across, blocks = self._map.across, self._map.blocks
        return (x // across[0] * blocks[1] + y // across[1]) * blocks[2] + z // across[2]

    def _look_at(self, count: int) -> None:
        """See `Candidates`."""
        look_at_blocks(self._map, count)

    def other_of(self, cost: np.ndarray) -> None:
        """See `Candidates`."""
        for slot in np.flatnonzero(self._map.voxel != NONE):
            if math.isfinite(cost[self._map.voxel[slot]]):
                continue
            voxel = choose_reached(self._map, cost, slot)
            if voxel != NONE:
                self._map.voxel[slot], self._map.seen[slot] = voxel, math.inf

    def open_start(self, voxel: int) -> list[int]:
        """See `Candidates`."""
        opened, (x, y, z) = [], self._axes_of(voxel)
        for offset in self._map.ball:
            place = x + offset[0], y + offset[1], z + offset[2]
            if all(0 <= i < n for i, n in zip(place, self._size, strict=True)):
                beside = int(np.ravel_multi_index(place, self._size))
                if (
                    math.isinf(self._map.rates[beside])
                    and self._map.state[beside] & (UNMAPPED | COVERED) == 0
                ):
                    opened.append(beside)
        self._map.rates[opened] = 1.0
        return opened

    def gaze(self, place: np.ndarray, view: RobotView) -> tuple[float, float]:
        """See `Candidates`."""
        sensor, yaw = view.kind.sensor, float(view.pose[3])
        turn, tilt = sensor.field_of_view_rad
        all_around = turn > 2.0 * math.pi - 1.5 * sensor.angular_step_rad
        if all_around and view.planar:
            return yaw, 0.0
        best, gaze = -1, (yaw, 0.0)
        for pitch in (0.0,) if view.planar else (0.0, -0.7, 0.7):
            pitches = self._pitches if view.planar else np.linspace(pitch - tilt / 2, pitch + tilt / 2, 5)
            for way in range(1 if all_around else 16):
                heading = yaw + way * (2.0 * math.pi / 16)
                rays = rays_towards(np.linspace(heading - turn / 2, heading + turn / 2, 24), pitches)
                arrays = self._map.state, self._size, as_tuple(place), rays
                points, _ = count_crossed(self._tally, *arrays, self.reach, False)
                if points > best:
                    best, gaze = points, ((heading + math.pi) % (2.0 * math.pi) - math.pi, pitch)
        return gaze


def _pitches(kind: RobotKind, flies: bool) -> np.ndarray:
    """(rows,) pitches of imagined rays: all for who flies, those of the sensor for who looks level."""
    tilt = kind.sensor.field_of_view_rad[1]
    if flies:
        return (np.arange(_ROWS) + 0.5) * (math.pi / _ROWS) - math.pi / 2
    rows = min(kind.sensor.rows, _ROWS)
    return np.linspace(-tilt / 2, tilt / 2, rows) if rows > 1 else np.zeros(1)


def as_tuple(place: np.ndarray) -> tuple[float, float, float]:
    """(x, y, z), for which kernels are compiled."""
    return float(place[0]), float(place[1]), float(place[2])
