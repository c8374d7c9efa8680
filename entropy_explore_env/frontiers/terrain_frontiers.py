"""The frontier of a height field below an exposure surface: candidates above it, and columns to be seen.

Points are columns (Sawhney 2009). A column is explored once the voxel of its surface is: the highest one that
is known and believed covered, with a known free voxel above it. Robots may be between the ground and the
exposure surface of explored columns, whether or not a ray went through that air. Columns lie in blocks as
cells do; the one that represents a block has candidates at several heights (sect. 3.2). Grid units: heights
are in layers.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from entropy_explore_env.belief.voxel_index import flat_index
from entropy_explore_env.compilation.kernels import inlined_kernel, lean_kernel
from entropy_explore_env.frontiers.blocks import (
    CANDIDATE,
    NONE,
    ROOM,
    Blocks,
    block_span,
    choose_candidate,
    mark_changed,
    mark_edges,
    new_blocks,
    replace_unreached,
    set_flag,
)
from entropy_explore_env.frontiers.frontier_map import FrontierConfig, FrontierMap
from entropy_explore_env.frontiers.terrain_visibility import (
    ViewModel,
    count_below,
    count_columns_from,
    count_columns_in_ball,
    fill_height_factors,
    mean_ground,
)
from entropy_explore_env.frontiers.visibility import yaws_around
from entropy_explore_env.frontiers.voxel_map import body_footprint
from entropy_explore_env.frontiers.voxel_states import (
    COVERED,
    UNEXPLORED,
    UNMAPPED,
    VoxelStates,
    new_states,
    note_opened,
    update_states,
)
from entropy_explore_env.robots.knowledge import RobotKnowledge
from entropy_explore_env.settings.robot_kind import RobotKind
from entropy_explore_env.settings.scenario import Scenario

PATCH_M = 5.0
"""Half the width of the patch whose mean ground is z_av."""
TOO_HIGH = 0.9
"""Candidates higher above z_av than this share of the range are dropped."""


class TerrainMap(NamedTuple):
    """What is read off one robot's belief of a height field; B blocks of columns, H heights each."""

    states: VoxelStates
    columns: Blocks
    """Of which a column's state is that of its surface, UNEXPLORED and UNMAPPED where it has none."""
    ground: np.ndarray
    """(X, Y) int32, solid layers of a mapped column; NONE = not mapped."""
    excluded: np.ndarray
    """(V,) uint8, EXCLUDED where a scan was taken."""
    traversal_cost: np.ndarray
    """(V,) float32, 1 where the body may be, else inf."""
    voxel: np.ndarray
    """(B, H) int32, candidates; NONE = none at this height."""
    ceiling: np.ndarray
    """(X, Y) int32, lowest layer of the no-fly zone."""
    size: tuple[int, int, int]
    rise: int
    """Layers between two candidates above each other."""
    footprint: np.ndarray
    """(N, 3) int64 index offsets of the voxels that the body touches."""


def new_terrain_map(
    shape: tuple[int, int, int], body_radius: float, spacing: int, ceiling: np.ndarray
) -> TerrainMap:
    """Return a map of which nothing is explored.

    Args:
        shape: (X, Y, Z) voxels.
        body_radius: In voxel edges.
        spacing: Voxels between candidates, along all axes.
        ceiling: (X, Y) lowest layer of the no-fly zone.
    """
    footprint, states = body_footprint(shape, body_radius, None), new_states(shape, math.prod(shape))
    reach, voxels = int(np.abs(footprint).max()), math.prod(shape)
    square = np.array([(x, y, 0) for x in range(-reach, reach + 1) for y in range(-reach, reach + 1)])
    state = np.full(shape[0] * shape[1], UNEXPLORED | UNMAPPED, np.uint8)
    columns = new_blocks((*shape[:2], 1), state, square, 0, spacing)
    return TerrainMap(
        states=states,
        columns=columns,
        ground=np.full(shape[:2], NONE, np.int32),
        excluded=np.zeros(voxels, np.uint8),
        traversal_cost=np.full(voxels, np.inf, np.float32),
        voxel=np.full((len(columns.candidate), math.ceil(shape[2] / spacing)), NONE, np.int32),
        ceiling=np.ascontiguousarray(ceiling, np.int32).copy(),
        size=states.size,
        rise=spacing,
        footprint=footprint,
    )


@lean_kernel
def update_terrain(terrain, mean, precision, levels):
    """Bring a TerrainMap up to date with a belief; arguments and result as of `update_states`."""
    columns, before = terrain.columns, NONE
    changed = update_states(terrain.states, mean, precision, levels, 0, len(mean))
    for voxel in terrain.states.changed[:changed]:
        column = voxel // terrain.size[2]
        if column != before:
            if _find_ground(terrain, column):
                note_opened(terrain.states, voxel)
            mark_changed(columns, column)
            before = column
    update_columns(terrain)
    return changed


@lean_kernel
def update_columns(terrain):
    """Find the edge, the free space and the candidates of the blocks that have to be updated."""
    columns = terrain.columns
    mark_edges(columns)
    for block in range(len(columns.dirty)):
        if columns.dirty[block]:
            _find_room(terrain, block)
            choose_candidate(columns, block)
            take_column(terrain, block)


@lean_kernel
def _find_ground(terrain, column):
    """Find a column's ground from its voxels' states; return whether its state changed."""
    x, y = column // terrain.size[1], column % terrain.size[1]
    high, state = terrain.size[2], terrain.states.state
    ground, now = NONE, UNEXPLORED | UNMAPPED
    for layer in range(high - 1, -1, -1):
        voxel = column * high + layer
        if state[voxel] & COVERED:
            if layer == high - 1 or state[voxel + 1] & (UNMAPPED | COVERED) == 0:
                ground, now = layer + 1, state[voxel] & UNEXPLORED
            break
    different = ground != terrain.ground[x, y] or now != terrain.columns.state[column]
    terrain.ground[x, y], terrain.columns.state[column] = ground, now
    return different


@lean_kernel
def _find_room(terrain, block):
    """Set traversal costs in a block, and ROOM where there is a candidate above a column."""
    low, high = block_span(terrain.columns, block)
    for x in range(low[0], high[0]):
        for y in range(low[1], high[1]):
            column = x * terrain.size[1] + y
            for z in range(terrain.size[2]):
                voxel = column * terrain.size[2] + z
                terrain.traversal_cost[voxel] = 1.0 if _may_fly(terrain, x, y, z) else math.inf
            room = False
            for height in range(terrain.voxel.shape[1]):
                room = room or _at_height(terrain, column, height) != NONE
            set_flag(terrain.columns, column, ROOM, room)


@lean_kernel
def _may_fly(terrain, x, y, z):
    """Return whether a body's footprint is above mapped ground, below the ceiling and not covered."""
    size = terrain.size
    for offset in terrain.footprint:
        i, j, k = x + offset[0], y + offset[1], z + offset[2]
        if not (0 <= i < size[0] and 0 <= j < size[1] and 0 <= k < size[2]):
            return False
        ground = terrain.ground[i, j]
        if ground == NONE or k < ground or k >= terrain.ceiling[i, j]:
            return False
        if terrain.states.state[flat_index(size, i, j, k)] & COVERED:
            return False
    return True


@inlined_kernel
def _at_height(terrain, column, height):
    """Return the voxel at a height above a column; NONE where a body cannot be, or has scanned."""
    ground = terrain.ground[column // terrain.size[1], column % terrain.size[1]]
    layer = ground + 1 + height * terrain.rise
    if ground == NONE or layer >= terrain.size[2]:
        return NONE
    voxel = column * terrain.size[2] + layer
    return NONE if math.isinf(terrain.traversal_cost[voxel]) or terrain.excluded[voxel] else voxel


@lean_kernel
def take_column(terrain, block):
    """Set the candidates of a block: those above the column that represents it."""
    column = terrain.columns.candidate[block]
    for height in range(terrain.voxel.shape[1]):
        terrain.voxel[block, height] = _at_height(terrain, column, height) if column != NONE else NONE


@lean_kernel
def fill_column_costs(terrain, cost, least):
    """Fill (X·Y,) with the least of (V,) float64 path costs to the candidates that a column may have."""
    for column in range(len(least)):
        least[column] = math.inf
        if terrain.columns.flags[column] & CANDIDATE:
            for height in range(terrain.voxel.shape[1]):
                voxel = _at_height(terrain, column, height)
                if voxel != NONE:
                    least[column] = min(least[column], cost[voxel])


class TerrainFrontiers(FrontierMap):
    """Candidates above a height field; the points of V are columns of ground."""

    def __init__(
        self, scenario: Scenario, kind: RobotKind, frontiers: FrontierConfig, ceiling: np.ndarray
    ) -> None:
        """Take the settings, and (X, Y) the lowest layers of the no-fly zone; nothing is explored yet."""
        super().__init__(scenario, kind, frontiers)
        (x, y, high), edge = self._size, self._edge
        self._map = new_terrain_map(self._size, kind.robot.planning_radius_m / edge, self._spacing, ceiling)
        self._states, self._blocks = self._map.states, self._map.columns
        self._costs, self._marks = self._map.traversal_cost, self._map.excluded
        self._voxels = self._map.voxel.reshape(-1)
        yaws, tilt = yaws_around(self.reach), kind.sensor.field_of_view_rad[1]
        self._rays = np.stack([np.cos(yaws), np.sin(yaws)], axis=-1)
        self._gaze_pitches = (0.5 * math.pi - 0.5 * tilt,)  # the lowest rays lead straight down
        self._model = ViewModel(
            self.reach,
            min_tangent=math.tan(min(max(0.5 * math.pi - tilt, 0.0), 1.5)),
            patch=max(round(PATCH_M / edge), 0),
            gamma=-1.0 if frontiers.gamma is None else frontiers.gamma,
            unit=edge,
            highest=TOO_HIGH * self.reach,
        )
        self.point, self._sight = edge**2, (self.reach + 1.5 * self._model.patch + 2.0, 0.0)
        factor = 1.0 if frontiers.gamma is None else edge * high
        self._most = min(math.pi * (self.reach + 2.0) ** 2, float(x * y)) * factor

    def _read(self, mean: np.ndarray, precision: np.ndarray, levels: tuple[np.float32, np.float32]) -> int:
        """See `FrontierMap`."""
        return int(update_terrain(self._map, mean, precision, levels))

    def _find_candidates(self) -> None:
        """See `FrontierMap`."""
        update_columns(self._map)

    def replace_unreached(self, cost: np.ndarray) -> None:
        """See `FrontierMap`."""
        before, costs = self._blocks.candidate.copy(), np.empty(len(self._blocks.state))
        fill_column_costs(self._map, cost, costs)
        replace_unreached(self._blocks, costs)
        for block in np.flatnonzero(self._blocks.candidate != before):
            take_column(self._map, block)

    def _counted(self, voxels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """See `FrontierMap`."""
        (seen, weighed), factors = super()._counted(voxels), self._factors(voxels)
        return seen * factors, weighed * factors

    def _count_from(self, voxels: np.ndarray, seen: np.ndarray, weighed: np.ndarray) -> None:
        """See `FrontierMap`."""
        count_columns_from(self._counter, self._map, voxels, self._rays, self._model, seen, weighed)

    def _factors(self, voxels: np.ndarray) -> np.ndarray:
        """Return (K,) height factors of (K,) int32 voxels."""
        factors = np.empty(len(voxels))
        fill_height_factors(self._map, voxels, self._model, factors)
        return factors

    def _count_rays(self, place: np.ndarray, rays: np.ndarray, marking: bool) -> tuple[int, float]:
        """See `FrontierMap`; rays are (D, 2) unit vectors over the ground."""
        return count_below(self._counter, self._map, *self._from(place), rays, self._model, marking)

    def _rays_ahead(self, view: RobotKnowledge, gazes: np.ndarray) -> Sequence[np.ndarray]:
        """See `FrontierMap`."""
        least = math.cos(0.5 * view.kind.sensor.field_of_view_rad[0])
        return [self._rays[self._rays @ (math.cos(yaw), math.sin(yaw)) >= least] for yaw in gazes[:, 0]]

    def _count_ball(self, place: np.ndarray, marking: bool) -> tuple[int, float]:
        """See `FrontierMap`."""
        return count_columns_in_ball(self._counter, self._map, *self._from(place), self._model, marking)

    def _from(self, place: np.ndarray) -> tuple[tuple[float, ...], float]:
        """Return an eye at (3,), grid units, and z_av there."""
        eye = tuple(place.tolist())
        return eye, mean_ground(self._map, int(eye[0]), int(eye[1]), self._model.patch)
