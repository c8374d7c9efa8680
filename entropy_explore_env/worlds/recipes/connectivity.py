"""Connected free space: where a body fits, gates cut between regions of a plan, pockets filled."""

from __future__ import annotations

from typing import cast

import numpy as np
from scipy import ndimage

from entropy_explore_env.errors import WorldError
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.worlds.components import connected_components, largest_component
from entropy_explore_env.worlds.recipes.plan import BODY_RADIUS_M, passage_voxels
from entropy_explore_env.worlds.world import Collision, World

_MAX_ROUNDS = 20
"""Filling pockets may cut off others: repeated at most this often."""


def body_room(occupied: np.ndarray, voxel_size_m: float) -> np.ndarray:
    """Return where a body of `BODY_RADIUS_M` fits.

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
    """Cut gates where two regions of a plan are closest, or farther apart by at most half a metre.

    A gate runs along x, then along y.

    Args:
        solid: (X, Y) bool; changed in place.
        one: (X, Y) bool, where a body fits in one region.
        other: (X, Y) bool, the same in the other region.
        gates: How many; they may overlap.
        width_m: Of the gates.
        voxel_size_m: Edge of a voxel.
        rng: Draws where they are.
    """
    distances, nearest = cast(
        "tuple[np.ndarray, np.ndarray]", ndimage.distance_transform_edt(~other, return_indices=True)
    )
    distances = np.where(one, distances, np.inf)
    candidates = np.argwhere(distances <= distances.min() + 0.5 / voxel_size_m)
    half = passage_voxels(width_m, voxel_size_m) // 2
    for start in candidates[rng.integers(0, len(candidates), gates)]:
        end = nearest[:, start[0], start[1]]
        corner = np.array([end[0], start[1]])
        for one_end, other_end in ((start, corner), (corner, end)):
            low = np.maximum(np.minimum(one_end, other_end) - half, 0)
            high = np.maximum(one_end, other_end) + half + 1
            solid[low[0] : high[0], low[1] : high[1]] = False


def fill_pockets(occupied: np.ndarray, voxel_size_m: float) -> np.ndarray:
    """Fill the pockets of free space that a body cannot leave, until its free space is connected.

    Args:
        occupied: (X, Y, Z) or (X, Y) bool.
        voxel_size_m: Edge of a voxel.

    Returns:
        The same shape, bool, with at least the same voxels occupied. The voxels where a body of
        `BODY_RADIUS_M` fits are one face-connected component, and so are the free voxels.

    Raises:
        WorldError: A body fits nowhere.
    """
    occupied = occupied.copy()
    for _ in range(_MAX_ROUNDS):
        fits = body_room(occupied, voxel_size_m)
        main = largest_component(fits)
        if not main.any():
            break
        labels, count = connected_components(~occupied)
        if count > 1:
            occupied |= labels != labels[tuple(np.argwhere(main)[0])]
            continue
        pockets = fits & ~main
        if not pockets.any():
            return occupied
        occupied |= pockets
    raise WorldError("Grid.shape", occupied.shape, f"room for a body of {BODY_RADIUS_M} m radius")
