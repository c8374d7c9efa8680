"""The broadcast in phases (Bhattacharya 2010, sect. 5.3): each robot holds two buffers of batches.

What a robot selects from its scans goes into its collecting buffer. When a phase ends the buffers change
places: the one that was filled is broadcast, at once and again evenly spread over the next phase, so that a
lost message is made up for; who has it already ignores it. All of a phase's batches share the fate of a
broadcast.
"""

from __future__ import annotations

import math

from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.missions.messages import (
    hear_batch,
    message_bits,
    note_message,
    pack_measurements,
    unpack_measurements,
)
from entropy_explore_env.missions.poses import copy_numbers, pose_at
from entropy_explore_env.robots.channel import Delivery, deliver

_HEARD, _OUT_OF_RANGE, _LOST = (delivery.code for delivery in Delivery)
_MISSING, _HAS_IT, _AGAIN, _NOW = 0, 1, 2, 3
"""What a teammate has of a broadcast: nothing; all; all, and hears it again; nothing, but hears it now."""


@lean_kernel
def next_broadcast(phased, numbers, state, mission):
    """When the robots broadcast next; inf where batches are sent at once."""
    if phased is None:
        return math.inf
    return (state.phases[mission].broadcasts + 1) * (numbers.phase_s / numbers.repeats)


@lean_kernel
def collect_batch(phased, state, scan, mission, index, count):
    """Put `count` measurements of `scan.order` into a robot's collecting buffer."""
    if phased is None:
        return
    side = state.phases[mission].collecting
    place = state.phase_waiting[mission, index, side]
    batch = state.phase_batches[mission, index, side, place]
    copy_numbers(state.robots[mission, index].scan_pose, batch.pose, 5)
    batch.count = count
    pack_measurements(scan, count, state.phase_rays[mission, index, side, place])
    state.phase_waiting[mission, index, side] = place + 1


@lean_kernel
def broadcast_all(phased, rules, state, scan, mission):
    """All robots broadcast, by number; where a phase ends their buffers change places before."""
    if phased is None:
        return
    phases, robots = state.phases[mission], state.robots.shape[1]
    if phases.broadcasts % rules.numbers[0].repeats == rules.numbers[0].repeats - 1:
        phases.collecting = 1 - phases.collecting
        for robot in range(robots):
            state.phase_waiting[mission, robot, phases.collecting] = 0
            for mate in range(robots):
                state.phase_heard[mission, robot, mate] = _MISSING
    phases.broadcasts += 1
    for robot in range(robots):
        if state.phase_waiting[mission, robot, 1 - phases.collecting] > 0:
            broadcast(phased, rules, state, scan, mission, robot)


@lean_kernel
def broadcast(phased, rules, state, scan, mission, index):
    """A robot sends its buffer; teammates that do not have it yet fuse it."""
    if phased is None:
        return
    numbers, robot, robots = rules.numbers[0], state.robots[mission, index], state.robots[mission]
    side, time_s = 1 - state.phases[mission].collecting, state.missions[mission].time_s
    batches, heard = state.phase_waiting[mission, index, side], state.phase_heard[mission, index]
    here = pose_at(rules.numbers[index], robot, time_s)
    for mate in range(len(robots)):
        if mate == index:
            continue
        there = pose_at(rules.numbers[mate], robots[mate], time_s)
        apart_m = math.sqrt((here[0] - there[0]) ** 2 + (here[1] - there[1]) ** 2 + (here[2] - there[2]) ** 2)
        code = deliver(apart_m, numbers.channel_range_m, numbers.loss_probability, robot.channel_chance)
        if code == _LOST:
            robot.messages_lost += batches
        elif code == _OUT_OF_RANGE:
            robot.messages_out_of_range += batches
        else:
            heard[mate] = _AGAIN if heard[mate] == _HAS_IT else _NOW
    for place in range(batches):
        batch = state.phase_batches[mission, index, side, place]
        robot.messages_sent += 1
        robot.measurements_sent += batch.count
        robot.bits_sent += message_bits(batch.count)
        packed, traced = state.phase_rays[mission, index, side, place], False
        for mate in range(len(robots)):
            if heard[mate] == _AGAIN:
                robots[mate].messages_received += 1
                robots[mate].bits_received += message_bits(batch.count)
            elif heard[mate] == _NOW:
                if not traced:
                    unpack_measurements(rules, state, scan, mission, index, batch.pose, packed, batch.count)
                    traced = True
                note_message(robots[mate], state.heard[mission, mate, index], here, time_s, batch.count)
                hear_batch(rules, state, scan, mission, mate, batch.count)
    for mate in range(len(robots)):
        if heard[mate] > _HAS_IT:
            state.heard[mission, mate, index].heard_s = time_s
            copy_numbers(here, state.heard[mission, mate, index].pose, 5)
            heard[mate] = _HAS_IT
