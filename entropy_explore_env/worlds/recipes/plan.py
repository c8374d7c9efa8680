"""Floor plans in voxels: rectangles, walls, rooms in a row, doors; lengths are given in metres.

A plan is the lowest layer of an indoor world. Doors and corridors let a body of `BODY_RADIUS_M` pass: on
coarse grids, where the body needs more voxels than their width in metres, they are wider.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from entropy_explore_env.errors import WorldError
from entropy_explore_env.settings.grid import Grid

BODY_RADIUS_M = 0.3
"""The body for which recipes promise connected free space."""
DOOR_M = 0.9
DOOR_HEIGHT_M = 2.1
WALL_M = 0.1
_LARGEST_VOXEL_M = 2.5
_CONNECTING_DOORS = 0.2
"""Share of neighbouring rooms with a door between them."""


class Rectangle(NamedTuple):
    """The voxels from `low` (inclusive) to `high` (exclusive), (x, y) each."""

    low: tuple[int, int]
    high: tuple[int, int]

    @property
    def window(self) -> tuple[slice, slice]:
        """Its voxels in an array (X, Y, …)."""
        return slice(self.low[0], self.high[0]), slice(self.low[1], self.high[1])

    def extent(self, axis: int) -> int:
        """Return the number of voxels along an axis."""
        return self.high[axis] - self.low[axis]

    def within(self, axis: int, low: int, high: int) -> Rectangle:
        """Return the same rectangle with another extent along one axis."""
        lows, highs = list(self.low), list(self.high)
        lows[axis], highs[axis] = low, high
        return Rectangle((lows[0], lows[1]), (highs[0], highs[1]))


@dataclass(frozen=True)
class Plan:
    """A floor plan under construction.

    Attributes:
        solid: (X, Y) bool, walls and obstacles.
        clear: (X, Y) bool, passages through doors, where nothing may be placed.
        voxel_size_m: Edge of a voxel.
        wall_m: Thickness of walls.
        rooms: The interiors of rooms.
        doors: The openings in walls.
    """

    solid: np.ndarray
    clear: np.ndarray
    voxel_size_m: float
    wall_m: float
    rooms: list[Rectangle] = field(default_factory=list)
    doors: list[Rectangle] = field(default_factory=list)

    @property
    def whole(self) -> Rectangle:
        """All its voxels."""
        return Rectangle((0, 0), (self.solid.shape[0], self.solid.shape[1]))

    @property
    def wall(self) -> int:
        """Voxels across a wall."""
        return voxels(self.wall_m, self.voxel_size_m)

    def put_wall(self, where: Rectangle) -> None:
        """Make a rectangle solid."""
        self.solid[where.window] = True

    def cut_door(self, wall: Rectangle, axis: int, rng: np.random.Generator) -> None:
        """Open a door somewhere in a piece of wall that runs along an axis.

        The passage is kept clear on both sides, as far as the door is wide.
        """
        width = min(passage_voxels(DOOR_M, self.voxel_size_m), wall.extent(axis))
        start = int(rng.integers(wall.low[axis], wall.high[axis] - width + 1))
        door = wall.within(axis, start, start + width)
        across = 1 - axis
        passage = door.within(across, max(0, door.low[across] - width), door.high[across] + width)
        self.solid[door.window] = False
        self.clear[passage.window] = True
        self.doors.append(door)


def bare_plan(shape: tuple[int, ...], voxel_size_m: float, wall_m: float = WALL_M) -> Plan:
    """Return an empty plan (X, Y)."""
    return Plan(np.zeros(shape[:2], bool), np.zeros(shape[:2], bool), voxel_size_m, wall_m)


def voxels(length_m: float, voxel_size_m: float) -> int:
    """Return a length in whole voxels, at least one."""
    return max(1, round(length_m / voxel_size_m))


def passage_voxels(width_m: float, voxel_size_m: float, body_radius_m: float = BODY_RADIUS_M) -> int:
    """Return the voxels across a passage: its width at least, and what a body needs between two walls."""
    needed = 2 * max(0, math.ceil(body_radius_m / voxel_size_m - 0.5 - 1e-9)) + 1
    return max(math.ceil(width_m / voxel_size_m - 1e-9), needed)


def require_size(grid: Grid, kind: str, *edges_m: float) -> None:
    """Check that a workspace has edges of at least these lengths, the longest first, and room for a body.

    Raises:
        WorldError: It is smaller, or its voxels are so large that rooms and corridors are none any more.
    """
    if grid.voxel_size_m > _LARGEST_VOXEL_M:
        raise WorldError("Grid.voxel_size_m", grid.voxel_size_m, f"at most {_LARGEST_VOXEL_M:g} for {kind}")
    found = sorted(grid.size_m[:2], reverse=True)
    low = not grid.flat and grid.shape[2] < passage_voxels(0.0, grid.voxel_size_m)
    if low or any(have < want - 1e-9 for have, want in zip(found, edges_m, strict=True)):
        room = " × ".join(f"{edge:g}" for edge in edges_m)
        high = f", 2-D or {2 * BODY_RADIUS_M:g} m high" if low else ""
        raise WorldError("Grid.shape", grid.shape, f"at least {room} m for {kind}{high}")


def divided(low: int, high: int, part: float, gap: int, rng: np.random.Generator) -> list[tuple[int, int]]:
    """Return an interval divided into parts of about equal length, with gaps between them.

    Args:
        low: First voxel.
        high: Voxel after the last.
        part: Desired length of a part.
        gap: Voxels between two parts.
        rng: Displaces each cut by up to a fifth of a part.

    Returns:
        The parts, (low, high) each.
    """
    count = max(1, round((high - low + gap) / (part + gap)))
    length = (high - low + gap) / count
    cuts = [low + round((i + rng.uniform(-0.2, 0.2)) * length) for i in range(1, count)]
    lows = [low, *cuts]
    return list(zip(lows, [cut - gap for cut in [*cuts, high + gap]], strict=True))


def put_rooms(
    plan: Plan, band: Rectangle, axis: int, doors_high: bool, room_m: float, rng: np.random.Generator
) -> None:
    """Put rooms side by side into a band along a corridor, each with a door to it, some with doors between.

    Args:
        plan: Changed in place.
        band: Where, including the wall between the rooms and the corridor.
        axis: The corridor's direction.
        doors_high: Whether the corridor is at the band's upper side.
        room_m: Approximate width of a room.
        rng: Draws walls and doors.
    """
    across, wall = 1 - axis, plan.wall
    low, high = band.low[across], band.high[across]
    edge = band.within(across, high - wall, high) if doors_high else band.within(across, low, low + wall)
    inside = band.within(across, low, high - wall) if doors_high else band.within(across, low + wall, high)
    plan.put_wall(edge)
    parts = divided(band.low[axis], band.high[axis], room_m / plan.voxel_size_m, wall, rng)
    for number, (start, end) in enumerate(parts):
        plan.rooms.append(inside.within(axis, start, end))
        plan.cut_door(edge.within(axis, start, end), axis, rng)
        if number + 1 < len(parts):
            between = inside.within(axis, end, end + wall)
            plan.put_wall(between)
            if rng.random() < _CONNECTING_DOORS:
                plan.cut_door(between, across, rng)


def extruded(grid: Grid, solid: np.ndarray, doors: Sequence[Rectangle] = ()) -> np.ndarray:
    """Return a plan extruded to the height of the grid, with wall above its doors from `DOOR_HEIGHT_M` on.

    Args:
        grid: The workspace.
        solid: (X, Y) bool.
        doors: Openings.

    Returns:
        (X, Y, Z) bool.
    """
    occupied = np.repeat(solid[:, :, None], grid.shape[2], axis=2)
    if not grid.flat:
        top = passage_voxels(DOOR_HEIGHT_M, grid.voxel_size_m)
        for door in doors:
            occupied[(*door.window, slice(top, None))] = True
    return occupied
