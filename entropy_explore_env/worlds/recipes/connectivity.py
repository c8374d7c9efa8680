"""Connected free space: which places a body can be in, ways cut between parts, pockets filled."""

from __future__ import annotations

from typing import cast

import numpy as np
from scipy import ndimage

from entropy_explore_env.errors import WorldError
from entropy_explore_env.settings import Grid
from entropy_explore_env.worlds.components import connected_components, largest_component
from entropy_explore_env.worlds.recipes.plan import BODY_RADIUS_M, passage_voxels
from entropy_explore_env.worlds.world import Collision, World

_ROUNDS = 20


def body_room(occupied: np.ndarray, voxel_size_m: float) -> np.ndarray:
    """Where a body of `BODY_RADIUS_M` fits.

    Args:
        occupied: (X, Y, Z) or (X, Y) bool.
        voxel_size_m: Edge of a voxel.

    Returns:
        The same shape, bool.
    """
    if occupied.all():
        return np.zeros_like(occupied)
    shape = (occupied.shape[0], occupied.shape[1], occupied.shape[2] if occupied.ndim == 3 else 1)
    world = World(Grid(shape, voxel_size_m), occupied.reshape(shape).copy(), "under construction")
    return (world.collision_mask(BODY_RADIUS_M) == Collision.NONE).reshape(occupied.shape)


def cut_gates(
    solid: np.ndarray,
    one: np.ndarray,
    other: np.ndarray,
    gates: int,
    width_m: float,
    voxel_size_m: float,
    rng: np.random.Generator,
) -> None:
    """Cut ways where two parts of a plan are closest, or little farther apart than there.

    A way runs along x, then along y.

    Args:
        solid: (X, Y) bool; changed in place.
        one: (X, Y) bool, where a body is in one part.
        other: (X, Y) bool, the same in the other part.
        gates: How many; they may overlap.
        width_m: Of the ways.
        voxel_size_m: Edge of a voxel.
        rng: Draws the places.
    """
    away, nearest = cast(
        "tuple[np.ndarray, np.ndarray]", ndimage.distance_transform_edt(~other, return_indices=True)
    )
    far = np.where(one, away, np.inf)
    candidates = np.argwhere(far <= far.min() + 0.5 / voxel_size_m)
    half = passage_voxels(width_m, voxel_size_m) // 2
    for start in candidates[rng.integers(0, len(candidates), gates)]:
        end = nearest[:, start[0], start[1]]
        corner = np.array([end[0], start[1]])
        for one_end, other_end in ((start, corner), (corner, end)):
            low = np.maximum(np.minimum(one_end, other_end) - half, 0)
            high = np.maximum(one_end, other_end) + half + 1
            solid[low[0] : high[0], low[1] : high[1]] = False


def fill_pockets(occupied: np.ndarray, voxel_size_m: float) -> np.ndarray:
    """Free space in which bodies hang together: pockets that none can leave are filled.

    Args:
        occupied: (X, Y, Z) or (X, Y) bool.
        voxel_size_m: Edge of a voxel.

    Returns:
        The same shape, bool: no less occupied; the places where a body of `BODY_RADIUS_M` fits, and
        the free voxels, are one face-connected part each.

    Raises:
        WorldError: A body fits nowhere.
    """
    occupied = occupied.copy()
    for _ in range(_ROUNDS):
        room = body_room(occupied, voxel_size_m)
        main = largest_component(room)
        if not main.any():
            break
        free, parts = connected_components(~occupied)
        if parts > 1:
            occupied |= free != free[tuple(np.argwhere(main)[0])]
            continue
        pockets = room & ~main
        if not pockets.any():
            return occupied
        occupied |= pockets
    raise WorldError("Grid.shape", occupied.shape, f"room for a body of {BODY_RADIUS_M} m radius")
