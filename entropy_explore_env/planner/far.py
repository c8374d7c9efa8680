"""Far places that could be worth more than any nearer one, and the first stops on the way to them."""

from __future__ import annotations

import math

from entropy_explore_env.belief.paths.planning import resume_search
from entropy_explore_env.belief.paths.search import extract_path
from entropy_explore_env.belief.paths.string_pulling import Path, string_pull
from entropy_explore_env.belief.raycast import STOP_AT_COVERED
from entropy_explore_env.belief.voxel_index import flat_index, grid_index
from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.planner.far_places import BitCount, fill_blocks, promised_around
from entropy_explore_env.planner.nearby import (
    copy_viewpoint,
    value_of,
    value_path_scans,
    voxel_at,
)
from entropy_explore_env.planner.situation import distance_apart, worth_bits
from entropy_explore_env.planner.thresholds import FURTHER, POOR, STALE
from entropy_explore_env.randomness import draw_gaussian, draw_uniform
from entropy_explore_env.viewpoints.imagined_scan import imagined_bits
from entropy_explore_env.viewpoints.travel import WITHIN, travel_seconds

_FIRST_RADIUS = 3.0
"""Length of the paths that are searched first for far places, in reaches; then twice as much, and so on."""
_PITCH_SPREAD = 0.5
"""Standard deviation of the pitch at far places, radians."""
_FOLD_ABOVE = 1e250
"""A product is folded into bits before it could leave a float64."""


@lean_kernel
def _draw_gaze(proposer, rng, at):
    """Draw a gaze for a far place; sensors that see all around keep it."""
    if proposer.all_around:
        return
    at[3] = math.pi * (2.0 * draw_uniform(rng) - 1.0)
    if not proposer.level:
        at[4] = min(max(_PITCH_SPREAD * draw_gaussian(rng), -0.5 * math.pi), 0.5 * math.pi)


@lean_kernel
def _insert_place(proposer, situation, place, worth, far, count):
    """Insert a place among the far ones that are worth most, in order; returns how many there are."""
    worths, most = proposer.scratch.worth, proposer.recipe.far_places
    if count == most and worth <= worths[count - 1]:
        return count
    at = min(count, most - 1)
    while at > 0 and worths[at - 1] < worth:
        worths[at] = worths[at - 1]
        copy_viewpoint(far.viewpoints[at - 1], far.viewpoints[at])
        at -= 1
    worths[at] = worth
    _put_place(proposer, situation, place, far.viewpoints[at])
    return min(count + 1, most)


@lean_kernel
def _put_place(proposer, situation, place, at):
    """Write the viewpoint at the centre of a voxel, with the robot's present gaze."""
    x, y, z = grid_index(situation.belief.size, place)
    copy_viewpoint(situation.here, at)
    at[0], at[1] = x + 0.5, y + 0.5
    if not proposer.planar:
        at[2] = z + 0.5


@lean_kernel
def _count_blocks(proposer, situation, radius):
    """Fill in the blocks of the belief as far as paths were searched."""
    belief, recipe = situation.belief, proposer.recipe
    start, window = voxel_at(belief.size, situation.here), math.ceil(radius)
    count_of = BitCount(proposer.target_precision, proposer.exact.known_precision, recipe.behind)
    fill_blocks(proposer.scratch.search, belief, count_of, proposer.layer, start, window, proposer.blocks)


@lean_kernel
def _far_viewpoints(proposer, situation, far, below):
    """Fill in the places worth most by what openings promise there, a few gazes each; returns how many.

    Args:
        proposer: A Proposer, whose blocks have been counted; the worths are left in `scratch.worth`.
        situation: A Situation.
        far: Pool whose viewpoints are filled in.
        below: Only places that are worth less than this; inf = all.
    """
    scratch, blocks, recipe = proposer.scratch, proposer.blocks, proposer.recipe
    belief, here, shape = situation.belief, situation.here, blocks.bits.shape
    if recipe.far_places == 0:
        return 0
    count, one = 0, len(far.viewpoints) - 1
    viewpoint, seconds = far.viewpoints[one : one + 1], far.seconds[one : one + 1]
    edge_m, drive = proposer.exact.voxel_size_m, proposer.drive
    for i in range(shape[0]):
        for j in range(shape[1]):
            for k in range(shape[2]):
                place = blocks.place[i, j, k]
                bits = promised_around(blocks, i, j, k) if place >= 0 else 0.0
                if bits > 0.0:
                    _put_place(proposer, situation, place, viewpoint[0])
                    travel_seconds(
                        scratch.search, belief.size, drive, edge_m, here, viewpoint, proposer.reach, seconds
                    )
                    worth = value_of(situation, bits, seconds[0])
                    if worth < below:
                        count = _insert_place(proposer, situation, place, worth, far, count)
    for place in range(count - 1, -1, -1):
        for gaze in range(recipe.far_gazes - 1, -1, -1):
            at = far.viewpoints[place * recipe.far_gazes + gaze]
            copy_viewpoint(far.viewpoints[place], at)
    for number in range(count * recipe.far_gazes):
        _draw_gaze(proposer, situation.experience.candidates_rng, far.viewpoints[number])
    return count * recipe.far_gazes


@lean_kernel
def _evaluate_far(proposer, situation, far, count):
    """Fill in what the first `count` viewpoints of a pool of far ones are worth.

    Returns:
        (value, bits): the most of each.
    """
    scratch, belief, here = proposer.scratch, situation.belief, situation.here
    viewpoints, seconds, bits = far.viewpoints[:count], far.seconds[:count], far.bits[:count]
    edge_m, gap = proposer.exact.voxel_size_m, proposer.recipe.gap_probability
    drive, reach = proposer.drive, proposer.reach
    travel_seconds(scratch.search, belief.size, drive, edge_m, here, viewpoints, reach, seconds)
    imagined_bits(belief, proposer.exact, gap, viewpoints, situation.cones, scratch.scan, bits)
    best, most = 0.0, 0.0
    for k in range(count):
        far.bits[k] = worth_bits(proposer, situation, far.viewpoints[k], far.bits[k])
        far.values[k] = value_of(situation, far.bits[k], far.seconds[k])
    if proposer.recipe.path_scans > 0:
        value_path_scans(proposer, situation, proposer.exact, far, 0, count, True)
    for k in range(count):
        best, most = max(best, far.values[k]), max(most, far.bits[k])
    return best, most


@lean_kernel
def _look_further(proposer, situation, count, best, enough):
    """Go on to places that promise less, where those that promise most would bring next to nothing.

    Openings that no gaze gets to promise much and bring nothing: where so many are nearby, they would hide
    whatever is left elsewhere. So the next best places are evaluated, and those after them, as long as one of
    them could be worth more than the best that was found; the better ones take the places of the worse.

    Args:
        proposer: A Proposer; `scratch.far` holds `count` viewpoints.
        situation: A Situation.
        count: How many of them may be replaced.
        best: What the best is worth.
        enough: Bits of a viewpoint, from which on no further ones are looked for.

    Returns:
        What the best is worth then.
    """
    scratch, recipe = proposer.scratch, proposer.recipe
    far, further = scratch.far, scratch.further
    for _ in range(FURTHER):
        if (
            count == 0
            or count < recipe.far_places * recipe.far_gazes
            or scratch.worth[recipe.far_places - 1] <= best
        ):
            break
        found = _far_viewpoints(proposer, situation, further, scratch.worth[recipe.far_places - 1])
        value, bits = _evaluate_far(proposer, situation, further, found)
        for number in range(found):
            worst = 0
            for other in range(count):
                if far.values[other] < far.values[worst]:
                    worst = other
            if further.values[number] > far.values[worst]:
                copy_viewpoint(further.viewpoints[number], far.viewpoints[worst])
                far.bits[worst], far.seconds[worst] = further.bits[number], further.seconds[number]
                far.values[worst] = further.values[number]
        best = max(best, value)
        if bits >= enough or found < recipe.far_places * recipe.far_gazes:
            break
    return best


@lean_kernel
def propose_far(proposer, situation, near_bits):
    """Fill `scratch.far` with far viewpoints; the nearer half of the world first.

    Paths are searched farther and farther until no place beyond could be worth more. The goal to which the
    robot is on its way comes last, if there is one. A robot that has taken many poor scans from one place,
    and finds nothing better, looks further.

    Args:
        proposer: A Proposer; paths within reach have been searched.
        situation: A Situation.
        near_bits: Those that the best viewpoint nearby should bring.

    Returns:
        (count, value): how many there are, and what the best is worth.
    """
    scratch, experience, size = proposer.scratch, situation.experience, situation.belief.size
    far, drive = scratch.far, proposer.drive
    everywhere = float(size[0] + size[1] + size[2]) * proposer.unknown_cost
    radius, edge_m = _FIRST_RADIUS * proposer.within, proposer.exact.voxel_size_m
    enough = POOR * experience.most_bits
    while True:
        radius = min(radius, everywhere)
        resume_search(scratch.search, proposer.lattice, situation.costs, radius)
        _count_blocks(proposer, situation, radius)
        count = drawn = _far_viewpoints(proposer, situation, far, math.inf)
        if experience.going:
            copy_viewpoint(experience.goal, far.viewpoints[count])
            count += 1
        best, bits = _evaluate_far(proposer, situation, far, count)
        most_bits = (1 + proposer.recipe.path_scans) * experience.most_bits
        beyond = value_of(situation, most_bits, max(radius * edge_m / drive.max_speed_m_s, 1e-9))
        if radius >= everywhere or best >= beyond:
            if experience.poor_scans >= STALE and max(near_bits, bits) < enough:
                best = _look_further(proposer, situation, drawn, best, enough)
            return count, best
        radius *= 2.0


@lean_kernel
def first_stop(proposer, situation, goal, stop):
    """Fill in where a robot has to drive first to get to a goal.

    Args:
        proposer: A Proposer, with the search that reached the goal.
        situation: A Situation.
        goal: (5,) in grid units.
        stop: (5,) filled in: the goal where it is within reach, or the last place of the path that is.

    Returns:
        Whether there is a path.
    """
    scratch, here, size = proposer.scratch, situation.here, situation.belief.size
    search, lattice, path = scratch.search, proposer.lattice, scratch.path
    copy_viewpoint(goal, stop)
    count = extract_path(search, lattice, voxel_at(size, goal), path)
    if count == 0:
        return False
    reach = proposer.reach * WITHIN
    if not proposer.planned:
        for axis in range(3):
            scratch.ends[0, axis], scratch.ends[1, axis] = here[axis], goal[axis]
        way = Path(path, count, scratch.ends[0], scratch.ends[1])
        if string_pull(search, lattice, situation.costs, way, scratch.waypoints) == 0:
            return False
        corner = scratch.waypoints[0]
        share = min(1.0, reach / max(distance_apart(corner, here), 1e-9))
        for axis in range(3):
            stop[axis] = here[axis] + share * (corner[axis] - here[axis])
        return True
    if distance_apart(goal, here) <= reach:
        return True
    last = path[0]
    for number in range(count):
        x, y, z = grid_index(size, path[number])
        height = here[2] if lattice.layer >= 0 else z + 0.5
        away = (x + 0.5 - here[0]) ** 2 + (y + 0.5 - here[1]) ** 2 + (height - here[2]) ** 2
        if math.sqrt(away) > reach:
            break
        last = path[number]
    x, y, z = grid_index(size, last)
    stop[0], stop[1] = x + 0.5, y + 0.5
    stop[2] = here[2] if lattice.layer >= 0 else z + 0.5
    return True


@lean_kernel
def gaze_on_the_way(proposer, situation, gazes, goal, stop):
    """Give a stop on the way to a goal the best of some gazes; returns the bits that a scan should bring.

    Args:
        proposer: A Proposer.
        situation: A Situation.
        gazes: How many are tried at most; the goal's is the first one.
        goal: (5,) in grid units.
        stop: (5,) its place; the gaze is filled in.
    """
    scratch, gap = proposer.scratch, proposer.recipe.gap_probability
    if distance_apart(goal, stop) < 1e-6 or proposer.all_around:
        gazes = 1
    tried, bits = scratch.gazes[:gazes], scratch.gaze_bits[:gazes]
    for number in range(gazes):
        copy_viewpoint(stop, tried[number])
        if number > 0:
            _draw_gaze(proposer, situation.experience.candidates_rng, tried[number])
    imagined_bits(situation.belief, proposer.exact, gap, tried, situation.cones, scratch.scan, bits)
    best, most = 0, -1.0
    for number in range(gazes):
        worth = worth_bits(proposer, situation, tried[number], bits[number])
        if worth > most:
            best, most = number, worth
    copy_viewpoint(tried[best], stop)
    return most


@lean_kernel
def remaining_bits_by_block(proposer, belief):
    """Fill in the remaining bits of all blocks of a map; returns their sum."""
    blocks, target, size = proposer.blocks, proposer.target_precision, belief.size
    shape, edge, total = blocks.bits.shape, blocks.edge, 0.0
    for i in range(shape[0]):
        for j in range(shape[1]):
            for k in range(shape[2]):
                bits, growth = 0.0, 1.0
                for x in range(i * edge, min((i + 1) * edge, size[0])):
                    for y in range(j * edge, min((j + 1) * edge, size[1])):
                        for z in range(k * edge, min((k + 1) * edge, size[2])):
                            voxel = flat_index(size, x, y, z)
                            if belief.precision[voxel] < target and belief.mean[voxel] <= STOP_AT_COVERED:
                                growth *= target / belief.precision[voxel]
                                if growth > _FOLD_ABOVE:
                                    bits += math.log2(growth)
                                    growth = 1.0
                blocks.bits[i, j, k] = 0.5 * (bits + math.log2(growth))
                total += blocks.bits[i, j, k]
    return total
