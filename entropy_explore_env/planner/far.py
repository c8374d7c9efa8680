"""Far places that could be worth more than any nearer one, and the first stops on the way to them."""

from __future__ import annotations

import math

from entropy_explore_env.belief.paths.lattice import cell_of, standing_voxel
from entropy_explore_env.belief.paths.search import extract_path
from entropy_explore_env.belief.paths.string_pulling import Path, string_pull
from entropy_explore_env.belief.raycast import distance_between
from entropy_explore_env.belief.voxel_index import grid_index
from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.planner.far_places import (
    NOT_FREE,
    NOT_REACHED,
    BitCount,
    FoundPaths,
    block_bounds,
    fill_blocks,
    place_of,
    promised_around,
)
from entropy_explore_env.planner.memory import copy_numbers, value_of, worth_bits
from entropy_explore_env.planner.nearby import cost_of, evaluate, search_within
from entropy_explore_env.planner.states import PlannerState
from entropy_explore_env.planner.thresholds import FAR_PITCH_RAD, FIRST_RADIUS
from entropy_explore_env.randomness import draw_gaussian, draw_uniform
from entropy_explore_env.viewpoints.evaluation import STRAIGHTENED, indices_at, travel_seconds, voxel_at
from entropy_explore_env.viewpoints.expected_scan import expected_bits

_DEPLETED = int(PlannerState.DEPLETED)
_WITHIN = 1.0 - 1e-6
"""Share of the reach that is used: actions are float32."""


@lean_kernel
def _draw_gaze(proposer, rng, at):
    """Draw a gaze for a far place; sensors that see all around keep theirs."""
    if proposer.all_around:
        return
    at[3] = math.pi * (2.0 * draw_uniform(rng) - 1.0)
    if not proposer.level:
        at[4] = min(max(FAR_PITCH_RAD * draw_gaussian(rng), -0.5 * math.pi), 0.5 * math.pi)


@lean_kernel
def _put_at(proposer, situation, voxel, at):
    """Write the viewpoint at the centre of a voxel, with the robot's present gaze."""
    x, y, z = grid_index(situation.belief.size, voxel)
    copy_numbers(situation.knowledge.pose, at)
    at[0], at[1] = x + 0.5, y + 0.5
    if not proposer.planar:
        at[2] = z + 0.5


@lean_kernel
def _insert(worths, options, at, worth, count):
    """Insert a viewpoint among those that are worth most, in order, and return how many there are."""
    most = len(worths)
    if most == 0 or (count == most and worth <= worths[count - 1]):
        return count
    place = min(count, most - 1)
    while place > 0 and worths[place - 1] < worth:
        worths[place] = worths[place - 1]
        copy_numbers(options[place - 1].viewpoint, options[place].viewpoint)
        place -= 1
    worths[place] = worth
    copy_numbers(at, options[place].viewpoint)
    return min(count + 1, most)


@lean_kernel
def _seconds_bound(proposer, situation, block, searched, at):
    """Return a lower bound of the seconds to a place in a block (i, j, k); `at` (5,) is overwritten.

    It is that of a straight way, or of one longer than what was `searched`.
    """
    here, lattice, squared = situation.knowledge.pose, proposer.lattice, 0.0
    low, high = block_bounds(proposer.blocks, situation.belief.size, block[0], block[1], block[2])
    for axis in range(3):
        apart = max(low[axis] - here[axis], here[axis] - high[axis], 0.0)
        squared += apart * apart
    standing_off = 2.0 * (lattice.edge - 1)  # a body may stand in another voxel of the same cell
    copy_numbers(here, at)
    at[0] += max(math.sqrt(squared) - standing_off, STRAIGHTENED * searched)
    return travel_seconds(proposer.drive, proposer.refined.voxel_size_m, here, at, 0.0, proposer.reach)


@lean_kernel
def _fill_far(proposer, situation, state, searched, options):
    """Fill in the places of the blocks that promise most for the time, a few gazes each.

    Openings that no gaze gets to promise much and bring nothing; where many are nearby, they would hide what
    is left in other places. So a DEPLETED planner weighs each place by chance.

    Returns:
        (count, beyond): how many viewpoints these are, and whether a place farther than what was `searched`
        could be one of them, as far as costs up to there are final.
    """
    scratch, blocks, recipe, drive = proposer.scratch, proposer.blocks, proposer.recipe, proposer.drive
    here, window, at = situation.knowledge.pose, blocks.window, scratch.at
    paths = FoundPaths(scratch.search, proposer.lattice, situation.costs)
    worths, gazes, edge_m = (
        scratch.worth[: recipe.far_places],
        recipe.far_gazes,
        proposer.refined.voxel_size_m,
    )
    rng, count, beyond = situation.experience.candidates_rng, 0, 0.0
    for i in range(window[0, 0], window[0, 1]):
        for j in range(window[1, 0], window[1, 1]):
            for k in range(window[2, 0], window[2, 1]):
                bits = promised_around(blocks, i, j, k)
                if bits <= 0.0:
                    continue
                if state != _DEPLETED and count == len(worths):
                    least_s = _seconds_bound(proposer, situation, (i, j, k), 0.0, at)
                    if value_of(proposer, situation, bits, least_s) <= worths[count - 1]:
                        continue
                place = place_of(paths, blocks, i, j, k)
                if place == NOT_REACHED:
                    least_s = _seconds_bound(proposer, situation, (i, j, k), searched, at)
                    beyond = max(beyond, value_of(proposer, situation, bits, least_s))
                elif place != NOT_FREE:
                    _put_at(proposer, situation, place, at)
                    cost = cost_of(proposer, situation, at)
                    seconds = travel_seconds(drive, edge_m, here, at, cost, proposer.reach)
                    worth = value_of(proposer, situation, bits, seconds)
                    if state == _DEPLETED:
                        worth *= draw_uniform(rng)
                    count = _insert(worths, options, at, worth, count)
    could_be_beyond = beyond > 0.0 and (count < len(worths) or beyond > worths[count - 1])
    for place in range(count - 1, -1, -1):
        for gaze in range(gazes - 1, -1, -1):
            copy_numbers(options[place].viewpoint, options[place * gazes + gaze].viewpoint)
    for number in range(count * gazes):
        _draw_gaze(proposer, rng, options[number].viewpoint)
    return count * gazes, could_be_beyond


@lean_kernel
def _evaluate_far(proposer, situation, count):
    """Evaluate some far viewpoints, and the robot's goal as the last one; return (count, best value)."""
    far, experience, best = proposer.scratch.far, situation.experience, 0.0
    if experience.going:
        copy_numbers(experience.goal, far[count].viewpoint)
        count += 1
    evaluate(proposer, situation, proposer.refined, far[:count], True)
    for number in range(count):
        best = max(best, far[number].value)
    return count, best


@lean_kernel
def propose_far(proposer, situation, state):
    """Fill `scratch.far` with far viewpoints, evaluated; the nearer half of the world first.

    Paths are searched farther and farther until no place beyond could be worth more by one scan; between
    cells of several voxels, which takes little time, until none could promise more. The goal to which the
    robot is on its way comes last, if there is one.

    Args:
        proposer: See `model`; paths within reach have been searched.
        situation: See `model`.
        state: PlannerState.

    Returns:
        (count, value): how many there are, and what the best is worth.
    """
    experience, belief, far = situation.experience, situation.belief, proposer.scratch.far
    size, start = belief.size, voxel_at(belief.size, situation.knowledge.pose)
    everywhere = float(size[0] + size[1] + size[2]) * proposer.unknown_cost
    radius = min(FIRST_RADIUS * proposer.within, everywhere)
    count_of = BitCount(proposer.target_precision, proposer.refined.known_precision, proposer.recipe.behind)
    if proposer.lattice.edge > 1:
        radius = everywhere if state == _DEPLETED else radius
        fill_blocks(belief, count_of, start, math.ceil(everywhere), proposer.blocks)
        while True:
            search_within(proposer, situation, radius)
            count, beyond = _fill_far(proposer, situation, state, radius, far)
            lost = experience.going and cost_of(proposer, situation, experience.goal) > radius
            if radius >= everywhere or not (beyond or lost):
                return _evaluate_far(proposer, situation, count)
            radius = min(1.5 * radius, everywhere)
    while True:
        search_within(proposer, situation, radius)
        fill_blocks(belief, count_of, start, math.ceil(radius), proposer.blocks)
        count, _ = _fill_far(proposer, situation, state, radius, far)
        count, best = _evaluate_far(proposer, situation, count)
        seconds = max(radius * proposer.refined.voxel_size_m / proposer.drive.max_speed_m_s, 1e-9)
        if radius >= everywhere or best >= value_of(proposer, situation, experience.most_bits, seconds):
            return count, best
        radius = min(2.0 * radius, everywhere)


@lean_kernel
def first_stop(proposer, situation, goal, stop):
    """Fill in the stop (5,) to which a robot drives first to get to a goal (5,) that the search reached.

    It is the goal where that is within reach, else the last place of the path that is.

    Returns:
        Whether there is a path.
    """
    scratch, here, size = proposer.scratch, situation.knowledge.pose, situation.belief.size
    search, lattice, path = scratch.search, proposer.lattice, scratch.path
    copy_numbers(goal, stop)
    count = extract_path(search, lattice, cell_of(lattice, indices_at(size, goal)), path)
    if count == 0:
        return False
    reach = proposer.reach * _WITHIN
    if not proposer.planned:
        way = Path(path, count, here[:3], goal[:3])
        if string_pull(search, lattice, situation.costs, way, scratch.waypoints) == 0:
            return False
        corner = scratch.waypoints[0]
        share = min(1.0, reach / max(distance_between(corner, here), 1e-9))
        for axis in range(3):
            stop[axis] = here[axis] + share * (corner[axis] - here[axis])
        return True
    if distance_between(goal, here) <= reach:
        return True
    for number in range(count):
        cell = grid_index(lattice.size, path[number])
        x, y, z = cell if lattice.edge == 1 else standing_voxel(lattice, situation.costs, cell)[1]
        height = here[2] if lattice.layer >= 0 else z + 0.5
        away = (x + 0.5 - here[0]) ** 2 + (y + 0.5 - here[1]) ** 2 + (height - here[2]) ** 2
        beyond = math.sqrt(away) > reach
        if beyond and number > 0:
            break
        stop[0], stop[1], stop[2] = x + 0.5, y + 0.5, height
        if beyond:
            break
    return True


@lean_kernel
def gaze_on_the_way(proposer, situation, gazes, goal, stop):
    """Give a stop (5,) on the way to a goal (5,) the best of some gazes, and return the bits of a scan there.

    At most `gazes` are tried, of which the goal's is the first one.
    """
    scratch, most = proposer.scratch, -1.0
    tried = scratch.at
    if distance_between(goal, stop) < 1e-6 or proposer.all_around:
        gazes = 1
    copy_numbers(stop, tried)
    for number in range(gazes):
        if number > 0:
            _draw_gaze(proposer, situation.experience.candidates_rng, tried)
        bits = expected_bits(situation.belief, proposer.refined, tried, scratch.scan)
        worth = worth_bits(proposer, situation, tried, bits)
        if worth > most:
            most = worth
            copy_numbers(tried, stop)
    return most
