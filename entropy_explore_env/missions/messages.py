"""Messages between robots: sent, delivered at once or after a delay, fused and counted."""

from __future__ import annotations

import math

import numpy as np

from entropy_explore_env.belief.pooling import fuse_pooled_ray
from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.missions.poses import copy_numbers, grid_position, pose_at
from entropy_explore_env.robots.channel import (
    BITS_PER_ANNOUNCEMENT,
    BITS_PER_BATCH,
    BITS_PER_MEASUREMENT,
    Delivery,
    deliver,
)
from entropy_explore_env.robots.range_sensor import Return, fuse_scan, trace_measurement

_NOTHING = int(Return.NOTHING)
_HEARD, _OUT_OF_RANGE, _LOST = (delivery.code for delivery in Delivery)
_ANNOUNCEMENT = np.int64(-1)
"""In place of a number of measurements. A NumPy integer, so that `send` compiles for one type."""


@lean_kernel
def fuse_measurements(rules, cells, state, scan, mission, index, count):
    """Fuse `count` measurements of `scan.order` into a robot's belief; returns the bits of `fuse_scan`."""
    mean, precision = state.mean[mission, index], state.precision[mission, index]
    if cells is None:  # known while compiling: nothing of the rest is compiled
        return fuse_scan(scan, count, mean, precision)
    ends = (rules.numbers[0].prior_precision, rules.numbers[0].end_precision)
    total = 0.0
    for i in range(count):
        place = scan.order[i]
        ray = scan.rays[place]
        scan.utility[place] = 0.0
        if ray.returned != _NOTHING:
            scan.utility[place] = fuse_pooled_ray(
                cells,
                state.pooled[mission, index],
                ends,
                mean,
                precision,
                scan.crossed[place],
                scan.coverage[place],
                ray.free,
                ray.voxels,
                ray.measured,
            )
            total += scan.utility[place]
    return total


@lean_kernel
def hear_batch(rules, state, scan, mission, index, count):
    """Fuse received measurements as if the robot had taken them itself (Rocha04, sect. 5)."""
    bits = fuse_measurements(rules, rules.cells, state, scan, mission, index, count)
    state.robots[mission, index].entropy_bits -= bits
    state.robots[mission, index].received_bits += bits
    state.robots[mission, index].heard_bits += bits


@lean_kernel
def note_message(robot, heard, pose, sent_s, count):
    """Count a message that a robot hears, and note where its sender was."""
    robot.messages_received += 1
    robot.measurements_received += max(count, 0)
    robot.bits_received += message_bits(count)
    heard.heard_s = sent_s
    copy_numbers(pose, heard.pose, 5)
    if count < 0:
        heard.announced_s = sent_s


@lean_kernel
def write_announcement(robot, announced):
    """Fill (7,): the viewpoint that a robot chose, and r̂ and α̂ of its latest scan."""
    copy_numbers(robot.target, announced, 5)
    announced[5] = robot.depth_m
    announced[6] = robot.half_angle_rad


@lean_kernel
def message_bits(count):
    """What a message costs: a batch of `count` measurements, or an announcement (count = -1)."""
    if count < 0:
        return BITS_PER_ANNOUNCEMENT
    return BITS_PER_BATCH + count * BITS_PER_MEASUREMENT


@lean_kernel
def post_letter(delayed, numbers, state, scan, mission, index, count):
    """Put a message into a free place of the mail; returns the place. There is none if `delayed` is None."""
    if delayed is None:
        return -1
    clock, robot, mail = state.missions[mission], state.robots[mission, index], state.mail[mission]
    place = 0
    while not math.isinf(mail[place].due_s):
        place += 1
    letter = mail[place]
    letter.sent_s = clock.time_s
    letter.due_s = clock.time_s + numbers.delay_s
    letter.serial = clock.letters
    clock.letters += 1
    letter.sender = index
    letter.count = count
    for mate in range(state.robots.shape[1]):
        state.mail_to[mission, place, mate] = False
    copy_numbers(robot.origin if count < 0 else robot.scan_pose, letter.pose, 5)
    write_announcement(robot, letter.announced)
    pack_measurements(scan, count, state.mail_rays[mission, place])
    return place


@lean_kernel
def pack_measurements(scan, count, packed):
    """Fill (B, 5) with the first `count` measurements of `scan.order`: direction, distance, Return."""
    for i in range(count):
        ray, mailed = scan.rays[scan.order[i]], packed[i]
        copy_numbers(ray.direction, mailed, 3)
        mailed[3] = ray.length
        mailed[4] = ray.returned


@lean_kernel
def unpack_measurements(rules, state, scan, mission, sender, pose, packed, count):
    """Put packed measurements into a scan as if it had been taken at the sender's pose."""
    numbers = rules.numbers[0]
    size = (numbers.size[0], numbers.size[1], numbers.size[2])
    start, sensor = grid_position(numbers, pose), rules.sensors.numbers[sender]
    for i in range(count):
        ray, mailed = scan.rays[i], packed[i]
        scan.order[i] = i
        copy_numbers(mailed, ray.direction, 3)
        ray.length = mailed[3]
        ray.returned = int(mailed[4])
        trace_measurement(scan, i, sensor, size, numbers.voxel_size_m, start, state.truth[mission])


@lean_kernel
def send(rules, state, scan, mission, index, count):
    """Broadcast a batch of `count` measurements (`scan.order`), or an announcement (count = -1)."""
    numbers, clock, robot = rules.numbers[0], state.missions[mission], state.robots[mission, index]
    here = robot.origin if count < 0 else robot.scan_pose
    robot.messages_sent += 1
    robot.measurements_sent += max(count, 0)
    robot.bits_sent += message_bits(count)
    letter = -1
    for mate in range(state.robots.shape[1]):
        if mate == index:
            continue
        apart_m = 0.0
        if not math.isinf(numbers.channel_range_m):
            there = pose_at(rules.numbers[mate], state.robots[mission, mate], clock.time_s)
            apart_m = math.sqrt(
                (here[0] - there[0]) ** 2 + (here[1] - there[1]) ** 2 + (here[2] - there[2]) ** 2
            )
        code = deliver(apart_m, numbers.channel_range_m, numbers.loss_probability, robot.channel_chance)
        if code == _LOST:
            robot.messages_lost += 1
        elif code == _OUT_OF_RANGE:
            robot.messages_out_of_range += 1
        elif numbers.delay_s > 0.0:
            if letter < 0:
                letter = post_letter(rules.delayed, numbers, state, scan, mission, index, count)
            state.mail_to[mission, letter, mate] = True
        else:
            heard = state.heard[mission, mate, index]
            note_message(state.robots[mission, mate], heard, here, clock.time_s, count)
            if count < 0:
                write_announcement(robot, heard.announced)
            else:
                hear_batch(rules, state, scan, mission, mate, count)


@lean_kernel
def announce(rules, state, scan, mission, robot):
    """Tell the teammates the chosen viewpoint with r̂ and α̂ (RochaMI)."""
    if state.robots.shape[1] > 1 and rules.numbers[0].announcements:
        send(rules, state, scan, mission, robot, _ANNOUNCEMENT)


@lean_kernel
def open_letter(delayed, rules, state, scan, mission, place):
    """A message arrives: its hearers fuse it, or note what it announces; its place is free again."""
    if delayed is None:
        return
    letter, packed = state.mail[mission, place], state.mail_rays[mission, place]
    letter.due_s = math.inf
    unpack_measurements(rules, state, scan, mission, letter.sender, letter.pose, packed, letter.count)
    for robot in range(state.robots.shape[1]):
        if state.mail_to[mission, place, robot]:
            heard = state.heard[mission, robot, letter.sender]
            note_message(state.robots[mission, robot], heard, letter.pose, letter.sent_s, letter.count)
            if letter.count < 0:
                copy_numbers(letter.announced, heard.announced, 7)
            else:
                hear_batch(rules, state, scan, mission, robot, letter.count)


@lean_kernel
def next_letter(mail):
    """(place, time) of the next message that arrives, the earlier sent first; time inf if none."""
    soonest, due_s = 0, math.inf
    for letter in range(len(mail)):
        due = mail[letter].due_s
        if due < due_s or (
            due == due_s and not math.isinf(due) and mail[letter].serial < mail[soonest].serial
        ):
            soonest, due_s = letter, due
    return soonest, due_s
