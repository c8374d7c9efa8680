"""How far a mission has come: times on the way, and the joint map against the truth.

The joint map fuses every measurement that any robot takes, at once and without loss. Nothing acts on it;
it is kept where the scenario tracks the truth. Its figures are updated ray by ray, never from all voxels.
"""

from __future__ import annotations

import numpy as np

from entropy_explore_env.belief.map_update import fuse_ray
from entropy_explore_env.belief.measurement_model import Return
from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.missions.records import PROGRESS, SEEN_MARKS

_NOTHING = int(Return.NOTHING)
_ROUNDING = 1e-9
_ADD, _REMOVE = np.int64(1), np.int64(-1)
"""NumPy integers, so that `score_voxels` compiles for one type."""


@lean_kernel
def note_progress(clock, robots):
    """Take the time when the best map has lost each of PROGRESS of the bits that the mission asks for."""
    best = robots[0].entropy_bits
    for robot in robots:
        best = min(best, robot.entropy_bits)
    gained, asked = clock.entropy_start_bits - best, clock.entropy_start_bits - clock.entropy_end_bits
    for mark in range(len(PROGRESS)):
        if clock.reached_s[mark] < 0.0 and gained >= PROGRESS[mark] * asked:
            clock.reached_s[mark] = clock.time_s


@lean_kernel
def note_seen(clock, robots):
    """Take time and driven path when the team has seen each of SEEN_MARKS of what can be seen."""
    for mark in range(len(SEEN_MARKS)):
        enough = clock.explored_visible >= SEEN_MARKS[mark] * clock.visible - _ROUNDING
        if enough and clock.seen_s[mark] < 0.0:
            clock.seen_s[mark] = clock.time_s
            clock.seen_m[mark] = 0.0
            for robot in robots:
                clock.seen_m[mark] += robot.distance_m


@lean_kernel
def note_idle(clock, robots, idle):
    """Count a scan that showed nothing new of what can be seen; begin anew after one that did."""
    if idle:
        clock.idle_scans += 1
    else:
        clock.idle_scans = 0
        clock.idle_from_m = planned_m(robots)


@lean_kernel
def planned_m(robots):
    """Return the metres of the team's drives so far, those under way taken whole."""
    total_m = 0.0
    for robot in robots:
        total_m += robot.departed_m + robot.path_m
    return total_m


@lean_kernel
def holds_enough(clock, visible, truth, precision, prior_precision):
    """Return whether a robot's own map holds as much of what can be seen as ends the mission.

    It counts all voxels of more than the prior precision: for missions whose joint map holds enough already.
    """
    prior, seen, free = np.float32(prior_precision), 0, 0
    for voxel in range(len(precision)):
        if visible[voxel] and precision[voxel] > prior:
            seen += 1
            free += int(truth[voxel] <= 0.5)
    return seen >= clock.explored_end and free >= clock.explored_free_end


@lean_kernel
def score_scan(clock, joint, truth, scan, prior_precision):
    """Fuse a scan into the joint map, and carry its entropy, coverage and errors (see MISSION).

    Args:
        scan: Scan with crossings and precisions filled in.
        prior_precision: 1/σ² of a voxel that was never measured.
    """
    prior = np.float32(prior_precision)
    for index in range(len(scan.rays)):
        ray, crossed = scan.rays[index], scan.crossed[index]
        if ray.returned == _NOTHING:
            continue
        score_voxels(clock, joint, truth, prior, crossed, ray.voxels, _REMOVE)
        coverage = scan.coverage[index]
        clock.joint_bits -= fuse_ray(
            joint.mean, joint.precision, crossed, coverage, ray.free, ray.voxels, ray.precision
        )
        score_voxels(clock, joint, truth, prior, crossed, ray.voxels, _ADD)


@lean_kernel
def score_voxels(clock, joint, truth, prior, crossed, n, sign):
    """Add (sign _ADD) or remove (_REMOVE) what `n` voxels contribute to the figures of the joint map."""
    mean, precision, visible = joint.mean, joint.precision, joint.visible
    for i in range(n):
        voxel = np.uint32(crossed[i])
        if precision[voxel] > prior:
            clock.explored += sign
            clock.error += sign * abs(np.float64(mean[voxel]) - min(np.float64(truth[voxel]), 1.0))
            if visible[voxel]:
                clock.explored_visible += sign
                if truth[voxel] <= 0.5:
                    clock.explored_free += sign
            if (mean[voxel] > 0.5) != (truth[voxel] > 0.5):
                clock.wrong += sign
