"""The broadcast in phases (Bhattacharya 2010, sect. 5.3): each robot holds two buffers of batches.

What a robot selects from its scans goes into its collecting buffer. When a phase ends the buffers change
places: the one that was filled is broadcast, at once and again evenly spread over the next phase, so that a
lost message is made up for; a teammate that has it already ignores it. All of a phase's batches share the
fate of a broadcast.
"""

from __future__ import annotations

import math

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


@lean_kernel
def next_broadcast(params, phases):
    """Return when the robots broadcast next; inf where batches are sent at once."""
    if params.phase_s == 0.0:
        return math.inf
    return (phases.broadcasts + 1) * (params.phase_s / params.repeats)


@lean_kernel
def collect_batch(team, buffers, phases, scan, index, count):
    """Put `count` measurements of `scan.order` into a robot's collecting buffer.

    It has room in every mission, see `Scenario.phase_batches`; a state from outside may have none left.
    """
    side = phases.collecting
    place = buffers.counts[index, side]
    if ASSERTING and place == buffers.batches.shape[2]:
        raise AssertionError("no room is left for a batch")
    if place == buffers.batches.shape[2]:
        return
    batch = buffers.batches[index, side, place]
    copy_numbers(believed_scan_pose(team.localization, team.robots[index], index), batch.pose, 5)
    collect_covariance(team.localization, buffers, index, side, place)
    batch.count = count
    pack_measurements(scan, count, buffers.rays[index, side, place])
    buffers.counts[index, side] = place + 1


@lean_kernel
def collect_covariance(localization, buffers, index, side, place):
    """Put the covariance of a robot's latest scan beside the batch at a place of its buffer."""
    if localization is None:  # known while compiling: nothing of the rest is compiled
        return
    note_covariance(localization, index, buffers.covariances[index, side], place)


@lean_kernel
def weigh_collected(localization, voxel_size_m, buffers, index, side, place, scan):
    """Lower the precision of a collected batch's measurements, unpacked into `scan`, by its covariance."""
    if localization is None:  # known while compiling: nothing of the rest is compiled
        return
    count, covariances = buffers.batches[index, side, place].count, buffers.covariances[index, side]
    weigh_batch(localization, covariances, place, scan, count, voxel_size_m)


@lean_kernel
def broadcast_all(team, maps, buffers, phases, time_s, tracer, scan, recipients):
    """Let all robots broadcast, in the order of their numbers; at a phase's end buffers are swapped first."""
    repeats, robots = team.params[0].repeats, len(team.robots)
    if phases.broadcasts % repeats == repeats - 1:
        phases.collecting = 1 - phases.collecting
        for robot in range(robots):
            buffers.counts[robot, phases.collecting] = 0
            for mate in range(robots):
                buffers.heard[robot, mate] = _MISSING
    phases.broadcasts += 1
    side = 1 - phases.collecting
    for robot in range(robots):
        if buffers.counts[robot, side] > 0 and not switched_off(team.faults, robot, time_s):
            broadcast(team, maps, buffers, side, robot, time_s, tracer, scan, recipients)


@lean_kernel
def broadcast(team, maps, buffers, side, index, time_s, tracer, scan, recipients):
    """Send a robot's buffer; teammates that do not have it yet fuse it.

    Args:
        side: Which of its two buffers.
    """
    robots, robot, params = team.robots, team.robots[index], team.params
    batches, heard = buffers.counts[index, side], buffers.heard[index]
    here = pose_at(params[index], robot, time_s)
    said = believed_pose(estimate_of(team.localization, index), params[index], here)
    bits = buffer_bits(team.localization, buffers.batches[index, side], batches)
    transmit(team, index, point(here), time_s, batches, recipients)
    for mate in range(len(robots)):
        if recipients[mate] and takes_in(team.faults, robots[mate], mate, time_s, bits):
            heard[mate] = _AGAIN if heard[mate] == _HAS_IT else _NOW
    for place in range(batches):
        batch = buffers.batches[index, side, place]
        batch_bits = message_bits(team.localization, batch.count)
        count_sent(robot, batch.count, batch_bits)
        packed, traced = buffers.rays[index, side, place], False
        for mate in range(len(robots)):
            if heard[mate] == _AGAIN:
                robots[mate].messages_received += 1
                robots[mate].bits_received += batch_bits
            elif heard[mate] == _NOW:
                if not traced:
                    unpack_measurements(params[0], tracer, index, scan, batch.pose, packed, batch.count)
                    weigh_collected(
                        team.localization, params[0].voxel_size_m, buffers, index, side, place, scan
                    )
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
