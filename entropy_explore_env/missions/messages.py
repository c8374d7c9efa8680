"""Messages between robots: sent, delivered at once or after a delay, fused and counted."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from entropy_explore_env.belief.map_update import fuse_scan
from entropy_explore_env.belief.pooling import Cells, Pool, fuse_pooled_scan
from entropy_explore_env.belief.raycast import distance_between, point
from entropy_explore_env.compilation.kernels import ASSERTING, lean_kernel
from entropy_explore_env.missions.backlog import TeamBacklog
from entropy_explore_env.missions.faults import (
    TeamFaults,
    count_silenced,
    draw_lateness,
    radio_silent,
    takes_in,
)
from entropy_explore_env.missions.localization import (
    TeamLocalization,
    believed_pose,
    believed_scan_pose,
    covariance_bits,
    estimate_of,
    note_covariance,
    weigh_batch,
)
from entropy_explore_env.missions.own_maps import TeamSummaries
from entropy_explore_env.missions.poses import (
    copy_numbers,
    grid_size,
    pose_at,
    within_grid,
)
from entropy_explore_env.missions.state import Beliefs
from entropy_explore_env.robots.channel import (
    BITS_PER_ANNOUNCEMENT,
    BITS_PER_BATCH,
    Air,
    Delivery,
    draw_delivery,
    edges_in_walls,
    path_loss_db,
)
from entropy_explore_env.robots.measured_rays import trace_measurement
from entropy_explore_env.settings.channel import BITS_PER_MEASUREMENT, BITS_PER_RECEIPT

_OUT_OF_RANGE, _LOST = Delivery.OUT_OF_RANGE.code, Delivery.LOST.code
_ANNOUNCEMENT = np.int64(-1)
"""In place of a number of measurements. A NumPy integer, so that callees compile for one type."""
ONE_MESSAGE = np.int64(1)
"""Number of messages of a broadcast that is sent at once; a NumPy integer for the same reason."""


class Team(NamedTuple):
    """The robots of one mission."""

    params: np.ndarray
    """(A,) PARAMS."""
    robots: np.ndarray
    """(A,) ROBOT."""
    heard: np.ndarray
    """(A, A) HEARD."""
    faults: TeamFaults | None = None
    """None = nothing goes wrong. All that may be None is known while compiling."""
    air: Air | None = None
    """What messages pass through; None = the channel reaches by distance alone."""
    localization: TeamLocalization | None = None
    """None = all robots know where they are."""
    summaries: TeamSummaries | None = None
    """None = robots send measurements, and no summaries."""
    backlog: TeamBacklog | None = None
    """None = robots send what is most useful of their latest scans."""


class Tracer(NamedTuple):
    """What it takes to trace measurements of teammates again."""

    sensors: np.ndarray
    """(A,) SENSOR_PARAMS."""
    coverage: np.ndarray
    """(V,) float32, any map of the workspace; what it holds does not matter."""


class Maps(NamedTuple):
    """The beliefs of one mission's robots, and the cells that they are pooled to."""

    beliefs: Beliefs
    cells: Cells


@lean_kernel
def fuse_measurements(team, maps, scan, index, count):
    """Fuse `count` measurements of `scan.order` into a robot's belief; returns the bits of `fuse_scan`."""
    mean, precision = maps.beliefs.mean[index], maps.beliefs.precision[index]
    if len(maps.cells.voxels) == 0:
        return fuse_scan(scan, count, mean, precision)
    shared = team.params[0]
    pool = Pool(maps.cells, maps.beliefs.pooled[index], shared.prior_precision, shared.end_precision)
    return fuse_pooled_scan(scan, count, mean, precision, pool)


@lean_kernel
def hear_batch(team, maps, scan, index, count):
    """Fuse received measurements as if the robot had taken them itself (Rocha04, sect. 5)."""
    robot, bits = team.robots[index], fuse_measurements(team, maps, scan, index, count)
    robot.entropy_bits -= bits
    robot.received_bits += bits
    robot.heard_bits += bits


@lean_kernel
def note_message(robot, heard, position, sent_s, count, bits):
    """Count a message that a robot hears, and note where its sender was, unless newer ones came before.

    Args:
        robot: ROBOT that hears it.
        position: (x, y, z, yaw, pitch), where the sender believed to be.
        count: Measurements in it; -1 = an announcement.
        bits: What it costs.

    Returns:
        Whether it is an announcement, and the newest.
    """
    robot.messages_received += 1
    robot.measurements_received += max(count, 0)
    robot.bits_received += bits
    if sent_s >= heard.heard_s:
        heard.heard_s = sent_s
        copy_numbers(position, heard.pose, 5)
    if count >= 0 or sent_s < heard.announced_s:
        return False
    heard.announced_s = sent_s
    return True


@lean_kernel
def note_recipients(team, recipients, sender, pose, sent_s, time_s, count, bits):
    """Count a message with recipients (A,), reduced to those that take it in; note where its sender was."""
    for mate in range(len(team.robots)):
        if recipients[mate]:
            recipients[mate] = takes_in(team.faults, team.robots[mate], mate, time_s, bits)
        if recipients[mate]:
            note_message(team.robots[mate], team.heard[mate, sender], pose, sent_s, count, bits)


@lean_kernel
def write_announcement(robot, announced):
    """Fill (7,): the viewpoint that a robot chose, and r̂ and α̂ of its latest scan."""
    copy_numbers(robot.target, announced, 5)
    announced[5] = robot.depth_m
    announced[6] = robot.half_angle_rad


@lean_kernel
def message_bits(localization, count):
    """Return what a message costs: a batch of `count` measurements, or an announcement (count = -1).

    Args:
        localization: Of the Team: where robots drift, batches carry their senders' covariances.
    """
    if count < 0:
        return BITS_PER_ANNOUNCEMENT
    return BITS_PER_BATCH + count * BITS_PER_MEASUREMENT + covariance_bits(localization)


@lean_kernel
def receipt_bits(team):
    """Return what the receipts in a message cost, where robots send by need."""
    if team.backlog is None:  # known while compiling: nothing of the rest is compiled
        return 0
    return (len(team.robots) - 1) * BITS_PER_RECEIPT


@lean_kernel
def transmit(team, index, place, time_s, messages, recipients):
    """Draw which teammates a broadcast reaches, and count those it does not; returns whether it reaches any.

    Args:
        place: (x, y, z), where it is sent from.
        messages: How many messages it holds, as NumPy's integer, so that this compiles for one type.
        recipients: (A,) bool, filled in.
    """
    robot, shared, heard = team.robots[index], team.params[0], False
    silent = radio_silent(team.faults, index, time_s)
    for mate in range(len(team.robots)):
        recipients[mate] = False
        if mate == index:
            continue
        apart_m = 0.0
        if not math.isinf(shared.channel_range_m):
            apart_m = distance_between(place, point(pose_at(team.params[mate], team.robots[mate], time_s)))
        code = draw_delivery(apart_m, shared.channel_range_m, shared.loss_probability, robot.channel_rng)
        if code != _OUT_OF_RANGE and not passes(team.air, team, mate, place, time_s):
            code = _OUT_OF_RANGE
        if silent:
            count_silenced(team.faults, index, messages)
        elif code == _LOST:
            robot.messages_lost += messages
        elif code == _OUT_OF_RANGE:
            robot.messages_out_of_range += messages
        else:
            recipients[mate] = heard = True
    return heard


@lean_kernel
def passes(air, team, mate, place, time_s):
    """Return whether walls, and the distance, let a message through to a teammate.

    Args:
        mate: The teammate that is to hear it.
        place: (x, y, z), where it is sent from.
    """
    if air is None:  # known while compiling: nothing of the rest is compiled
        return True
    shared, there = team.params[0], point(pose_at(team.params[mate], team.robots[mate], time_s))
    start, finish = within_grid(shared, place), within_grid(shared, there)
    walls_m = edges_in_walls(air, grid_size(shared), start, finish) * shared.voxel_size_m
    if shared.line_of_sight:
        return walls_m == 0.0
    exponent, wall_loss = shared.path_loss_exponent, shared.wall_loss_db_per_m
    return path_loss_db(distance_between(place, there), exponent, wall_loss, walls_m) <= shared.budget_db


@lean_kernel
def enqueue(in_flight, clock, team, index, count, recipients, delay_s):
    """Put a message into a free slot; returns the slot, or -1 where there is none: the message is gone.

    There is one in every mission: `Scenario.message_slots` counts how many messages can be under way at once.
    A state from outside may have none.

    Args:
        count: Measurements in it; -1 = an announcement.
        recipients: (A,) bool, which robots will hear it.
        delay_s: How long it is under way.
    """
    if in_flight is None:  # known while compiling: nothing of the rest is compiled
        return -1
    slot = 0
    while slot < len(in_flight.messages) and not math.isinf(in_flight.messages[slot].due_s):
        slot += 1
    if ASSERTING and slot == len(in_flight.messages):
        raise AssertionError("no slot is free for a message")
    if slot == len(in_flight.messages):
        return -1
    message = in_flight.messages[slot]
    message.sent_s = clock.time_s
    message.due_s = clock.time_s + delay_s
    message.serial = clock.enqueued
    clock.enqueued += 1
    message.sender = index
    message.count = count
    robot, localization = team.robots[index], team.localization
    if count < 0:
        here = believed_pose(estimate_of(localization, index), team.params[index], robot.origin)
        copy_numbers(here, message.pose, 5)
    else:
        copy_numbers(believed_scan_pose(localization, robot, index), message.pose, 5)
        note_covariance(localization, index, in_flight.covariances, slot)
    write_announcement(robot, message.announced)
    copy_numbers(recipients, in_flight.recipients[slot], len(recipients))
    return slot


@lean_kernel
def pack_measurements(scan, count, packed):
    """Fill (B, 5) with the first `count` measurements of `scan.order`: direction, distance, Return."""
    for i in range(count):
        ray, stored = scan.rays[scan.order[i]], packed[i]
        copy_numbers(ray.direction, stored, 3)
        stored[3] = ray.length
        stored[4] = ray.returned


@lean_kernel
def unpack_measurements(params, tracer, sender, scan, pose, packed, count):
    """Put packed measurements into a scan as if it had been taken at the sender's pose.

    Args:
        scan: Scan, filled in.
        pose: (5,) where the measurements were taken.
        packed: (B, 5), see `pack_measurements`.
    """
    size, start, sensor = grid_size(params), within_grid(params, pose), tracer.sensors[sender]
    for i in range(count):
        ray, stored = scan.rays[i], packed[i]
        scan.order[i] = i
        copy_numbers(stored, ray.direction, 3)
        ray.length = stored[3]
        ray.returned = int(stored[4])
        trace_measurement(scan, i, sensor, size, params.voxel_size_m, start, tracer.coverage)


@lean_kernel
def send_batch(team, maps, clock, in_flight, scan, index, count, recipients):
    """Broadcast `count` measurements of `scan.order`, which teammates fuse at once or after the delay."""
    robot = team.robots[index]
    delay_s = team.params[0].delay_s + draw_lateness(team.faults, index)
    time_s, bits = clock.time_s, message_bits(team.localization, count)
    count_sent(robot, count, bits)
    reached = transmit(team, index, point(robot.scan_pose), time_s, ONE_MESSAGE, recipients)
    if reached and delay_s > 0.0:
        keep_batch(in_flight, enqueue(in_flight, clock, team, index, count, recipients, delay_s), scan, count)
        return
    here = believed_scan_pose(team.localization, robot, index)
    for mate in range(len(team.robots)):
        if recipients[mate] and takes_in(team.faults, team.robots[mate], mate, time_s, bits):
            note_message(team.robots[mate], team.heard[mate, index], here, time_s, count, bits)
            hear_batch(team, maps, scan, mate, count)


@lean_kernel
def keep_batch(in_flight, slot, scan, count):
    """Put `count` measurements of `scan.order` into a message that is under way, if it has a slot."""
    if in_flight is None:  # known while compiling: nothing of the rest is compiled
        return
    if slot >= 0:
        pack_measurements(scan, count, in_flight.rays[slot])


@lean_kernel
def announce(team, clock, in_flight, index, recipients):
    """Tell the teammates the chosen viewpoint with r̂ and α̂ (RochaMI), if robots do so."""
    robot, shared = team.robots[index], team.params[0]
    if len(team.robots) == 1 or not shared.announcements:
        return
    time_s = clock.time_s
    bits = message_bits(team.localization, _ANNOUNCEMENT) + receipt_bits(team)
    count_sent(robot, _ANNOUNCEMENT, bits)
    delay_s = shared.delay_s + draw_lateness(team.faults, index)
    reached = transmit(team, index, point(robot.origin), time_s, ONE_MESSAGE, recipients)
    if reached and delay_s > 0.0:
        enqueue(in_flight, clock, team, index, _ANNOUNCEMENT, recipients, delay_s)
        return
    here = believed_pose(estimate_of(team.localization, index), team.params[index], robot.origin)
    for mate in range(len(team.robots)):
        if recipients[mate] and takes_in(team.faults, team.robots[mate], mate, time_s, bits):
            heard = team.heard[mate, index]
            if note_message(team.robots[mate], heard, here, time_s, _ANNOUNCEMENT, bits):
                write_announcement(robot, heard.announced)


@lean_kernel
def count_sent(robot, count, bits):
    """Count a message that a robot sends, and its bits: `count` measurements, or an announcement (-1)."""
    robot.messages_sent += 1
    robot.measurements_sent += max(count, 0)
    robot.bits_sent += bits


@lean_kernel
def receive(in_flight, team, maps, slot, tracer, scan):
    """Deliver a delayed message: recipients fuse it, or note what it announces; its slot is free again."""
    if in_flight is None:  # known while compiling: nothing of the rest is compiled
        return
    message = in_flight.messages[slot]
    time_s, bits = message.due_s, message_bits(team.localization, message.count)
    message.due_s = math.inf
    packed, sender = in_flight.rays[slot], message.sender
    unpack_measurements(team.params[0], tracer, sender, scan, message.pose, packed, message.count)
    edge_m = team.params[0].voxel_size_m
    weigh_batch(team.localization, in_flight.covariances, slot, scan, message.count, edge_m)
    for mate in range(len(team.robots)):
        if in_flight.recipients[slot, mate] and takes_in(team.faults, team.robots[mate], mate, time_s, bits):
            heard = team.heard[mate, sender]
            if note_message(team.robots[mate], heard, message.pose, message.sent_s, message.count, bits):
                copy_numbers(message.announced, heard.announced, 7)
            elif message.count >= 0:
                hear_batch(team, maps, scan, mate, message.count)
