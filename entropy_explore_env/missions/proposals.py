"""Candidates for the robots of missions, and the parts of an observation that say what was proposed.

A call of its own after each step, so that none of it is compiled where actions are no candidates.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from entropy_explore_env.belief.fields import Belief
from entropy_explore_env.belief.paths.lattice import Costs
from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.missions.localization import believed_pose, estimate_in, pose_variance
from entropy_explore_env.missions.observation.robots import entropy_left
from entropy_explore_env.missions.poses import copy_numbers, grid_size, pose_at, to_grid_units, within_grid
from entropy_explore_env.missions.records import MissionEnd
from entropy_explore_env.missions.silence import silent_since
from entropy_explore_env.missions.state import MissionState
from entropy_explore_env.planner.candidate_features import CONTEXT, FEATURES
from entropy_explore_env.planner.features import write_context, write_features, write_overlaps
from entropy_explore_env.planner.model import Situation
from entropy_explore_env.planner.propose import propose
from entropy_explore_env.planner.records import Kind

_RUNNING = MissionEnd.RUNNING.code
_NONE = int(Kind.NONE)
_WIDTH, _CONTEXT = len(FEATURES), len(CONTEXT)


class Known(NamedTuple):
    """What candidates are proposed to one robot from, and where they are kept."""

    knowledge: np.record  # KNOWLEDGE
    heard: np.ndarray  # (A,) HEARD
    mean: np.ndarray  # (V,) float32
    precision: np.ndarray  # (V,) float32
    no_fly: np.ndarray  # (V,) bool, where its body would reach above the ceiling; (0,) = nowhere
    candidates: np.ndarray  # (K,) CANDIDATE, its former ones; replaced
    experience: np.record  # EXPERIENCE, changed in place


class Proposing(NamedTuple):
    """What candidates of E missions are proposed from, and where they are kept."""

    params: np.ndarray  # (A,) PARAMS
    state: MissionState  # candidates and experience are changed in place
    no_fly: np.ndarray  # (E·N, V) bool: see `navigation.Planning`
    estimates: np.ndarray | None  # (E, A) ESTIMATE; None = all robots know where they are


@lean_kernel
def locate(own, pose, target, variances, entropy_bits, knowledge):
    """Fill in where a robot is, how sure it is of that, where it goes, and what is left of its map.

    The pose (5,) is the one that it believes, and the variances are those of its place, summed over the axes,
    in m², and of its yaw, in rad². The target (5,) is the viewpoint that it chose last. Both are in the map
    frame; in KNOWLEDGE they are in grid units.
    """
    copy_numbers(within_grid(own, pose), knowledge.pose, 3)
    copy_numbers(to_grid_units(own, target), knowledge.target, 3)
    for axis in range(3, 5):
        knowledge.pose[axis], knowledge.target[axis] = pose[axis], target[axis]
    knowledge.place_variance = variances[0] / (own.voxel_size_m * own.voxel_size_m)
    knowledge.yaw_variance = variances[1]
    knowledge.entropy_left = entropy_left(own, entropy_bits)


@lean_kernel
def _fill_knowledge(proposing, mission, index, knowledge):
    """Fill in the KNOWLEDGE of a robot from the arrays of missions."""
    state, params = proposing.state, proposing.params[index]
    own, time_s, came = state.robots[mission, index], state.missions[mission].time_s, 0.0
    for ray in range(params.rays):
        came += state.scan_utility_bits[mission, index, ray]
    estimate = estimate_in(proposing.estimates, mission, index)
    pose = believed_pose(estimate, params, pose_at(params, own, time_s))
    locate(params, pose, own.target, pose_variance(estimate), own.entropy_bits, knowledge)
    knowledge.time_s, knowledge.came_bits, knowledge.move_end = time_s, came, own.move_end
    knowledge.gained_bits, knowledge.heard_bits = own.gained_bits, own.heard_bits
    knowledge.under_way, knowledge.teammates = own.under_way, len(proposing.params) - 1


@lean_kernel
def _hear(params, robot, all_heard, time_s, scratch):
    """Fill in the teammates that were heard, and the views that they announced; return how many of each."""
    mates, cones = 0, 0
    for number in range(len(all_heard)):
        heard, own = all_heard[number], params[number]
        if number == robot or heard.heard_s < 0.0:
            continue
        mate = scratch.mates[mates]
        mates += 1
        copy_numbers(to_grid_units(own, heard.pose), mate.place, 3)
        mate.max_speed_m_s, mate.acceleration_m_s2 = own.max_speed_m_s, own.acceleration_m_s2
        mate.scan_time_s, mate.body_radius = own.scan_time_s, own.body_radius_m / own.voxel_size_m
        mate.silent = silent_since(own, heard, time_s)
        if heard.announced_s >= 0.0 and heard.announced[5] > 0.0 and not mate.silent:
            cone, there = scratch.cones[cones], heard.announced
            cones += 1
            copy_numbers(to_grid_units(own, there), cone.apex, 3)
            level = math.cos(there[4])
            cone.gaze[0], cone.gaze[1] = math.cos(there[3]) * level, math.sin(there[3]) * level
            cone.gaze[2] = -math.sin(there[4])
            cone.radius, cone.cosine = there[5] / own.voxel_size_m, math.cos(there[6])
    return mates, cones


@lean_kernel
def propose_to(params, robot, known, proposer, parts):
    """Propose candidates to one robot of a team with (A,) PARAMS, by what is Known to it.

    Filled in are the parts (candidates, context, overlaps) of its observation, each (N,) float32; any of them
    may be empty.
    """
    own, scratch, mean, precision = params[robot], proposer.scratch, known.mean, known.precision
    knowledge, candidates = known.knowledge, known.candidates
    for scan in (proposer.drawn, proposer.refined):
        scan.pose_variance[0], scan.pose_variance[1] = knowledge.place_variance, knowledge.yaw_variance
    mates, cones = _hear(params, robot, known.heard, knowledge.time_s, scratch)
    seen, cost = proposer.refined.known_precision, proposer.unknown_cost
    situation = Situation(
        knowledge,
        Belief(mean, precision, grid_size(own)),
        Costs(mean, precision, seen, cost, mean[:0], 1.0, known.no_fly),
        scratch.cones[:cones],
        scratch.mates[:mates],
        known.experience,
    )
    for k in range(len(candidates)):
        copy_numbers(to_grid_units(own, candidates[k].viewpoint), candidates[k].viewpoint, 3)
    features, context, overlaps = parts
    described = len(features) > 0 or len(context) > 0
    selection = propose(proposer, situation, candidates, described)
    if described:
        write_features(proposer, situation, selection, features)
        write_context(proposer, situation, selection.remaining, context)
    if len(overlaps) > 0:
        write_overlaps(proposer, selection.count, overlaps)
    for k in range(len(candidates)):
        at = candidates[k].viewpoint
        for axis in range(3):
            at[axis] = own.origin_m[axis] + at[axis] * own.voxel_size_m


@lean_kernel
def _end(begin, size):
    """Return (begin, end) of a part of an observation; (0, 0) where it is left out."""
    return (begin, begin + size) if begin >= 0 else (0, 0)


@lean_kernel
def propose_missions(proposing, proposer, kind, offsets, first, last, out):
    """Propose candidates to the robots of one kind that decide, and write the parts of their observations.

    Args:
        proposer: Proposer of this kind, not shared with another thread.
        offsets: CandidateOffsets.
        out: (E, A, F) float32, of which those parts are filled in: with zeros for robots that do not decide.
    """
    state, knowledge = proposing.state, proposer.scratch.knowledge[0]
    most = state.candidates.shape[2]
    features, context = _end(offsets.candidates, most * _WIDTH), _end(offsets.context, _CONTEXT)
    overlaps, masked = _end(offsets.overlaps, most * most), _end(offsets.action_mask, most)
    for mission in range(first, last):
        for index in range(state.robots.shape[1]):
            own, params = state.robots[mission, index], proposing.params[index]
            if params.kind != kind:
                continue
            row, candidates = out[mission, index], state.candidates[mission, index]
            parts = (
                row[features[0] : features[1]],
                row[context[0] : context[1]],
                row[overlaps[0] : overlaps[1]],
            )
            decides = own.deciding and state.missions[mission].end == _RUNNING
            if decides:
                _fill_knowledge(proposing, mission, index, knowledge)
                known = Known(
                    knowledge,
                    state.heard[mission, index],
                    state.mean[mission, index],
                    state.precision[mission, index],
                    proposing.no_fly[mission * params.bodies + params.body_number],
                    candidates,
                    state.experience[mission, index],
                )
                propose_to(proposing.params, index, known, proposer, parts)
            else:
                for part in parts:
                    for number in range(len(part)):
                        part[number] = 0.0
            mask = row[masked[0] : masked[1]]
            for number in range(len(mask)):
                there = candidates[number].kind != _NONE if decides else number == 0 and offsets.while_busy
                mask[number] = 1.0 if there else 0.0
