"""Bhattacharya's fig. 4: two robots, an unknown region nearer to one of them, and who gets how much of it."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from entropy_explore_env.belief.entropy import LN2
from entropy_explore_env.belief.paths.geodesic_cells import new_tessellation, tessellate

SHAPE = (200, 121, 1)
ETAS = (1e-4, 1e-3, 1e-2, 3e-2, 1e-1, 1.0)
REGIONS = {
    "band": "a band from wall to wall, which separates the robots",
    "patch": "a patch with free space around it",
}
_ROBOTS = ((20, 60), (180, 60))
_BAND = (90, 170)
"""Nearer to the second robot."""


class Split(NamedTuple):
    """Who is nearest to each cell, and the first robot's unexplored area over the second's."""

    cells: np.ndarray
    """(X, Y) int32."""
    ratio: float


def unknown_region(name: str) -> np.ndarray:
    """(X, Y, 1) bool, the region."""
    region = np.zeros(SHAPE, bool)
    rows = slice(None) if name == "band" else slice(35, 86)
    region[_BAND[0] : _BAND[1], rows] = True
    return region


def split(name: str, eta: float | None) -> Split:
    """Tessellate a convex plan with a region.

    Args:
        name: Of the region.
        eta: η of the entropy-weighted cells; None = plain geodesic cells.
    """
    region, space = unknown_region(name), new_tessellation(SHAPE)
    sources = np.array([x * SHAPE[1] + y for x, y in _ROBOTS])
    if eta is None:
        tessellate(space, np.ones(SHAPE, np.float32), sources)
    else:
        tessellate(space, np.where(region, LN2, 0.0).astype(np.float32), sources, eta, by_length=False)
    areas = [int(np.count_nonzero((space.cells == robot) & region)) for robot in range(2)]
    return Split(space.cells[:, :, 0].copy(), areas[0] / max(areas[1], 1))


def robot_cells() -> np.ndarray:
    """(2, 2) where the robots are."""
    return np.array(_ROBOTS)


def ratios() -> dict[str, Any]:
    """Ratio by region, of plain cells and for each η."""
    return {
        name: {"plain": split(name, None).ratio, **{f"{eta:g}": split(name, eta).ratio for eta in ETAS}}
        for name in REGIONS
    }
