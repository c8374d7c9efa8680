"""Sums of a pooled belief follow its voxels, whatever rays cross them."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from entropy_explore_env.belief.map_update import RAY, Scan, fuse_scan
from entropy_explore_env.belief.measurement_model import Return
from entropy_explore_env.belief.pooling import (
    Pool,
    fresh_sums,
    fuse_pooled_scan,
    new_cells,
    no_cells,
    normalised_entropy,
    pool_belief,
)
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
    rng, voxels = np.random.default_rng(seed), math.prod(SIZE)
    cells, mean = new_cells(SIZE, shape), np.full(voxels, 0.5, np.float32)
    precision = np.full(voxels, PRIOR, np.float32)
    sums, twin = fresh_sums(cells), (mean.copy(), precision.copy())
    scan = random_scan(rng, rays)
    fused_first = int(rng.integers(0, rays + 1))
    pool = Pool(cells, sums, PRIOR, END)
    for count in (fused_first, rays):  # the first rays twice, in two calls
        bits = fuse_pooled_scan(scan, count, mean, precision, pool)
        utility = scan.utility.copy()
        assert bits == fuse_scan(scan, count, *twin)
        np.testing.assert_array_equal(utility, scan.utility)
    assert (utility[scan.rays["returned"] == Return.NOTHING] == 0.0).all()
    assert (utility[scan.rays["returned"] != Return.NOTHING] > 0.0).all()
    np.testing.assert_array_equal((mean, precision), twin)
    x, y, z = np.unravel_index(np.arange(voxels), SIZE)
    cell = [(i + 1) * c - 1 for i, c in zip((x, y, z), shape, strict=True)]
    cell = [i // size for i, size in zip(cell, SIZE, strict=True)]
    number = (cell[0] * shape[1] + cell[1]) * shape[2] + cell[2]
    share = np.clip(np.log2(END / precision.astype(float)) / np.log2(END / PRIOR), 0.0, 1.0)
    for channel, values in enumerate((share, mean)):
        whole = np.bincount(number, values, minlength=len(cells.voxels))
        np.testing.assert_allclose(sums[channel], whole, rtol=0, atol=1e-9 * voxels)
    anew = Pool(cells, np.full_like(sums, np.nan), PRIOR, END)
    pool_belief(anew, mean, precision)
    np.testing.assert_allclose(anew.sums, sums, rtol=0, atol=1e-9 * voxels)


def random_scan(rng, rays):
    """Rays over up to 19 random voxels each, in random order; some measured nothing."""
    scan = Scan(
        rays=np.zeros(rays, RAY),
        utility=np.full(rays, np.nan),
        crossed=np.full((rays, 19), -1, np.int32),
        entered=np.zeros(19, np.int64),
        coverage=rng.random((rays, 19), np.float32),
        order=rng.permutation(rays),
    )
    for number, ray in enumerate(scan.rays):
        ray["voxels"] = rng.integers(1, 20)
        ray["free"] = rng.integers(0, ray["voxels"] + 1)
        ray["precision"] = rng.uniform(1.0, 300.0)
        ray["returned"] = rng.choice([Return.NOTHING, Return.FREE, Return.HIT], p=[0.1, 0.3, 0.6])
        crossed = rng.choice(math.prod(SIZE), ray["voxels"], replace=False)
        scan.crossed[number, : ray["voxels"]] = crossed
    return scan


def test_no_cells_hold_nothing():
    cells = no_cells(SIZE)
    assert cells.size == SIZE
    assert fresh_sums(cells).shape == (2, 0)
