"""The broadcast in phases (Bhattacharya 2010, sect. 5.3): each robot holds two buffers of batches.

What a robot selects from its scans goes into its collecting buffer. When a phase ends the buffers change
places: the one that was filled is broadcast, at once and again evenly spread over the next phase, so that a
lost message is made up for; a teammate that has it already ignores it. All of a phase's batches share the
fate of a broadcast.

Where batches are sent at once `TeamPhases` is None, and nothing of all this is compiled.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from entropy_explore_env.belief.raycast import point
from entropy_explore_env.compilation.kernels import ASSERTING, lean_kernel
from entropy_explore_env.missions.faults import switched_off, takes_in
from entropy_explore_env.missions.localization import (
    believed_pose,
    believed_scan_pose,
    estimate_of,
    note_covariance,
    weigh_batch,
)
from entropy_explore_env.missions.messages import (
    count_sent,
    hear_batch,
    message_bits,
    note_message,
    pack_measurements,
    transmit,
    unpack_measurements,
)
from entropy_explore_env.missions.poses import copy_numbers, pose_at

_MISSING, _HAS_IT, _AGAIN, _NOW = 0, 1, 2, 3
"""What a teammate has of a broadcast: nothing; all; all, and hears it again; nothing, but hears it now."""


class TeamPhases(NamedTuple):
    """The buffers of one mission's robots, and which phase it is: slices of MissionState."""

    repeats: int
    """How often a batch is broadcast in a phase."""
    now: np.ndarray
    """(1,) PHASES."""
    counts: np.ndarray
    """(A, 2) int64, batches in each of a robot's two buffers."""
    batches: np.ndarray
    """(A, 2, S) BATCH."""
    rays: np.ndarray
    """(A, 2, S, B, 5) float64."""
    heard: np.ndarray
    """(A, A) int8."""
    covariances: np.ndarray
    """(A, 2, S, 10) float64."""


@lean_kernel
def phases_of(repeats, state, mission):
    """Return the TeamPhases of a mission; None where batches are sent at once."""
    if repeats is None:  # known while compiling: nothing of the rest is compiled
        return None
    return TeamPhases(
        repeats,
        state.phases[mission : mission + 1],
        state.phase_counts[mission],
        state.phase_batches[mission],
        state.phase_rays[mission],
        state.phase_heard[mission],
        state.phase_covariances[mission],
    )


@lean_kernel
def next_broadcast(phases, phase_s):
    """Return when the robots broadcast next; inf where batches are sent at once."""
    if phases is None:  # known while compiling: nothing of the rest is compiled
        return math.inf
    return (phases.now[0].broadcasts + 1) * (phase_s / phases.repeats)


@lean_kernel
def broadcasts_made(phases):
    """Return the number of broadcasts so far; 0 where batches are sent at once."""
    if phases is None:  # known while compiling: nothing of the rest is compiled
        return 0
    return phases.now[0].broadcasts


@lean_kernel
def collect_batch(phases, team, scan, index, count):
    """Put `count` measurements of `scan.order` into a robot's collecting buffer, if batches go out in phases.

    It has room in every mission, see `Scenario.phase_batches`; a state from outside may have none left.

    Returns:
        Whether batches go out in phases.
    """
    if phases is None:  # known while compiling: nothing of the rest is compiled
        return False
    side = phases.now[0].collecting
    place = phases.counts[index, side]
    if ASSERTING and place == phases.batches.shape[2]:
        raise AssertionError("no room is left for a batch")
    if place == phases.batches.shape[2]:
        return True
    batch = phases.batches[index, side, place]
    copy_numbers(believed_scan_pose(team.localization, team.robots[index], index), batch.pose, 5)
    note_covariance(team.localization, index, phases.covariances, (index, side, place))
    batch.count = count
    pack_measurements(scan, count, phases.rays[index, side, place])
    phases.counts[index, side] = place + 1
    return True


@lean_kernel
def broadcast_all(phases, team, maps, time_s, tracer, scan, recipients):
    """Let all robots broadcast, in the order of their numbers; at a phase's end buffers are swapped first."""
    if phases is None:  # known while compiling: nothing of the rest is compiled
        return
    now, repeats, robots = phases.now[0], phases.repeats, len(team.robots)
    if now.broadcasts % repeats == repeats - 1:
        now.collecting = 1 - now.collecting
        for robot in range(robots):
            phases.counts[robot, now.collecting] = 0
            for mate in range(robots):
                phases.heard[robot, mate] = _MISSING
    now.broadcasts += 1
    side = 1 - now.collecting
    for robot in range(robots):
        if phases.counts[robot, side] > 0 and not switched_off(team.faults, robot, time_s):
            broadcast(phases, team, maps, side, robot, time_s, tracer, scan, recipients)


@lean_kernel
def broadcast(phases, team, maps, side, index, time_s, tracer, scan, recipients):
    """Send a robot's buffer; teammates that do not have it yet fuse it.

    Args:
        side: Which of its two buffers.
    """
    robots, robot, params = team.robots, team.robots[index], team.params
    batches, heard = phases.counts[index, side], phases.heard[index]
    here = pose_at(params[index], robot, time_s)
    said = believed_pose(estimate_of(team.localization, index), params[index], here)
    bits = buffer_bits(team.localization, phases.batches[index, side], batches)
    transmit(team, index, point(here), time_s, batches, recipients)
    for mate in range(len(robots)):
        if recipients[mate] and takes_in(team.faults, robots[mate], mate, time_s, bits):
            heard[mate] = _AGAIN if heard[mate] == _HAS_IT else _NOW
    for place in range(batches):
        batch = phases.batches[index, side, place]
        batch_bits = message_bits(team.localization, batch.count)
        count_sent(robot, batch.count, batch_bits)
        packed, traced = phases.rays[index, side, place], False
        for mate in range(len(robots)):
            if heard[mate] == _AGAIN:
                robots[mate].messages_received += 1
                robots[mate].bits_received += batch_bits
            elif heard[mate] == _NOW:
                if not traced:
                    unpack_measurements(params[0], tracer, index, scan, batch.pose, packed, batch.count)
                    beside, edge_m = (index, side, place), params[0].voxel_size_m
                    weigh_batch(team.localization, phases.covariances, beside, scan, batch.count, edge_m)
                    traced = True
                note_message(robots[mate], team.heard[mate, index], said, time_s, batch.count, batch_bits)
                hear_batch(team, maps, scan, mate, batch.count)
    for mate in range(len(robots)):
        if heard[mate] > _HAS_IT:
            team.heard[mate, index].heard_s = time_s
            copy_numbers(said, team.heard[mate, index].pose, 5)
            heard[mate] = _HAS_IT


@lean_kernel
def buffer_bits(localization, batches, count):
    """Return what a broadcast of the first `count` of (S,) BATCH costs."""
    bits = 0
    for place in range(count):
        bits += message_bits(localization, batches[place].count)
    return bits
