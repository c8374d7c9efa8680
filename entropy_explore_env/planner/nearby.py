"""Viewpoints on the spot and within reach: drawn, then refined around the best; in grid units."""

from __future__ import annotations

import math

from entropy_explore_env.belief.paths.planning import resume_search, start_search
from entropy_explore_env.belief.paths.search import extract_path
from entropy_explore_env.belief.visibility import mark_cones
from entropy_explore_env.belief.voxel_index import flat_index
from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.planner.records import Kind
from entropy_explore_env.planner.situation import worth_bits
from entropy_explore_env.randomness import draw_gaussian, draw_uniform
from entropy_explore_env.viewpoints.evaluation import straight_seconds
from entropy_explore_env.viewpoints.imagined_scan import imagined_bits
from entropy_explore_env.viewpoints.path_scans import combined_bits, fill_path_scans
from entropy_explore_env.viewpoints.travel import travel_seconds

_SPOT, _NEAR = int(Kind.SPOT), int(Kind.NEAR)
_BEST = 3
"""Number of viewpoints around which others are drawn."""
_SHRINK = 0.7
"""How much less refined viewpoints differ from one refinement to the next."""
_SHIFT = 0.2
"""Standard deviation by which refined places differ along an axis, in reaches."""
AROUND_CORNERS = 1.6
"""Longest path to a place within reach, in reaches."""


@lean_kernel
def copy_viewpoint(source, target):
    """Copy five numbers."""
    for i in range(5):
        target[i] = source[i]


@lean_kernel
def start_paths(proposer, situation):
    """Begin a search for paths from where the robot is, and search what lies within reach."""
    scratch, size = proposer.scratch, situation.belief.size
    scratch.source[0] = voxel_at(size, situation.here)
    start_search(scratch.search, proposer.lattice, situation.costs, scratch.source)
    farthest = AROUND_CORNERS * proposer.within + 1.0
    resume_search(scratch.search, proposer.lattice, situation.costs, farthest)


@lean_kernel
def voxel_at(size, at):
    """Number of the voxel of a place in the workspace."""
    x = min(max(int(at[0]), 0), size[0] - 1)
    y = min(max(int(at[1]), 0), size[1] - 1)
    z = min(max(int(at[2]), 0), size[2] - 1)
    return flat_index(size, x, y, z)


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
    """A coordinate no nearer to a face of the workspace than half a voxel, or than the robot is."""
    return min(max(coordinate, min(0.5, here)), max(voxels - 0.5, here))


@lean_kernel
def _draw_place(proposer, situation, rng, at):
    """Draw a place, uniform in the ball within reach, clipped to the workspace."""
    here, size, axes = situation.here, situation.belief.size, proposer.axes
    squared = 0.0
    for axis in range(axes):
        at[axis] = draw_gaussian(rng)
        squared += at[axis] * at[axis]
    length = proposer.within * draw_uniform(rng) ** (1.0 / axes) / max(math.sqrt(squared), 1e-300)
    for axis in range(axes):
        at[axis] = _inside(here[axis] + length * at[axis], here[axis], size[axis])


@lean_kernel
def draw_nearby(proposer, situation, viewpoints):
    """Fill in gazes around the present one, any gaze on the spot, and places within reach.

    Args:
        proposer: A Proposer.
        situation: A Situation.
        viewpoints: (N, 5), of which the first are filled in.

    Returns:
        How many.
    """
    recipe, rng, here = proposer.recipe, situation.experience.candidates_rng, situation.here
    count = recipe.gazes + recipe.turns + recipe.places
    for k in range(count):
        at = viewpoints[k]
        copy_viewpoint(here, at)
        if proposer.all_around:
            if k > 0:
                at[3] += recipe.vary_spread * draw_gaussian(rng)
        elif k < recipe.gazes:
            at[3] += recipe.yaw_spread * draw_gaussian(rng)
            at[4] += recipe.pitch_spread * draw_gaussian(rng)
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
    rng, here, size, axes = (
        situation.experience.candidates_rng,
        situation.here,
        situation.belief.size,
        proposer.axes,
    )
    at[3] += spread * draw_gaussian(rng)
    at[4] += spread * draw_gaussian(rng)
    moved, squared = 0.0, 0.0
    for axis in range(axes):
        moved += abs(at[axis] - here[axis])
    if moved > 0.0:
        for axis in range(axes):
            at[axis] += _SHIFT * proposer.within * draw_gaussian(rng)
            squared += (at[axis] - here[axis]) ** 2
        longer = max(math.sqrt(squared) / proposer.within, 1.0)
        for axis in range(axes):
            at[axis] = _inside(here[axis] + (at[axis] - here[axis]) / longer, here[axis], size[axis])
    _normalise(proposer, at, here[4])


@lean_kernel
def value_of(situation, bits, seconds):
    """Bits / s^c; 0 where there is no path."""
    return bits / seconds**situation.experience.exponent if seconds < math.inf else 0.0


@lean_kernel
def evaluate(proposer, situation, scan, first, last):
    """Fill in what viewpoints of the pool within reach, `first` … `last` - 1, are worth.

    Args:
        proposer: A Proposer.
        situation: A Situation; where the robot plans its paths, they have been searched.
        scan: The ScanModel by which scans are imagined.
        first: The first one.
        last: One past the last.
    """
    pool, belief, here = proposer.scratch.pool, situation.belief, situation.here
    viewpoints, seconds = pool.viewpoints[first:last], pool.seconds[first:last]
    bits, edge_m = pool.bits[first:last], scan.voxel_size_m
    if proposer.planned:
        search = proposer.scratch.search
        travel_seconds(search, belief.size, proposer.drive, edge_m, here, viewpoints, math.inf, seconds)
    else:
        straight_seconds(belief, edge_m, proposer.drive, here, viewpoints, proposer.scratch.scan, seconds)
    gap = proposer.recipe.gap_probability
    imagined_bits(belief, scan, gap, viewpoints, situation.cones, proposer.scratch.scan, bits)
    for k in range(first, last):
        at = pool.viewpoints[k]
        pool.bits[k] = pool.stop_bits[k] = worth_bits(proposer, situation, at, pool.bits[k])
        pool.values[k] = value_of(situation, pool.bits[k], pool.seconds[k])
        moved = at[0] != here[0] or at[1] != here[1] or at[2] != here[2]
        pool.kinds[k] = _NEAR if moved else _SPOT
        copy_viewpoint(at, pool.goals[k])
    if proposer.recipe.path_scans > 0:
        value_path_scans(proposer, situation, scan, pool, first, last, proposer.planned)


@lean_kernel
def value_path_scans(proposer, situation, scan, pool, first, last, searched):
    """Let scans on the path count in the values of viewpoints `first` … `last` - 1 of a pool.

    Args:
        proposer: A Proposer.
        situation: A Situation.
        scan: The ScanModel by which scans are imagined.
        pool: With their bits, seconds and values.
        first: The first one.
        last: One past the last.
        searched: Whether paths lead to them as the latest search found them; else they are straight.
    """
    scratch, belief, here, recipe = proposer.scratch, situation.belief, situation.here, proposer.recipe
    size, every, since_scan = belief.size, proposer.scan_every, situation.since_scan
    scan_poses, lattice = scratch.scan_poses[: recipe.path_scans], proposer.lattice
    reach = proposer.reach if searched else math.inf
    mark_cones(situation.cones, size, scratch.scan.left, 1)
    for k in range(first, last):
        at, count = pool.viewpoints[k], 0
        if pool.values[k] <= 0.0:
            continue
        if searched:
            count = extract_path(scratch.search, lattice, voxel_at(size, at), scratch.path)
        taken = fill_path_scans(
            lattice, size, scratch.path, count, here, at, every, since_scan, reach, scan_poses
        )
        if taken > 0:
            bits = combined_bits(belief, scan, recipe.gap_probability, scan_poses[:taken], at, scratch.scan)
            bits -= taken * recipe.dregs * situation.experience.most_bits
            bits = max(worth_bits(proposer, situation, at, bits), pool.bits[k])
            pool.values[k] = value_of(situation, bits, pool.seconds[k])
    mark_cones(situation.cones, size, scratch.scan.left, 0)


@lean_kernel
def _take_best(values, found, count, most):
    """Bring the numbers of the `most` best to the front of `found`; returns how many there are."""
    most = min(most, count)
    for place in range(most):
        best = place
        for other in range(place + 1, count):
            if values[found[other]] > values[found[best]]:
                best = other
        found[place], found[best] = found[best], found[place]
    return most


@lean_kernel
def propose_nearby(proposer, situation):
    """Fill the pool with viewpoints on the spot and within reach.

    Args:
        proposer: A Proposer; the numbers of the last refined viewpoints and of the best of all are left in
            `scratch.found`, the best one first.
        situation: A Situation.

    Returns:
        How many there are in the pool.
    """
    pool, found, recipe = proposer.scratch.pool, proposer.scratch.found, proposer.recipe
    size = draw_nearby(proposer, situation, pool.viewpoints)
    evaluate(proposer, situation, proposer.drawn, 0, size)
    for k in range(size):
        found[k] = k
    count, spread = size, recipe.vary_spread
    for number in range(recipe.refinements):
        best = _take_best(pool.values, found, count, _BEST)
        copies = max(recipe.refined // best, 1)
        first = size
        for k in range(best):
            for _ in range(copies):
                copy_viewpoint(pool.viewpoints[found[k]], pool.viewpoints[size])
                _vary(proposer, situation, spread, pool.viewpoints[size])
                size += 1
        if number == 0 and recipe.thinned:
            for k in range(best):
                evaluate(proposer, situation, proposer.exact, found[k], found[k] + 1)
        evaluate(proposer, situation, proposer.exact, first, size)
        count = best + size - first
        for k in range(first, size):
            found[best + k - first] = k
        spread *= _SHRINK
    _take_best(pool.values, found, count, 1)
    return size
