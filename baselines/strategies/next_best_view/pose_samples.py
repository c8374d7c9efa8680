"""Poses that Sujan's rules choose among: places drawn with a gaze, or those of a raster, row by row."""

from __future__ import annotations

import math

import numpy as np

from entropy_explore_env.frontiers.blocks import NONE
from entropy_explore_env.planner.scene import Scene

_NARROWEST_RAD = 0.1
"""Narrower views count as this wide where a robot looks all around."""


def reachable_voxels(scene: Scene) -> np.ndarray:
    """Return (N,) int32 voxels in which the body is known to fit, with a known free path there."""
    scene.paths.extend(math.inf)
    voxels = np.flatnonzero(np.isfinite(scene.cells.traversal_cost)).astype(np.int32)
    return voxels[np.isfinite(scene.paths.lengths_to(voxels))]


def drawn_poses(
    rng: np.random.Generator, places: np.ndarray, number: int, pitches_rad: tuple[float, float]
) -> tuple[np.ndarray, np.ndarray]:
    """Draw poses uniformly: their places, and (number, 2) yaws and pitches.

    Args:
        rng: Draws them.
        places: (N, ...) each as likely as any other.
        number: Of poses.
        pitches_rad: The lowest and the highest; yaws lie all around.
    """
    drawn = places[rng.integers(len(places), size=number)]
    yaws = rng.uniform(-math.pi, math.pi, number)
    return drawn, np.stack([yaws, rng.uniform(*pitches_rad, number)], axis=1)


def yaws_around(wide_rad: float) -> list[float]:
    """Return as few yaws, evenly spaced from 0, as show all around with a view of a width."""
    turns = math.ceil(2.0 * math.pi / max(wide_rad, _NARROWEST_RAD) - 1e-9)
    return [2.0 * math.pi * turn / turns for turn in range(turns)]


def raster_rows(places: np.ndarray, step: int, size: tuple[int, ...]) -> np.ndarray:
    """Return which of some places lie on a lattice, in row order: along x, then y, then z.

    Args:
        places: (N, D) indices along D axes.
        step: Of the lattice, whose first place is half a step from the lower corner.
        size: (D,) number of indices along each axis.
    """
    first = np.minimum(step // 2, np.array(size) - 1)
    on_it = np.flatnonzero((places % step == first).all(axis=1))
    return on_it[np.lexsort(places[on_it].T)]


def next_of_raster(taken: dict[int, int], places: list[int], scans: int) -> int:
    """Return the next place of a raster that a robot scans from, and count that scan.

    Args:
        taken: Place → scans chosen there, those that were stopped on the way included; changed.
        places: That can be reached, in row order.
        scans: From each place, one after the other.

    Returns:
        A place; NONE = all scans are taken.
    """
    latest = [place for place in list(taken)[-1:] if place in places]
    for place in [*latest, *places]:
        if taken.get(place, 0) < scans:
            taken[place] = taken.get(place, 0) + 1
            return place
    return NONE
