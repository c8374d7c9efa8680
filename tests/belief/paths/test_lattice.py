"""Lattices of cells of several voxels: what is passable, what paths cost, and that walls part them."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.sparse.csgraph import dijkstra

from entropy_explore_env.belief.paths.lattice import longest_edge, new_lattice
from entropy_explore_env.belief.paths.search import length_to, new_search
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.worlds.world import World
from tests.belief.paths.graphs import KNOWN, PRIOR, UNKNOWN, all_costs, belief_costs, graph_of
from tests.reference.scenes import drawn, random_cover, seeds

SHAPES = [(7, 11, 5), (9, 8, 6), (13, 6, 7)]


def cells_of(values, edge, fill):
    """(I, J, K, edge³) the values of the voxels of each cell, in the order of the grid; `fill` beyond it."""
    counts = [-(-n // edge) for n in values.shape]
    padded = np.full([n * edge for n in counts], fill, values.dtype)
    padded[tuple(slice(n) for n in values.shape)] = values
    split = padded.reshape(counts[0], edge, counts[1], edge, counts[2], edge)
    return split.transpose(0, 2, 4, 1, 3, 5).reshape(*counts, edge**3)


@drawn(40)
@given(seeds, st.sampled_from(SHAPES), st.sampled_from([0.0, 0.6, 1.2, 1.6]), st.integers(2, 3))
def test_a_cell_is_as_its_first_voxel_in_which_the_body_fits(seed, shape, radius, edge):
    rng = np.random.default_rng(seed)
    covered = random_cover(shape, 0.05, seed) > 0.5
    covered.ravel()[0] = False
    blocked = World(Grid(shape, 1.0), covered, "drawn").collision_mask(radius) > 0
    precision = np.where(rng.random(shape) < 0.4, UNKNOWN, KNOWN).astype(np.float32)
    rates = cells_of(np.where(blocked, math.inf, np.where(precision == UNKNOWN, 2.5, 1.0)), edge, math.inf)
    first = np.isfinite(rates).argmax(axis=-1)
    of_cells = np.take_along_axis(rates, first[..., None], axis=-1)[..., 0]
    passable = np.flatnonzero(np.isfinite(of_cells))
    if len(passable) == 0:
        return
    source = int(rng.choice(passable))
    costs = belief_costs(covered.astype(np.float32), precision, PRIOR, 2.5)
    search, lattice = new_search(covered.size), new_lattice(shape, radius, None, edge)
    found = all_costs(search, lattice, costs, [source])
    expected = dijkstra(graph_of(of_cells), indices=source).reshape(of_cells.shape)
    np.testing.assert_allclose(found, expected, rtol=1e-8)
    for voxel in np.ndindex(*shape):
        cost = edge * expected[tuple(n // edge for n in voxel)]
        length = length_to(search, lattice, costs, voxel)
        assert length == pytest.approx(math.inf if blocked[voxel] else cost, rel=1e-8)


@drawn(60)
@given(seeds, st.sampled_from([1.0, 1.5, 2.0, 2.6, 3.0]), st.integers(0, 2))
def test_no_steps_between_cells_lead_through_a_wall(seed, radius, offset):
    """A wall as thin as a voxel, in any direction, in a box; searches begin on one side of it."""
    shape = (17 + offset, 19, 16)
    rng = np.random.default_rng(seed)
    normal = rng.normal(size=3)
    normal /= np.linalg.norm(normal)
    centres = np.stack(np.indices(shape), axis=-1) + 0.5
    side = (centres - (np.array(shape) / 2 + rng.uniform(-2.0, 2.0, 3))) @ normal
    covered = np.abs(side) <= 0.5 * np.abs(normal).sum()  # all voxels that the plane crosses
    fits = World(Grid(shape, 1.0), covered, "wall").collision_mask(radius) == 0
    edge = longest_edge(radius)
    lattice = new_lattice(shape, radius, None, edge)
    above = cells_of(fits & (side > 0.0), edge, False).any(axis=-1)
    below = cells_of(fits & (side < 0.0), edge, False).any(axis=-1)
    if not above.any():
        return
    costs = belief_costs(covered.astype(np.float32), np.full(shape, KNOWN, np.float32), PRIOR)
    found = all_costs(new_search(covered.size), lattice, costs, [int(np.flatnonzero(above)[0])])
    assert not np.isfinite(found[below]).any()


def test_edges_grow_with_the_body():
    assert [longest_edge(radius) for radius in (0.0, 0.5, 1.0, 1.7, 3.0, 6.0)] == [1, 1, 1, 2, 3, 5]
