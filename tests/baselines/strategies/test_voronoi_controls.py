"""Controls of Voronoi coverage against naive ones, and by hand."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from baselines.strategies.voronoi.controls import (
    CellFunctional,
    coverage_functionals,
    gradient_step,
    nearest_uncertain,
    neighbours,
    projected_centroids,
    step_is_free,
)
from entropy_explore_env.belief.paths.geodesic_cells import (
    UNREACHED,
    extract_path,
    new_tessellation,
    tessellate,
)
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
        return UNREACHED, 0
    weights = [float(density[at]) for at in voxels]
    total = sum(weights)
    centre = [sum(w * at[axis] for w, at in zip(weights, voxels, strict=True)) / total for axis in range(3)]
    high = [at for at in voxels if density[at] >= np.float32(threshold)]
    among = high or voxels
    away = [sum((at[axis] - centre[axis]) ** 2 for axis in range(3)) for at in among]
    return int(np.ravel_multi_index(among[int(np.argmin(away))], cells.shape)), len(high)


@given(st.sampled_from(SHAPES), seeds, st.sampled_from([0.2, 0.69, 0.8]), st.booleans())
@drawn(30)
def test_targets_are_those_of_the_equations(size, seed, threshold, by_length):
    _, density, sources, space = scene(size, seed, by_length)
    threshold = float(np.float32(threshold))
    targets, uncertain = projected_centroids(space.cells, density, threshold, len(sources))
    near = nearest_uncertain(space.cells, space.costs, density, threshold, len(sources))
    functionals = coverage_functionals(space.cells, space.costs, density, len(sources))
    for cell in range(len(sources)):
        target, high = by_hand(space.cells, density, threshold, cell)
        assert uncertain[cell] == high
        if target != UNREACHED:  # rounding may choose between equals
            place, ours = (np.unravel_index(int(v), size) for v in (target, targets[cell]))
            own = space.cells == cell
            weights = np.where(own, density, 0.0).astype(float)
            centre = [(np.indices(size)[a] * weights).sum() / weights.sum() for a in range(3)]
            away = [math.dist([float(i) for i in at], centre) for at in (place, ours)]
            assert away[0] == pytest.approx(away[1]) and own[ours]
        mask = (space.cells == cell) & (density >= np.float32(threshold))
        costs = np.where(mask, space.costs, np.inf).reshape(-1)
        assert near[cell] == (int(np.argmin(costs)) if mask.any() else UNREACHED)
        own = space.cells == cell
        assert functionals[cell] == pytest.approx((space.costs[own] ** 2 * density[own]).sum())


def test_a_centroid_outside_of_its_cell_by_hand():
    """A U of nine voxels: the centroid, (1, 4/3), lies in the gap; two voxels are as near to it."""
    cells = np.full((3, 4, 1), UNREACHED, np.int32)
    cells[0, :, 0] = cells[2, :, 0] = 0
    cells[1, 0, 0] = 0
    density = np.ones((3, 4, 1), np.float32)
    targets, uncertain = projected_centroids(cells, density, 2.0, 2)
    assert (targets.tolist(), uncertain.tolist()) == (
        [1, UNREACHED],
        [0, 0],
    )  # (0, 1) before (2, 1): by number
    density[2, 3, 0] = 3.0
    targets, uncertain = projected_centroids(cells, density, 2.0, 2)
    assert (targets.tolist(), uncertain.tolist()) == ([11, UNREACHED], [1, 0])


@given(st.sampled_from(SHAPES), seeds, st.booleans())
@drawn(30)
def test_paths_stay_in_the_cell_and_cost_what_the_tessellation_says(size, seed, by_length):
    rates, _, sources, space = scene(size, seed, by_length)
    for voxel in range(0, rates.size, 3):
        path = extract_path(space, rates, voxel, 0.01, by_length)
        cell = space.cells.reshape(-1)[voxel]
        if cell == UNREACHED:
            assert len(path) == 0
            continue
        assert path[0] == sources[cell] and path[-1] == voxel
        assert (space.cells.reshape(-1)[path] == cell).all()
        cost = 0.0
        for here, there in itertools.pairwise(path.tolist()):
            assert there in neighbours(np.isfinite(rates), here)
            axes = np.abs(np.subtract(np.unravel_index(here, size), np.unravel_index(there, size))).sum()
            length, flat = math.sqrt(axes), rates.reshape(-1)
            mean = 0.5 * (float(flat[here]) + float(flat[there]))
            cost += mean * (length if by_length else 1.0) + 0.01 * length
        assert cost == pytest.approx(float(space.costs.reshape(-1)[voxel]), rel=1e-6)


@given(st.sampled_from(SHAPES), seeds)
@drawn(30)
def test_a_step_is_free_where_it_leads_to_a_neighbour(size, seed):
    coverage = (np.random.default_rng(seed).random(size) < 0.3).astype(np.float32)
    voxels = np.random.default_rng(seed).integers(0, coverage.size, (20, 2))
    near = [(v, v + o) for v in voxels[:, 0] for o in (1, -1, size[2], size[1] * size[2] + 1)]
    for here, there in [*voxels.tolist(), *near]:
        if 0 <= there < coverage.size and here != there:
            free = coverage <= 0.5
            free.reshape(-1)[here] = True
            expected = there in neighbours(free, int(here))
            assert step_is_free(coverage.reshape(-1), size, int(here), int(there)) == expected


def test_no_step_cuts_a_corner():
    free = np.ones((2, 2, 1), bool)
    assert neighbours(free, 0) == [1, 2, 3]
    free[0, 1] = False
    assert neighbours(free, 0) == [2]
    assert not step_is_free((~free).astype(np.float32).reshape(-1), (2, 2, 1), 0, 3)


def test_gradient_search_walks_to_the_middle_of_a_corridor():
    size = (9, 1, 1)
    rates, space = np.ones(size, np.float32), new_tessellation(size)
    density, cell = np.ones(size, np.float32), np.ones(size, bool)
    functional, place, path = CellFunctional(space, rates, density, cell), 1, [1]
    assert functional.value(1, 0.0, True) == 1 + sum(k * k for k in range(8))
    while (step := gradient_step(functional, cell, place, 0.0, True)) != place:
        place = step
        path.append(step)
    assert path == [1, 2, 3, 4]


def test_a_place_from_which_the_cell_cannot_be_reached_whole_is_worth_nothing():
    size = (5, 1, 1)
    rates, cell = np.ones(size, np.float32), np.array([1, 1, 0, 1, 1], bool).reshape(size)
    functional = CellFunctional(new_tessellation(size), rates, np.ones(size, np.float32), cell)
    assert functional.value(0, 0.0, True) == math.inf
