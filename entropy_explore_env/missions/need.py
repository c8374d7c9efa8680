"""Sharing by need: of what a robot measured lately, it sends first what teammates lack.

After each scan a robot weighs the measurements of its latest scans and sends the most valuable ones within
the bits of a burst. A measurement is worth

    value = I · (share of the teammates that lack it)

with I the bits that it brought to the robot's own map (Rocha04, eq. 27). Receipts in its teammates' messages
tell the robot which of them have it. So what was never sent counts in full, what was lost is sent again, and
no loss rate need be known. A teammate fuses each measurement once.
"""

from __future__ import annotations

from entropy_explore_env.belief.raycast import point
from entropy_explore_env.compilation.kernels import inlined_kernel, lean_kernel
from entropy_explore_env.missions.localization import believed_scan_pose, note_covariance, weigh_batch
from entropy_explore_env.missions.messages import (
    ONE_MESSAGE,
    Tracer,
    count_sent,
    hear_batch,
    message_bits,
    note_recipients,
    pack_measurements,
    receipt_bits,
    transmit,
    unpack_measurements,
)
from entropy_explore_env.missions.poses import copy_numbers
from entropy_explore_env.robots.channel import select_measurements
from entropy_explore_env.settings.channel import BITS_PER_MEASUREMENT

_SENT = -2.0
"""In place of the value of a measurement that is sent now."""
_EARLIER_SCANS = 5
"""Most earlier scans in a message: each costs its pose, which is dear for few measurements."""
_CANDIDATES = 4
"""Measurements that are looked at for each one of a burst, since not all scans find a place."""


@lean_kernel
def share_by_need(backlog, mission, scan, sensor, index, recipients):
    """Keep a robot's scan, and broadcast the measurements that teammates need most.

    Args:
        backlog: TeamBacklog, or None.
        mission: Mission.
        scan: Scan of the robot, with the utility of each ray; then scratch space.

    Returns:
        Whether robots send by need, and no other batches.
    """
    if backlog is None:  # known while compiling: nothing of the rest is compiled
        return False
    team, time_s = mission.team, mission.clock.time_s
    robot, here = team.robots[index], believed_scan_pose(team.localization, team.robots[index], index)
    keep_scan(backlog, team.localization, robot, index, here, scan)
    count, bits = choose_needed(backlog, team, index)
    if count == 0:
        return True
    count_sent(robot, count, bits)
    transmit(team, index, point(robot.scan_pose), time_s, ONE_MESSAGE, recipients)
    note_recipients(team, recipients, index, here, time_s, time_s, count, bits)
    tracer = Tracer(sensor.params, mission.truth)
    for age in range(min(robot.scans, len(backlog.selection.counts))):
        if backlog.selection.counts[age] > 0:
            deliver(backlog, mission, tracer, scan, index, age, recipients)
    return True


@inlined_kernel
def slot_of(backlog, robot, age):
    """Return where the scan that a robot took `age` scans ago is kept."""
    return (robot.scans - 1 - age) % backlog.poses.shape[1]


@lean_kernel
def keep_scan(backlog, localization, robot, index, pose, scan):
    """Keep a robot's latest scan, taken at `pose` as it believes, in place of its oldest one."""
    slot, rays = slot_of(backlog, robot, 0), len(scan.rays)
    copy_numbers(pose, backlog.poses[index, slot], 5)
    note_covariance(localization, index, backlog.covariances[index], slot)
    pack_measurements(scan, rays, backlog.rays[index, slot])
    copy_numbers(scan.utility, backlog.bits[index, slot], rays)
    backlog.sent_s[index, slot].fill(0.0)
    backlog.heard_s[index, slot].fill(0.0)


@lean_kernel
def choose_needed(backlog, team, index):
    """Mark the measurements that a robot sends with `_SENT`, the most valuable ones within a burst's bits.

    The first measurement of an earlier scan costs that scan's pose, too.

    Returns:
        (measurements, bits) of the message.
    """
    chosen, params = backlog.selection, team.params[index]
    kept = weigh_kept(backlog, team, index)
    value, rays = chosen.value[:kept], params.rays
    best = select_measurements(value, min(kept, _CANDIDATES * params.burst), 0.0, chosen.order)
    alone = message_bits(team.localization, 0)
    most, bits, count = alone + params.burst * BITS_PER_MEASUREMENT, alone + receipt_bits(team), 0
    chosen.counts.fill(0)
    earlier = 0
    for place in range(best):
        number = chosen.order[place]
        age, cost = number // rays, BITS_PER_MEASUREMENT
        another = age > 0 and chosen.counts[age] == 0
        if another:
            cost += alone
        if bits + cost <= most and not (another and earlier == _EARLIER_SCANS):
            earlier += int(another)
            chosen.counts[age] += 1
            value[number] = _SENT
            count, bits = count + 1, bits + cost
    return count, bits


@lean_kernel
def weigh_kept(backlog, team, index):
    """Fill in what each kept measurement is worth, the latest scan first; returns how many there are.

    What no teammate lacks, and what brought less than I_min, is worth -1.
    """
    robot, params, value = team.robots[index], team.params[index], backlog.selection.value
    number = 0
    for age in range(min(robot.scans, len(backlog.selection.counts))):
        slot = slot_of(backlog, robot, age)
        for ray in range(params.rays):
            bits, worth = backlog.bits[index, slot, ray], 0.0
            if bits >= robot.i_min_bits:
                worth = bits * share_lacking(backlog, team.heard[index], index, slot, ray)
            value[number] = worth if worth > 0.0 else -1.0
            number += 1
    return number


@lean_kernel
def share_lacking(backlog, heard, index, slot, ray):
    """Return the share of its teammates that lack a measurement, as far as a robot knows.

    All lack what was never sent. What was sent counts as heard until a later message of a teammate shows by
    its receipt that it was not.
    """
    sent_s, lacking = backlog.sent_s[index, slot, ray], 0
    if sent_s == 0.0:
        return 1.0
    for mate in range(len(heard)):
        heard_s, said_s = backlog.heard_s[index, slot, ray, mate], heard[mate].heard_s
        if mate != index and sent_s < said_s and not 0.0 < heard_s < said_s:
            lacking += 1
    return lacking / (len(heard) - 1)


@lean_kernel
def deliver(backlog, mission, tracer, scan, index, age, recipients):
    """Let the recipients of a message fuse what it holds of one scan, unless they have it already."""
    team, chosen, time_s = mission.team, backlog.selection, mission.clock.time_s
    params, slot, count = team.params[index], slot_of(backlog, team.robots[index], age), 0
    for ray in range(params.rays):
        if chosen.value[age * params.rays + ray] == _SENT:
            copy_numbers(backlog.rays[index, slot, ray], chosen.rays[count], 5)
            backlog.sent_s[index, slot, ray] = time_s
            chosen.order[count] = ray
            count += 1
    unpack_measurements(params, tracer, 0, scan, backlog.poses[index, slot], chosen.rays, count)
    weigh_batch(team.localization, backlog.covariances[index], slot, scan, count, params.voxel_size_m)
    for mate in range(len(team.robots)):
        if not recipients[mate]:
            continue
        new = 0
        for place in range(count):
            ray = chosen.order[place]
            if backlog.heard_s[index, slot, ray, mate] == 0.0:
                backlog.heard_s[index, slot, ray, mate] = time_s
                scan.order[new] = place
                new += 1
        hear_batch(team, mission.maps, scan, mate, new)
