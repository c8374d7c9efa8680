"""Costs of paths on small grids: as a graph of steps, drawn at random, and as searches find them."""

import itertools
import math

import numpy as np
from scipy.sparse import csr_matrix

from entropy_explore_env.belief.paths.lattice import KNOWN_RATIO, NO_FLY_NOWHERE, Costs, costs_of, new_lattice
from entropy_explore_env.belief.paths.planning import ANY_GOAL, search_paths
from entropy_explore_env.belief.paths.search import cost_to, extract_path, new_search
from entropy_explore_env.compilation.kernels import lean_kernel
from tests.reference.scenes import flat_index

PRIOR = 1.0 / 900.0
KNOWN, UNKNOWN = 100.0, PRIOR


def graph_of(rates, layer=None, length_cost=0.0, by_length=True):
    """Steps between neighbours, (V, V) sparse: none past a corner that is impassable.

    A step costs the mean rate of its ends, times its length unless that does not count, and its length.
    """
    shape, edges = rates.shape, {}
    for voxel in np.ndindex(*shape):
        for step in itertools.product((-1, 0, 1), repeat=3):
            near = tuple(np.add(voxel, step).tolist())
            if not any(step) or not all(0 <= n < size for n, size in zip(near, shape, strict=True)):
                continue
            if layer is not None and (voxel[2] != layer or step[2] != 0):
                continue
            passed = itertools.product(*({0, axis} for axis in step))
            if all(math.isfinite(rates[tuple(np.add(voxel, part).tolist())]) for part in passed):
                rate = 0.5 * (float(rates[voxel]) + float(rates[near]))
                length = math.dist(voxel, near)
                edges[np.ravel_multi_index(voxel, shape), np.ravel_multi_index(near, shape)] = (
                    rate * (length if by_length else 1.0) + length_cost * length
                )
    rows, columns = zip(*edges, strict=True) if edges else ((), ())
    return csr_matrix((list(edges.values()), (rows, columns)), shape=(rates.size, rates.size))


def random_rates(shape, seed, decades, walls=0.25):
    rng = np.random.default_rng(seed)
    rates = (10.0 ** rng.uniform(-decades, decades, shape)).astype(np.float32)
    rates[rng.random(shape) < walls] = math.inf
    rates.ravel()[rng.integers(rates.size)] = 1.0
    return rates


def known(covered):
    """Mean and precision of a belief that is sure of everything."""
    return covered.astype(np.float32), np.full(covered.shape, KNOWN, np.float32)


def flat_field(field):
    """A field by voxel number, read-only, so that kernels are compiled for one kind of array."""
    flat = np.ascontiguousarray(field, np.float32).reshape(-1).view()
    flat.setflags(write=False)
    return flat


def belief_costs(mean, precision, prior_precision, unknown_cost=1.0, no_fly=NO_FLY_NOWHERE):
    """Traversal costs of a belief, arrays (X, Y, Z) or (V,)."""
    flat, least = flat_field(mean), KNOWN_RATIO * float(prior_precision)
    return Costs(flat, flat_field(precision), least, float(unknown_cost), flat[:0], 1.0, no_fly.reshape(-1))


def field_costs(per_edge):
    """Traversal costs that are given voxel by voxel, > 0; inf = impassable."""
    flat = flat_field(per_edge)
    least = float(flat.min(initial=np.inf))
    return costs_of(flat, least if math.isfinite(least) else 1.0)


@lean_kernel
def costs_to_all(search, costs):
    """Fill (V,) with the costs of reaching all voxels in the latest search; inf = not reached."""
    for voxel in range(len(costs)):
        costs[voxel] = cost_to(search, voxel)


def shortest_path(search, lattice, costs, start, goal, max_cost=math.inf):
    """Cost and voxels (N,) of the cheapest path from a voxel to another; inf and no voxels without a path."""
    cost = search_paths(search, lattice, costs, np.array([start], np.int32), int(goal), float(max_cost))
    path = np.empty(extract_path(search, lattice, int(goal), np.empty(0, np.int32)), np.int32)
    extract_path(search, lattice, int(goal), path)
    return float(cost), path


def all_costs(search, lattice, costs, sources, max_cost=math.inf):
    """(X, Y, Z) costs of the paths from the nearest of some voxels."""
    cost = np.empty(lattice.size)
    search_paths(search, lattice, costs, np.array(sources, np.int32), ANY_GOAL, float(max_cost))
    costs_to_all(search, cost.reshape(-1))
    return cost


def plan(mean, precision, start, goal, radius=0.0, layer=None, unknown_cost=1.0, max_cost=math.inf):
    """Cost and voxels (N, 3) of a path through a belief."""
    costs = belief_costs(mean, precision, PRIOR, unknown_cost)
    lattice = new_lattice(mean.shape, radius, layer)
    ends = flat_index([start, goal], mean.shape)
    cost, path = shortest_path(new_search(mean.size), lattice, costs, *ends, max_cost)
    return cost, np.stack(np.unravel_index(path, mean.shape), axis=-1)
