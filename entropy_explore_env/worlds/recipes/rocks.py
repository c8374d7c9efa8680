"""Rocks of the sizes found at the Viking landing sites (Golombek & Rapp 1997), as hemispheres on ground.

M. Golombek, D. Rapp, "Size-frequency distributions of rocks on Mars and Earth analog sites: Implications for
future landed missions", J. Geophys. Res. 102(E2), 1997. Rocks of diameter D and more cover the share

    F_k(D) = k·exp(-q(k)·D),    q(k) = 1.79 + 0.152/k

of the ground, D in metres and k the share that all rocks cover. That they are hemispheres, half as high as
wide, and that they lie in piles is ours.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

VIKING_2 = 0.176
"""K of the site of the second Viking lander, the rockier one."""
_DECAY, _DECAY_OF_SPARSE = 1.79, 0.152
_STEPS = 2000
"""Of the numerical integral over diameters."""


class RockSizes(NamedTuple):
    """Which rocks are drawn; smaller ones are lost in the voxels, larger ones do not occur."""

    abundance: float
    """K, in (0, 1)."""
    least_m: float
    most_m: float


def draw_diameters(sizes: RockSizes, area_m2: float, rng: np.random.Generator) -> np.ndarray:
    """Return (N,) diameters in metres of the rocks on some ground, the largest first.

    The number of rocks a square metre and metre of diameter is -F_k'(D)/(πD²/4); N is Poisson.
    """
    edges = np.linspace(sizes.least_m, sizes.most_m, _STEPS + 1)
    decay = _DECAY + _DECAY_OF_SPARSE / sizes.abundance
    density = sizes.abundance * decay * np.exp(-decay * edges) / (0.25 * math.pi * edges**2)
    numbers = np.concatenate([[0.0], np.cumsum(0.5 * (density[1:] + density[:-1]) * np.diff(edges))])
    count = rng.poisson(area_m2 * numbers[-1])
    drawn = np.interp(rng.uniform(0.0, numbers[-1], count), numbers, edges)
    return np.sort(drawn)[::-1]


def raise_rocks(
    height_m: np.ndarray, diameters_m: np.ndarray, centres_m: np.ndarray, voxel_size_m: float
) -> None:
    """Put hemispheres on ground, in place: each rests on the ground, or the rock, at its centre.

    Args:
        height_m: (X, Y) float64, heights of the ground; changed.
        diameters_m: (N,).
        centres_m: (N, 2) from the corner of column (0, 0), inside the grid.
        voxel_size_m: Edge of a column.
    """
    shape = np.array(height_m.shape)
    for diameter, centre in zip(diameters_m, centres_m, strict=True):
        at, radius = centre / voxel_size_m, 0.5 * diameter / voxel_size_m
        low = np.maximum(np.floor(at - radius).astype(int), 0)
        high = np.minimum(np.ceil(at + radius).astype(int) + 1, shape)
        x, y = np.ogrid[low[0] : high[0], low[1] : high[1]]
        below = radius**2 - (x + 0.5 - at[0]) ** 2 - (y + 0.5 - at[1]) ** 2
        around = height_m[low[0] : high[0], low[1] : high[1]]
        base = height_m[tuple(np.minimum(at.astype(int), shape - 1))]
        top = base + voxel_size_m * np.sqrt(np.maximum(below, 0.0))
        np.copyto(around, np.maximum(around, top), where=below > 0.0)
