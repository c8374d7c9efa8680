"""Blocks of a belief against a slow count, and their neighbourhoods."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from entropy_explore_env.belief.fields import Belief
from entropy_explore_env.belief.paths.lattice import new_lattice
from entropy_explore_env.belief.paths.planning import ANY_GOAL, search_paths
from entropy_explore_env.belief.paths.search import cost_to, new_search
from entropy_explore_env.planner.far_places import (
    NOT_FREE,
    NOT_REACHED,
    BitCount,
    FoundPaths,
    bits_around,
    fill_blocks,
    new_blocks,
    place_of,
    promised_around,
)
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.worlds.world import World
from tests.belief.paths.graphs import belief_costs
from tests.reference.scenes import random_belief

SIZE, EDGE, TARGET = (7, 11, 5), 3, 400.0
BEHIND = 0.75


def lies_beside_free(mean, precision, seen, voxel):
    """Whether one of six neighbours is known to be free."""
    for axis, step in itertools.product(range(3), (-1, 1)):
        beside = list(voxel)
        beside[axis] += step
        if 0 <= beside[axis] < SIZE[axis]:
            at = tuple(beside)
            if precision[at] >= seen and mean[at] <= 0.5:
                return True
    return False


@pytest.mark.parametrize(("seed", "layer"), [(0, -1), (1, -1), (2, 3)])
def test_blocks_are_those_of_a_slow_count(seed, layer):
    mean, precision = random_belief(SIZE, seed)
    mean[3, 5, :] = 0.0
    seen = float(np.median(precision))
    search, lattice = new_search(mean.size), new_lattice(SIZE, 0.0, None if layer < 0 else layer)
    start = int(np.ravel_multi_index((3, 5, 3), SIZE))
    source = np.array([start], np.int32)
    costs = belief_costs(mean, precision, 1e-3)
    search_paths(search, lattice, costs, source, ANY_GOAL, math.inf)
    blocks, radius = new_blocks(SIZE, EDGE), 3
    belief = Belief(mean.reshape(-1), precision.reshape(-1), SIZE)
    fill_blocks(belief, BitCount(TARGET, seen, BEHIND), start, radius, blocks)
    paths = FoundPaths(search, lattice, costs)
    assert blocks.bits.shape == (3, 4, 2)
    both, places = 0, 0
    for index in itertools.product(*map(range, blocks.bits.shape)):
        low = np.array(index) * EDGE
        high = np.minimum(low + EDGE, SIZE)
        outside = (low > np.array((3, 5, 3)) + radius).any() or (high <= np.array((3, 5, 3)) - radius).any()
        bits, promised, reached, none = 0.0, 0.0, {}, NOT_FREE
        for voxel in itertools.product(*(range(a, b) for a, b in zip(low, high, strict=True))):
            if mean[voxel] <= 0.5:
                left = max(0.5 * math.log2(TARGET / float(precision[voxel])), 0.0)
                bits += left
                known = precision[voxel] >= seen
                if known:
                    promised += left
                elif lies_beside_free(mean, precision, seen, voxel):
                    promised += BEHIND * left
                number = int(np.ravel_multi_index(voxel, SIZE))
                free = known and (layer < 0 or voxel[2] == layer)
                none = NOT_REACHED if free else none
                if free and math.isfinite(cost_to(search, number)):
                    reached[number] = float(((np.array(voxel) + 0.5 - (low + high) / 2) ** 2).sum())
        within = zip(index, blocks.window, strict=True)
        assert outside != all(first <= number < last for number, (first, last) in within)
        if outside:
            bits, promised, reached = 0.0, 0.0, {}
        assert blocks.bits[index] == pytest.approx(bits, rel=1e-6, abs=1e-9)
        assert blocks.promised[index] == pytest.approx(promised, rel=1e-6, abs=1e-9)
        both += int(0.0 < promised < bits)
        place = place_of(paths, blocks, *index) if not outside else none
        assert reached or place == none
        places += bool(reached)
        if reached:
            assert reached[place] == min(reached.values())
    assert both >= 3 and places >= 1


def test_the_bits_around_a_block_are_those_of_it_and_its_neighbours():
    blocks = new_blocks((6, 8, 1), 2)
    blocks.bits[:] = np.arange(12).reshape(3, 4, 1)
    assert bits_around(blocks.bits, 0, 0, 0) == 0 + 1 + 4 + 5
    assert bits_around(blocks.bits, 1, 2, 0) == blocks.bits[0:3, 1:4].sum()
    assert bits_around(blocks.bits, 2, 3, 0) == 6 + 7 + 10 + 11


def test_openings_promise_no_more_bits_than_remain():
    blocks = new_blocks((6, 8, 1), 2)
    blocks.bits[:] = 10.0
    blocks.promised[0, 0], blocks.promised[2, 3] = 7.0, 90.0
    assert promised_around(blocks, 1, 1, 0) == 7.0
    assert promised_around(blocks, 2, 2, 0) == 60.0


@pytest.mark.parametrize("seed", range(4))
def test_places_in_cells_are_where_a_body_stands_on_known_ground(seed):
    """A block has one if a free voxel of it is in a reached cell whose first fitting voxel is known."""
    shape, edge, radius = (20, 17, 13), 2, 1.8
    rng = np.random.default_rng(seed)
    mean, precision = np.full(shape, 0.05, np.float32), np.full(shape, 100.0, np.float32)
    mean[rng.random(shape) < 0.01] = 0.95
    mean[:8, :8, :8] = 0.05
    precision[rng.random(shape) < 0.02] = 1e-3
    precision[12 + rng.integers(4) :] = 1e-3
    belief, costs = (
        Belief(mean.reshape(-1), precision.reshape(-1), shape),
        belief_costs(mean, precision, 1e-3),
    )
    search, lattice = new_search(mean.size), new_lattice(shape, radius, None, edge)
    source = int(np.ravel_multi_index((1, 1, 1), lattice.size))
    search_paths(search, lattice, costs, np.array([source], np.int32), ANY_GOAL, math.inf)
    blocks, paths = new_blocks(shape, 4), FoundPaths(search, lattice, costs)
    fill_blocks(belief, BitCount(TARGET, 1.0, BEHIND), 0, 40, blocks)
    fits = World(Grid(shape, 1.0), mean > 0.5, "drawn").collision_mask(radius) == 0
    free, places = (mean <= 0.5) & (precision >= 1.0), 0
    for index in itertools.product(*map(range, blocks.bits.shape)):
        stands, none = set(), NOT_FREE
        for voxel in itertools.product(
            *(range(4 * n, min(4 * n + 4, m)) for n, m in zip(index, shape, strict=True))
        ):
            cell = tuple(n // edge for n in voxel)
            none = NOT_REACHED if free[voxel] else none
            if free[voxel] and math.isfinite(cost_to(search, int(np.ravel_multi_index(cell, lattice.size)))):
                inside = itertools.product(
                    *(range(edge * n, min(edge * n + edge, m)) for n, m in zip(cell, shape, strict=True))
                )
                stand = next(other for other in inside if fits[other])
                if free[stand]:
                    stands.add(int(np.ravel_multi_index(stand, shape)))
        place = place_of(paths, blocks, *index)
        assert place in stands if stands else place == none
        places += bool(stands)
    assert 3 <= places < blocks.bits.size
