"""Maps shared as summaries (Sujan, sect. 2.4): when robots send them, and what teammates make of them.

At the end of a scan, if enough time has passed since its latest summary, a robot sends a quadtree of what it
measured itself since then (`own_maps`). Teammates fuse each leaf at the precision that it carries, which is
never above what the sender had. Where robots drift, what they measure is less precise by the covariance of
their poses already. A summary carries the covariance at its sender's latest scan, too: errors of a pose are
common to many measurements and do not average out in a leaf, so no leaf is taken as more precise than the
place of the sender was known. That holds for each summary: what several of them add up to is what their
sender's own map has from the same measurements, or less. Like batches, summaries lie where their senders
believed to be.
"""

from __future__ import annotations

import math

import numpy as np

from entropy_explore_env.belief.map_update import ROW_FOLD_BELOW, fuse_row
from entropy_explore_env.belief.pooling import Pool, pool_row
from entropy_explore_env.belief.raycast import point
from entropy_explore_env.compilation.kernels import inlined_kernel, lean_kernel
from entropy_explore_env.missions.faults import draw_lateness
from entropy_explore_env.missions.localization import believed_scan_pose, covariance_bits
from entropy_explore_env.missions.messages import ONE_MESSAGE, count_sent, enqueue, note_recipients, transmit
from entropy_explore_env.missions.own_maps import forget_measured
from entropy_explore_env.missions.poses import copy_numbers, grid_size
from entropy_explore_env.robots.channel import BITS_PER_BATCH
from entropy_explore_env.robots.map_summary import open_summary, write_summary
from entropy_explore_env.robots.map_tree import read_leaf

_NO_MEASUREMENTS = np.int64(0)
"""As the number of measurements in a message. A NumPy integer, so that callees compile for one type."""
_BITS_PER_BYTE = 8


@lean_kernel
def share_summary(summaries, team, maps, clock, in_flight, index, recipients):
    """Send a summary of what a robot measured itself, if it is time for one.

    Returns:
        Whether robots send summaries, and no batches.
    """
    if summaries is None:  # known while compiling: nothing of the rest is compiled
        return False
    state, params = summaries.states[index], team.params[index]
    if state.high[0] > 0 and clock.time_s - state.sent_s >= params.summary_every_s:
        length = write_own(summaries, params, index)
        if summaries.tree.walk[0].leaves > 0:
            forget_measured(summaries, index, grid_size(params), clock.time_s)
            send_summary(summaries, team, maps, clock, in_flight, index, length, recipients)
    return True


@lean_kernel
def write_own(summaries, params, index):
    """Write the summary of a robot's own map into the tree's data; returns how many bytes it has."""
    state = summaries.states[index]
    low = state.low[0], state.low[1], state.low[2]
    high = state.high[0], state.high[1], state.high[2]
    mean, precision, threshold = (
        summaries.mean[index],
        summaries.precision[index],
        params.summary_threshold_bits,
    )
    return write_summary(summaries.tree, mean, precision, grid_size(params), low, high, threshold)


@lean_kernel
def send_summary(summaries, team, maps, clock, in_flight, index, length, recipients):
    """Broadcast the summary that was written, which teammates fuse at once or after the delay."""
    robot, time_s = team.robots[index], clock.time_s
    delay_s = team.params[0].delay_s + draw_lateness(team.faults, index)
    bits = summary_bits(team.localization, length)
    count_sent(robot, _NO_MEASUREMENTS, bits)
    if not transmit(team, index, point(robot.scan_pose), time_s, ONE_MESSAGE, recipients):
        return
    if delay_s > 0.0:
        slot = enqueue(in_flight, clock, team, index, _NO_MEASUREMENTS, recipients, delay_s)
        if slot >= 0:
            pack_summary(summaries, slot, index, len(team.robots), length)
        return
    here = believed_scan_pose(team.localization, robot, index)
    most = latest_precision(team.localization, index, team.params[0].voxel_size_m)
    note_recipients(team, recipients, index, here, time_s, time_s, _NO_MEASUREMENTS, bits)
    hear_summary(summaries.tree, team, maps, recipients, length, most)


@lean_kernel
def summary_bits(localization, length):
    """Return the bits of a summary, with its sender's pose and, where robots drift, covariance."""
    return BITS_PER_BATCH + _BITS_PER_BYTE * length + covariance_bits(localization)


@lean_kernel
def pack_summary(summaries, slot, index, robots, length):
    """Put the summary that was written beside a delayed message.

    A robot's places are used in turn: there are more of them than summaries of it can be under way.
    """
    places = len(summaries.contents) // robots
    place = index * places + summaries.states[index].sent % places
    parcel = summaries.parcels[slot]
    parcel.place, parcel.bytes = place, length
    copy_numbers(summaries.tree.coder.data, summaries.contents[place], length)


@lean_kernel
def receive_summary(summaries, team, maps, in_flight, slot):
    """Deliver a delayed summary: its recipients fuse it; its slot is free again.

    Returns:
        Whether the message was one; if not, nothing has changed.
    """
    if summaries is None or in_flight is None:  # known while compiling: nothing of the rest is compiled
        return False
    message, parcel = in_flight.messages[slot], summaries.parcels[slot]
    length = parcel.bytes
    if length == 0:
        return False
    time_s, sender, bits = message.due_s, message.sender, summary_bits(team.localization, length)
    message.due_s, parcel.bytes = math.inf, 0
    copy_numbers(summaries.contents[parcel.place], summaries.tree.coder.data, length)
    most = sent_precision(team.localization, in_flight.covariances, slot, team.params[0].voxel_size_m)
    recipients = in_flight.recipients[slot]
    pose, sent_s = message.pose, message.sent_s
    note_recipients(team, recipients, sender, pose, sent_s, time_s, _NO_MEASUREMENTS, bits)
    hear_summary(summaries.tree, team, maps, recipients, length, most)
    return True


@lean_kernel
def latest_precision(localization, index, voxel_size_m):
    """Return the most precision of a leaf of a robot's summary, by the covariance at its latest scan."""
    if localization is None:  # known while compiling: nothing of the rest is compiled
        return math.inf
    return precision_of_place(localization.estimates[index].packed, voxel_size_m)


@lean_kernel
def sent_precision(localization, covariances, slot, voxel_size_m):
    """Return the most precision of a leaf by the covariance beside a delayed message."""
    if localization is None:  # known while compiling: nothing of the rest is compiled
        return math.inf
    return precision_of_place(covariances[slot], voxel_size_m)


@lean_kernel
def precision_of_place(packed, voxel_size_m):
    """Return 1/σ² of coverage by how well a place is known: vsz² / tr Σ of x, y, z; inf = exactly."""
    off = packed[0] + packed[4] + packed[7]
    return voxel_size_m * voxel_size_m / off if off > 0.0 else math.inf


@lean_kernel
def hear_summary(tree, team, maps, recipients, length, most):
    """Fuse a summary into the beliefs of the robots that hear it, leaf by leaf, as a teammate's measurements.

    Args:
        tree: Tree, the summary in its data.
        recipients: (A,) bool, which robots hear it.
        most: Most precision that a leaf has.
    """
    if not open_summary(tree, length, grid_size(team.params[0])):
        return
    leaf = tree.leaf[0]
    while read_leaf(tree):
        known = np.float32(min(np.float64(leaf.precision), most))
        for index in range(len(team.robots)):
            if recipients[index]:
                bits = fuse_leaf(tree, team.params[0], maps, index, known)
                robot = team.robots[index]
                robot.entropy_bits -= bits
                robot.received_bits += bits
                robot.heard_bits += bits


@inlined_kernel
def fuse_leaf(tree, shared, maps, index, known):
    """Fuse the leaf that was read last into a robot's belief; returns the bits that it brings.

    Args:
        known: float32, precision that the leaf counts with.
    """
    walk, leaf, bits, shrink = tree.walk[0], tree.leaf[0], 0.0, 1.0
    mean, precision = maps.beliefs.mean[index], maps.beliefs.precision[index]
    pool = Pool(maps.cells, maps.beliefs.pooled[index], shared.prior_precision, shared.end_precision)
    pooling, coverage = len(maps.cells.voxels) > 0, leaf.mean
    for i in range(leaf.low[0], leaf.high[0]):
        for j in range(leaf.low[1], leaf.high[1]):
            row = (i * walk.size[1] + j) * walk.size[2]
            first, last = row + leaf.low[2], row + leaf.high[2]
            if pooling:
                pool_row(pool, mean, precision, first, last, -1.0)
            more, share = fuse_row(mean, precision, first, last, coverage, known)
            if pooling:
                pool_row(pool, mean, precision, first, last, 1.0)
            bits, shrink = bits + more, shrink * share
            if shrink < ROW_FOLD_BELOW:
                bits, shrink = bits - 0.5 * math.log2(shrink), 1.0
    return bits - 0.5 * math.log2(shrink)
