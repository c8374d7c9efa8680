"""Sums of a pooled belief follow its voxels, whatever rays cross them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from entropy_explore_env.belief.map_update import fuse_ray
from entropy_explore_env.belief.pooling import fresh_sums, fuse_pooled_ray, new_cells, normalised_entropy
from tests.reference.scenes import drawn, seeds

SIZE = (7, 11, 5)
PRIOR, END = float(np.float32(30.0**-2)), 0.03**-2


def test_cells_cut_each_axis_into_nearly_equal_parts():
    cells = new_cells(SIZE, (3, 4, 2))
    assert cells.x.tolist() == [0, 0, 8, 8, 16, 16, 16]
    assert cells.y.tolist() == [0, 0, 2, 2, 2, 4, 4, 4, 6, 6, 6]
    assert cells.z.tolist() == [0, 0, 1, 1, 1]
    assert cells.voxels.sum() == 7 * 11 * 5 and len(cells.voxels) == 24
    assert cells.voxels[0] == 2 * 2 * 2 and cells.voxels[-1] == 3 * 3 * 3
    assert fresh_sums(cells).tolist() == [cells.voxels.tolist(), (0.5 * cells.voxels).tolist()]


def test_as_many_cells_as_voxels():
    assert (new_cells(SIZE, SIZE).voxels == 1.0).all()


def test_normalised_entropy_at_its_ends():
    assert normalised_entropy(PRIOR, END, PRIOR) == 1.0
    assert normalised_entropy(PRIOR, END, END) == 0.0
    assert normalised_entropy(PRIOR, END, np.sqrt(PRIOR * END)) == pytest.approx(0.5)
    assert normalised_entropy(PRIOR, END, 10 * END) == 0.0
    assert normalised_entropy(PRIOR, END, PRIOR / 10) == 1.0


@drawn(40)
@given(seeds, st.sampled_from([(1, 1, 1), (3, 4, 2), (7, 2, 5)]), st.integers(1, 60))
def test_sums_are_those_of_the_whole_belief(seed, shape, rays):
    rng, voxels = np.random.default_rng(seed), np.prod(SIZE)
    cells, mean = new_cells(SIZE, shape), np.full(voxels, 0.5, np.float32)
    precision = np.full(voxels, PRIOR, np.float32)
    sums, twin = fresh_sums(cells), (mean.copy(), precision.copy())
    for _ in range(rays):
        n = int(rng.integers(1, 20))
        crossed = rng.choice(voxels, n, replace=False).astype(np.int32)
        coverage, free = rng.random(n, np.float32), int(rng.integers(0, n + 1))
        measured = float(rng.uniform(1.0, 300.0))
        bits = fuse_pooled_ray(
            cells, sums, (PRIOR, END), mean, precision, crossed, coverage, free, n, measured
        )
        assert bits == fuse_ray(*twin, crossed, coverage, free, n, measured)
    np.testing.assert_array_equal((mean, precision), twin)
    x, y, z = np.unravel_index(np.arange(voxels), SIZE)
    cell = [(i + 1) * c - 1 for i, c in zip((x, y, z), shape, strict=True)]
    cell = [i // size for i, size in zip(cell, SIZE, strict=True)]
    number = (cell[0] * shape[1] + cell[1]) * shape[2] + cell[2]
    share = np.clip(np.log2(END / precision.astype(float)) / np.log2(END / PRIOR), 0.0, 1.0)
    for channel, values in enumerate((share, mean)):
        whole = np.bincount(number, values, minlength=len(cells.voxels))
        np.testing.assert_allclose(sums[channel], whole, rtol=0, atol=1e-9 * voxels)
