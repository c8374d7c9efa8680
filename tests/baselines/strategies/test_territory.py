"""Controls of Voronoi coverage against naive ones, and by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from baselines.strategies.territory import nearest_uncertain, projected_centroid
from entropy_explore_env.belief.paths.geodesic_cells import UNREACHED, new_tessellation, tessellate
from tests.belief.paths.test_geodesic_cells import drawn_rates
from tests.reference.scenes import SHAPES, drawn, seeds


def scene(size, seed, by_length, walls=0.25):
    """Rates, a density and the tessellation from three sources."""
    rates, rng = drawn_rates(size, seed, walls)
    if np.isinf(rates).all():
        rates[0, 0, 0] = 1.0
    density = rng.uniform(0.1, 0.7, size).astype(np.float32)
    sources = rng.integers(0, rates.size, 3)
    space = new_tessellation(size)
    tessellate(space, rates, sources, 0.01, by_length)
    return rates, density, sources, space


def by_hand(cells, density, threshold, cell):
    """Eqs. 6-8 of one cell, voxel by voxel."""
    voxels = [at for at in np.ndindex(*cells.shape) if cells[at] == cell]
    if not voxels:
        return UNREACHED
    weights = [float(density[at]) for at in voxels]
    total = sum(weights)
    centre = [sum(w * at[axis] for w, at in zip(weights, voxels, strict=True)) / total for axis in range(3)]
    high = [at for at in voxels if density[at] >= np.float32(threshold)]
    among = high or voxels
    away = [sum((at[axis] - centre[axis]) ** 2 for axis in range(3)) for at in among]
    return int(np.ravel_multi_index(among[int(np.argmin(away))], cells.shape))


@given(st.sampled_from(SHAPES), seeds, st.sampled_from([0.2, 0.69, 0.8]), st.booleans())
@drawn(30)
def test_targets_are_those_of_the_equations(size, seed, threshold, by_length):
    _, density, sources, space = scene(size, seed, by_length)
    threshold = float(np.float32(threshold))
    for number in range(len(sources)):
        own = space.cells == number
        voxels = np.flatnonzero(own)
        wanted, ours = (
            by_hand(space.cells, density, threshold, number),
            projected_centroid(voxels, density, threshold),
        )
        if wanted == UNREACHED:
            assert ours == UNREACHED
        else:  # rounding may choose between equals
            weights = np.where(own, density, 0.0).astype(float)
            centre = [(np.indices(size)[a] * weights).sum() / weights.sum() for a in range(3)]
            places = [np.unravel_index(voxel, size) for voxel in (wanted, ours)]
            away = [math.dist([float(i) for i in at], centre) for at in places]
            assert away[0] == pytest.approx(away[1]) and own.reshape(-1)[ours]
        mask = own & (density >= np.float32(threshold))
        costs = np.where(mask, space.costs, np.inf).reshape(-1)
        near = nearest_uncertain(voxels, space.costs, density, threshold)
        assert near == (int(np.argmin(costs)) if mask.any() else UNREACHED)


def test_a_centroid_outside_of_its_cell_by_hand():
    """A U of nine voxels: the centroid, (1, 4/3), lies in the gap; two voxels are as near to it."""
    cells = np.full((3, 4, 1), UNREACHED, np.int32)
    cells[0, :, 0] = cells[2, :, 0] = 0
    cells[1, 0, 0] = 0
    voxels, density = np.flatnonzero(cells == 0), np.ones((3, 4, 1), np.float32)
    assert projected_centroid(voxels, density, 2.0) == 1  # (0, 1) before (2, 1): by number
    assert projected_centroid(np.flatnonzero(cells == 1), density, 2.0) == UNREACHED
    density[2, 3, 0] = 3.0
    assert projected_centroid(voxels, density, 2.0) == 11
