"""Furniture in rooms: solid boxes on the floor, against walls or free-standing."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from entropy_explore_env.worlds.recipes.plan import BODY_RADIUS_M, Plan, Rectangle, passage_voxels, voxels

_PASSAGE_M = 2.0 * BODY_RADIUS_M
_TRIES_A_PIECE = 4


class Piece(NamedTuple):
    """A kind of furniture: its edges in metres, and whether it stands against a wall."""

    length_m: float
    depth_m: float
    height_m: float
    at_wall: bool


OFFICE = (
    Piece(1.6, 0.8, 0.75, True),  # desk
    Piece(1.0, 0.45, 1.8, True),  # cupboard
    Piece(2.0, 0.4, 2.0, True),  # shelf
    Piece(1.6, 0.9, 0.75, False),  # table
)
LABORATORY = (
    Piece(2.0, 0.7, 0.9, True),  # bench
    Piece(0.9, 0.5, 1.8, True),  # cupboard
    Piece(0.6, 0.4, 0.7, False),  # box
    Piece(0.4, 0.4, 1.2, False),  # box on box
)


def furnish(
    occupied: np.ndarray,
    plan: Plan,
    room: Rectangle,
    kinds: tuple[Piece, ...],
    area_a_piece_m2: float,
    rng: np.random.Generator,
) -> None:
    """Put furniture into a room, with passages for a body of `BODY_RADIUS_M` around it.

    A piece touches a wall or leaves a passage to it, and leaves a passage to every other piece. Boxes
    placed by this rule never divide the room, at any height. Passages through doors stay clear.

    Args:
        occupied: (X, Y, Z) bool; changed in place.
        plan: The floor plan.
        room: Of the plan.
        kinds: The furniture to choose from.
        area_a_piece_m2: Floor area for each piece.
        rng: Draws pieces and positions.
    """
    edge_m = plan.voxel_size_m
    passage = passage_voxels(_PASSAGE_M, edge_m) + 1
    pieces = round(room.extent(0) * room.extent(1) * edge_m**2 / area_a_piece_m2)
    placed: list[Rectangle] = []
    for _ in range(_TRIES_A_PIECE * pieces):
        if len(placed) == pieces:
            break
        kind = kinds[int(rng.integers(len(kinds)))]
        box = _place(room, kind, edge_m, rng)
        fits = box is not None and not plan.clear[box.window].any()
        if box is None or not fits or not _leaves_passages(box, room, placed, passage):
            continue
        placed.append(box)
        height = min(voxels(kind.height_m, edge_m), occupied.shape[2] - 1)
        occupied[(*box.window, slice(0, max(1, height)))] = True


def _place(room: Rectangle, kind: Piece, voxel_size_m: float, rng: np.random.Generator) -> Rectangle | None:
    """Return a random position in the room, the long side along a wall; None if the room is too small."""
    axis = int(rng.integers(2))
    size = [0, 0]
    size[axis], size[1 - axis] = voxels(kind.length_m, voxel_size_m), voxels(kind.depth_m, voxel_size_m)
    slack = [room.extent(i) - size[i] for i in (0, 1)]
    if min(slack) < 0:
        return None
    low = [int(rng.integers(room.low[i], room.low[i] + slack[i] + 1)) for i in (0, 1)]
    if kind.at_wall:
        low[1 - axis] = room.low[1 - axis] + int(rng.integers(2)) * slack[1 - axis]
    return Rectangle((low[0], low[1]), (low[0] + size[0], low[1] + size[1]))


def _leaves_passages(box: Rectangle, room: Rectangle, placed: list[Rectangle], passage: int) -> bool:
    """Return whether gaps to walls are zero or passages, and gaps to other pieces are passages."""
    at_walls = []
    for axis in (0, 1):
        for gap in (box.low[axis] - room.low[axis], room.high[axis] - box.high[axis]):
            if 0 < gap < passage:
                return False
            at_walls.append(gap == 0)
    if (at_walls[0] and at_walls[1]) or (at_walls[2] and at_walls[3]):
        return False  # it would reach from wall to wall
    for other in placed:
        gaps = [max(box.low[i] - other.high[i], other.low[i] - box.high[i]) for i in (0, 1)]
        if max(gaps) < passage:
            return False
    return True
