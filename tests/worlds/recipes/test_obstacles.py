"""Strewn obstacles are convex, far enough apart, and as many as asked."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage

from entropy_explore_env.worlds.recipes.obstacles import clearance_voxels, scatter

SHAPE = (170, 130)


def distances(free):
    """To the nearest voxel that is not free, between centres, in voxels."""
    return np.asarray(ndimage.distance_transform_edt(free))


@pytest.mark.parametrize(("edge_m", "radii_m"), [(0.1, (0.3, 1.5)), (0.5, (1.5, 8.0))])
def test_polygons_are_convex_and_leave_ways(edge_m, radii_m):
    for seed in range(3):
        solid = np.zeros(SHAPE, bool)
        numbers = scatter(solid, np.zeros(SHAPE, bool), radii_m, 0.12, edge_m, np.random.default_rng(seed))
        np.testing.assert_array_equal(solid, numbers > 0)
        assert numbers.max() > 5
        assert 0.12 <= solid.mean() < 0.12 + np.pi * (radii_m[1] / edge_m) ** 2 / solid.size
        for number in range(1, numbers.max() + 1):
            inside = np.argwhere(numbers == number)
            rng = np.random.default_rng(number)
            pairs = inside[rng.integers(0, len(inside), (300, 2))]
            halfway = np.rint(pairs.mean(axis=1) + 1e-6).astype(int)
            near = ndimage.binary_dilation(numbers == number)
            assert near[tuple(halfway.T)].all(), f"polygon {number} is not convex"
            extent = np.ptp(inside, axis=0).max() + 1
            assert extent <= 2.0 * radii_m[1] / edge_m + 1
            others = (numbers > 0) & (numbers != number)
            apart = distances(~others)[tuple(inside.T)].min()
            assert apart > clearance_voxels(edge_m) - 1e-9


def test_walls_may_be_leaned_on_and_closed_places_stay_free():
    for seed in range(4):
        solid, excluded = np.zeros(SHAPE, bool), np.zeros(SHAPE, bool)
        solid[80:83] = True
        excluded[20:60, 20:60] = True
        numbers = scatter(solid, excluded, (0.3, 1.5), 0.1, 0.1, np.random.default_rng(seed))
        assert not (numbers > 0)[80:83].any() and solid[80:83].all()
        assert not numbers[excluded].any()
        assert (numbers > 0).sum() >= 0.1 * (SHAPE[0] - 3) * SHAPE[1]


def test_a_plan_that_is_full_ends_the_search():
    solid = np.zeros((40, 30), bool)
    scatter(solid, np.zeros((40, 30), bool), (0.3, 0.6), 0.9, 0.1, np.random.default_rng(0))
    assert 0.0 < solid.mean() < 0.5
    excluded = np.ones((40, 30), bool)
    assert not scatter(solid, excluded, (0.3, 0.6), 0.9, 0.1, np.random.default_rng(0)).any()
