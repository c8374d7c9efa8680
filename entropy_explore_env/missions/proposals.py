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
from entropy_explore_env.missions.observation.own_state import entropy_left
from entropy_explore_env.missions.poses import (
    copy_numbers,
    grid_size,
    pose_at,
    since_scan_m,
    to_grid_units,
    within_grid,
)
from entropy_explore_env.missions.silence import silent_since
from entropy_explore_env.missions.state import MissionEnd
from entropy_explore_env.planner.candidate_features import CONTEXT, FEATURES
from entropy_explore_env.planner.features import (
    RobotStatus,
    write_context,
    write_features,
    write_overlaps,
)
from entropy_explore_env.planner.propose import propose
from entropy_explore_env.planner.records import Kind
from entropy_explore_env.planner.situation import LastDecision, Situation

_RUNNING = MissionEnd.RUNNING.code
_NONE = int(Kind.NONE)
_WIDTH, _CONTEXT = len(FEATURES), len(CONTEXT)


class PlannerInput(NamedTuple):
    """What candidates are proposed to one robot from, all of which it knows; map frame."""

    pose: tuple[float, float, float, float, float]
    time_s: float
    entropy_bits: float
    gained_bits: float
    """Taken from its map by its own scans."""
    heard_bits: float
    """Taken from its map by teammates' measurements."""
    target: np.ndarray
    """(5,) the viewpoint that it chose last."""
    came_bits: float
    """Taken from its map by its latest scan."""
    move_end: int
    under_way: bool
    since_scan_m: float
    """That it has driven since its latest scan."""
    place_variance_m2: float
    """Of its pose estimate, the sum over x, y and z; 0 = it knows its pose."""
    yaw_variance_rad2: float
    heard: np.ndarray
    """(A,) HEARD."""
    mean: np.ndarray
    """(V,) float32."""
    precision: np.ndarray
    """(V,) float32."""
    no_fly: np.ndarray
    """(V,) bool, where its body would reach above the ceiling; (0,) = nowhere."""


class Proposing(NamedTuple):
    """What candidates of E missions are proposed from, and where they are kept: arrays of MissionState."""

    params: np.ndarray
    """(A,) PARAMS."""
    missions: np.ndarray
    """(E,) MISSION."""
    robots: np.ndarray
    """(E, A) ROBOT."""
    heard: np.ndarray
    """(E, A, A) HEARD."""
    mean: np.ndarray
    """(E, A, V) float32."""
    precision: np.ndarray
    """(E, A, V) float32."""
    utility_bits: np.ndarray
    """(E, A, R) float64, of the rays of the latest scans."""
    candidates: np.ndarray
    """(E, A, K) CANDIDATE."""
    experience: np.ndarray
    """(E, A) EXPERIENCE."""
    no_fly: np.ndarray
    """(E·N, V) bool: see `navigation.Planning`."""
    estimates: np.ndarray | None
    """(E, A) ESTIMATE; None = all robots know where they are."""


@lean_kernel
def _hear(params, robot, given, scratch):
    """Fill in the teammates that were heard, and the views that they announced; returns how many of each."""
    mates, cones = 0, 0
    for number in range(len(given.heard)):
        heard, own = given.heard[number], params[number]
        if number == robot or heard.heard_s < 0.0:
            continue
        mate = scratch.mates[mates]
        mates += 1
        copy_numbers(to_grid_units(own, heard.pose), mate.place, 3)
        mate.max_speed_m_s, mate.acceleration_m_s2 = own.max_speed_m_s, own.acceleration_m_s2
        mate.scan_time_s, mate.body_radius = own.scan_time_s, own.body_radius_m / own.voxel_size_m
        mate.silent = silent_since(own, heard, given.time_s)
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
def propose_to(params, robot, given, proposer, candidates, experience, parts):
    """Propose candidates to one robot.

    Args:
        params: (A,) PARAMS.
        robot: Its number.
        given: PlannerInput of it.
        proposer: Proposer of its kind.
        candidates: (K,) CANDIDATE, its former ones; replaced.
        experience: EXPERIENCE, changed in place.
        parts: (candidates, context, overlaps), each a (N,) float32 to fill in, of which any may be empty.
    """
    own, scratch = params[robot], proposer.scratch
    place = within_grid(own, given.pose)
    copy_numbers(place, scratch.here, 3)
    scratch.here[3], scratch.here[4] = given.pose[3], given.pose[4]
    copy_numbers(to_grid_units(own, given.target), scratch.target, 3)
    scratch.target[3], scratch.target[4] = given.target[3], given.target[4]
    for scan in (proposer.drawn, proposer.exact):
        scan.pose_variance[0] = given.place_variance_m2 / (own.voxel_size_m * own.voxel_size_m)
        scan.pose_variance[1] = given.yaw_variance_rad2
    mates, cones = _hear(params, robot, given, scratch)
    mean, precision, none = given.mean, given.precision, given.mean[:0]
    known, cost = proposer.exact.known_precision, proposer.unknown_cost
    situation = Situation(
        Belief(mean, precision, grid_size(own)),
        Costs(mean, precision, known, cost, none, 1.0, given.no_fly),
        scratch.here,
        scratch.cones[:cones],
        scratch.mates[:mates],
        experience,
        given.since_scan_m / own.voxel_size_m,
    )
    copy_numbers(given.target, scratch.target_m, 5)
    decision = LastDecision(
        scratch.target,
        scratch.target_m,
        own.voxel_size_m,
        given.came_bits,
        given.move_end,
        given.under_way,
        given.place_variance_m2 > 0.0 or given.yaw_variance_rad2 > 0.0,
        given.time_s,
        given.gained_bits,
    )
    features, context, overlaps = parts
    described = len(features) > 0 or len(context) > 0
    selection = propose(proposer, situation, decision, candidates, described)
    if described:
        bits = given.gained_bits + given.heard_bits
        status = RobotStatus(
            entropy_left(own, given.entropy_bits),
            given.heard_bits / bits if bits > 0.0 else 0.0,
            given.time_s,
            given.under_way,
            len(given.heard) - 1,
        )
        write_features(proposer, situation, selection, features)
        write_context(proposer, situation, status, selection, context)
    if len(overlaps) > 0:
        write_overlaps(proposer, selection.count, overlaps)
    for k in range(len(candidates)):
        at = candidates[k].viewpoint
        for axis in range(3):
            at[axis] = own.origin_m[axis] + at[axis] * own.voxel_size_m


@lean_kernel
def _end(begin, size):
    """(begin, end) of a part of an observation; (0, 0) where it is left out."""
    return (begin, begin + size) if begin >= 0 else (0, 0)


@lean_kernel
def propose_missions(proposing, proposer, kind, offsets, first, last, out):
    """Propose candidates to the robots of one kind that decide, and write the parts of their observations.

    Args:
        proposing: Proposing.
        proposer: Proposer of this kind, not shared with another thread.
        kind: Its number.
        offsets: CandidateOffsets.
        first: The first mission.
        last: One past the last.
        out: (E, A, F) float32, of which those parts are filled in: with zeros for robots that do not decide.
    """
    most = proposing.candidates.shape[2]
    features, context = _end(offsets.candidates, most * _WIDTH), _end(offsets.context, _CONTEXT)
    overlaps, masked = _end(offsets.overlaps, most * most), _end(offsets.action_mask, most)
    for mission in range(first, last):
        clock = proposing.missions[mission]
        for index in range(proposing.robots.shape[1]):
            own, params = proposing.robots[mission, index], proposing.params[index]
            if params.kind != kind:
                continue
            row, candidates = out[mission, index], proposing.candidates[mission, index]
            parts = (
                row[features[0] : features[1]],
                row[context[0] : context[1]],
                row[overlaps[0] : overlaps[1]],
            )
            decides = own.deciding and clock.end == _RUNNING
            if decides:
                came = 0.0
                for ray in range(params.rays):
                    came += proposing.utility_bits[mission, index, ray]
                estimate = estimate_in(proposing.estimates, mission, index)
                place_variance, yaw_variance = pose_variance(estimate)
                given = PlannerInput(
                    believed_pose(estimate, params, pose_at(params, own, clock.time_s)),
                    clock.time_s,
                    own.entropy_bits,
                    own.gained_bits,
                    own.heard_bits,
                    own.target,
                    came,
                    own.move_end,
                    own.under_way,
                    since_scan_m(params, own, clock.time_s),
                    place_variance,
                    yaw_variance,
                    proposing.heard[mission, index],
                    proposing.mean[mission, index],
                    proposing.precision[mission, index],
                    proposing.no_fly[mission * params.bodies + params.body_number],
                )
                experience = proposing.experience[mission, index]
                propose_to(proposing.params, index, given, proposer, candidates, experience, parts)
            else:
                for part in parts:
                    for number in range(len(part)):
                        part[number] = 0.0
            mask = row[masked[0] : masked[1]]
            for number in range(len(mask)):
                there = candidates[number].kind != _NONE if decides else number == 0 and offsets.while_busy
                mask[number] = 1.0 if there else 0.0
