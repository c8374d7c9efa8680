"""Viewpoints on the spot and within reach: drawn, then refined around the best."""

from __future__ import annotations

import math

from entropy_explore_env.belief.paths.lattice import cell_of
from entropy_explore_env.belief.paths.planning import resume_search, start_search
from entropy_explore_env.belief.paths.search import length_to
from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.planner.memory import copy_numbers, value_of, worth_bits
from entropy_explore_env.planner.records import Kind
from entropy_explore_env.planner.thresholds import (
    PATHS_WITHIN,
    PITCH_SPREAD,
    REFINED_AROUND,
    REFINED_SHIFT,
    REFINED_SHRINK,
    YAW_SPREAD,
)
from entropy_explore_env.randomness import draw_gaussian, draw_uniform
from entropy_explore_env.viewpoints.evaluation import indices_at, straight_seconds, travel_seconds
from entropy_explore_env.viewpoints.expected_scan import fill_bits

_SPOT, _NEAR = int(Kind.SPOT), int(Kind.NEAR)


@lean_kernel
def start_paths(proposer, situation):
    """Begin a search for paths from where the robot is, and search what lies within reach."""
    scratch, lattice = proposer.scratch, proposer.lattice
    scratch.source[0] = cell_of(lattice, indices_at(lattice.grid, situation.knowledge.pose))
    start_search(scratch.search, lattice, situation.costs, scratch.source)
    search_within(proposer, situation, PATHS_WITHIN * proposer.within + 1.0)


@lean_kernel
def search_within(proposer, situation, length):
    """Continue the search until the cheapest paths up to a length in voxel edges are found."""
    lattice = proposer.lattice
    resume_search(proposer.scratch.search, lattice, situation.costs, length / lattice.edge)


@lean_kernel
def cost_of(proposer, situation, at):
    """Return the cost, in voxel edges, of the path to a place that the search found; inf = none."""
    lattice = proposer.lattice
    return length_to(proposer.scratch.search, lattice, situation.costs, indices_at(lattice.grid, at))


@lean_kernel
def _normalise(proposer, at, pitch):
    """Bring a gaze into its range; robots that look level keep their pitch."""
    at[3] = (at[3] + math.pi) % (2.0 * math.pi) - math.pi
    if proposer.level:
        at[4] = pitch
    else:
        at[4] = min(max(at[4], -0.5 * math.pi), 0.5 * math.pi)


@lean_kernel
def _inside(coordinate, here, voxels):
    """Return a coordinate no nearer to a face of the workspace than half a voxel, or than the robot is."""
    return min(max(coordinate, min(0.5, here)), max(voxels - 0.5, here))


@lean_kernel
def _draw_place(proposer, situation, rng, at):
    """Draw a place, uniform in the ball within reach, clipped to the workspace."""
    here, size, axes = situation.knowledge.pose, situation.belief.size, proposer.axes
    squared = 0.0
    for axis in range(axes):
        at[axis] = draw_gaussian(rng)
        squared += at[axis] * at[axis]
    length = proposer.within * draw_uniform(rng) ** (1.0 / axes) / max(math.sqrt(squared), 1e-300)
    for axis in range(axes):
        at[axis] = _inside(here[axis] + length * at[axis], here[axis], size[axis])


@lean_kernel
def draw_viewpoint(proposer, situation, rng, at):
    """Draw a viewpoint within reach, with any gaze."""
    copy_numbers(situation.knowledge.pose, at)
    at[3] = math.pi * (2.0 * draw_uniform(rng) - 1.0)
    at[4] = math.asin(2.0 * draw_uniform(rng) - 1.0)
    _draw_place(proposer, situation, rng, at)
    _normalise(proposer, at, situation.knowledge.pose[4])


@lean_kernel
def _draw_nearby(proposer, situation):
    """Draw gazes around the present one, any gazes on the spot, and places; return how many these are."""
    recipe, rng, here = proposer.recipe, situation.experience.candidates_rng, situation.knowledge.pose
    count = recipe.gazes + recipe.turns + recipe.places
    for k in range(count):
        at = proposer.scratch.pool[k].viewpoint
        copy_numbers(here, at)
        if proposer.all_around:
            if k > 0:
                at[3] += proposer.refined_rad * draw_gaussian(rng)
        elif k < recipe.gazes:
            at[3] += YAW_SPREAD * proposer.view_rad[0] * draw_gaussian(rng)
            at[4] += PITCH_SPREAD * proposer.view_rad[1] * draw_gaussian(rng)
        else:
            at[3] = math.pi * (2.0 * draw_uniform(rng) - 1.0)
            at[4] = math.asin(2.0 * draw_uniform(rng) - 1.0)
        if k >= count - recipe.places:
            _draw_place(proposer, situation, rng, at)
        _normalise(proposer, at, here[4])
    return count


@lean_kernel
def _vary(proposer, situation, spread, at):
    """Turn and shift a viewpoint a little, in place; one on the spot stays there, none leaves the reach."""
    rng, here, size = situation.experience.candidates_rng, situation.knowledge.pose, situation.belief.size
    at[3] += spread * draw_gaussian(rng)
    at[4] += spread * draw_gaussian(rng)
    moved, squared = 0.0, 0.0
    for axis in range(proposer.axes):
        moved += abs(at[axis] - here[axis])
    if moved > 0.0:
        for axis in range(proposer.axes):
            at[axis] += REFINED_SHIFT * proposer.within * draw_gaussian(rng)
            squared += (at[axis] - here[axis]) ** 2
        longer = max(math.sqrt(squared) / proposer.within, 1.0)
        for axis in range(proposer.axes):
            at[axis] = _inside(here[axis] + (at[axis] - here[axis]) / longer, here[axis], size[axis])
    _normalise(proposer, at, here[4])


@lean_kernel
def _fill_value(proposer, situation, filled, option):
    """Fill in the bits of a scan at an OPTION, and what it is worth with the number of scans that pays most.

    Args:
        proposer: See `model`; the bits of scans there are in its scratch.
        situation: See `model`.
        filled: See `fill_bits`.
        option: OPTION, whose seconds are finite.
    """
    bits, scan_s = proposer.scratch.scan.bits, proposer.drive.scan_time_s
    option.bits = option.stop_bits = worth_bits(proposer, situation, option.viewpoint, bits[0])
    option.value = value_of(proposer, situation, option.bits, option.seconds)
    for n in range(1, filled):
        seconds = option.seconds + (2**n - 1) * scan_s
        worth = option.bits * bits[n] / max(bits[0], 1e-300)
        option.value = max(option.value, value_of(proposer, situation, worth, seconds))


@lean_kernel
def evaluate(proposer, situation, scan, options, far):
    """Fill in what viewpoints (N,) OPTION are worth, with scans imagined by a ScanModel.

    To those that are `far` it drives along paths, which have been searched, with a scan after each reach.
    """
    scratch, belief, here = proposer.scratch, situation.belief, situation.knowledge.pose
    drive, edge_m, along_paths = proposer.drive, scan.voxel_size_m, far or proposer.planned
    reach = proposer.reach if far else math.inf
    for k in range(len(options)):
        option = options[k]
        at = option.viewpoint
        if along_paths:
            cost = cost_of(proposer, situation, at)
            option.seconds = travel_seconds(drive, edge_m, here, at, cost, reach)
        else:
            option.seconds = straight_seconds(belief, edge_m, drive, here, at, scratch.scan)
        option.bits, option.stop_bits, option.value = 0.0, 0.0, 0.0
        if option.seconds < math.inf:
            _fill_value(proposer, situation, fill_bits(belief, scan, at, scratch.scan), option)
        moved = at[0] != here[0] or at[1] != here[1] or at[2] != here[2]
        option.kind = _NEAR if moved else _SPOT
        copy_numbers(at, option.goal)


@lean_kernel
def _take_best(pool, order, count, most):
    """Bring the numbers of the `most` best to the front of `order`, and return how many there are."""
    most = min(most, count)
    for place in range(most):
        best = place
        for other in range(place + 1, count):
            if pool[order[other]].value > pool[order[best]].value:
                best = other
        order[place], order[best] = order[best], order[place]
    return most


@lean_kernel
def propose_nearby(proposer, situation):
    """Fill the pool with viewpoints on the spot and within reach.

    The numbers of the viewpoints refined last and of the best of all are left in `scratch.order`, the best
    one first.

    Returns:
        How many there are in the pool.
    """
    pool, order, recipe = proposer.scratch.pool, proposer.scratch.order, proposer.recipe
    size = _draw_nearby(proposer, situation)
    evaluate(proposer, situation, proposer.drawn, pool[:size], False)
    for k in range(size):
        order[k] = k
    count, spread = size, proposer.refined_rad
    for number in range(recipe.refinements):
        best = _take_best(pool, order, count, REFINED_AROUND)
        first, copies = size, max(recipe.refined // best, 1)
        for k in range(best):
            for _ in range(copies):
                copy_numbers(pool[order[k]].viewpoint, pool[size].viewpoint)
                _vary(proposer, situation, spread, pool[size].viewpoint)
                size += 1
        if number == 0 and recipe.draw_thinning != recipe.thinning:
            for k in range(best):
                drawn = pool[order[k] : order[k] + 1]
                evaluate(proposer, situation, proposer.refined, drawn, False)
        evaluate(proposer, situation, proposer.refined, pool[first:size], False)
        count = best + size - first
        for k in range(first, size):
            order[best + k - first] = k
        spread *= REFINED_SHRINK
    _take_best(pool, order, count, 1)
    return size
