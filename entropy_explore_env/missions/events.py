"""Which event of a mission is next, compiled.

A robot stops by a fault; a message arrives; the robots broadcast; a robot scans, has waited, or decides
under way. `next_event` alone says which of them is next, also of those at one instant.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.missions.faults import next_stop, stops_counted
from entropy_explore_env.missions.phases import broadcasts_made, next_broadcast


class InFlight(NamedTuple):
    """The delayed messages of one mission: slices of MissionState."""

    messages: np.ndarray
    """(Q,) MESSAGE."""
    recipients: np.ndarray
    """(Q, A) bool."""
    rays: np.ndarray
    """(Q, B, 5) float64."""
    covariances: np.ndarray
    """(Q, 10) float64."""


@lean_kernel
def in_flight_of(slots, state, mission):
    """Return the InFlight of a mission; None where all messages arrive at once."""
    if slots is None:  # known while compiling: nothing of the rest is compiled
        return None
    return InFlight(
        state.in_flight[mission],
        state.in_flight_to[mission],
        state.in_flight_rays[mission],
        state.in_flight_covariances[mission],
    )


@lean_kernel
def next_message(in_flight):
    """Return (slot, time) of the next message that arrives, the earlier sent first; time inf if none."""
    soonest, due_s = 0, math.inf
    if in_flight is None:  # known while compiling: nothing of the rest is compiled
        return soonest, due_s
    messages = in_flight.messages
    for slot in range(len(messages)):
        due = messages[slot].due_s
        if due < due_s or (
            due == due_s and not math.isinf(due) and messages[slot].serial < messages[soonest].serial
        ):
            soonest, due_s = slot, due
    return soonest, due_s


@lean_kernel
def under_way(in_flight):
    """Return the number of delayed messages that have not arrived."""
    count = 0
    if in_flight is None:  # known while compiling: nothing of the rest is compiled
        return count
    for message in in_flight.messages:
        count += int(not math.isinf(message.due_s))
    return count


NO_EVENT, MESSAGE_ARRIVES, BROADCAST_DUE, ROBOT_DUE, ROBOT_STOPS = range(5)
"""Kinds of events."""


class Event(NamedTuple):
    """What happens next in a mission."""

    kind: int
    """A robot stops by a fault, a message arrives, the robots broadcast, a robot scans, has waited or decides
    under way; or nothing."""
    number: int
    """The slot of the message, or the number of the robot; 0 for others."""
    time_s: float
    """When; inf = never."""


@lean_kernel
def next_event(shared, robots, in_flight, phases, faults):
    """Return the earliest Event.

    Of those at one instant robots that stop come first; then messages, in the order of sending; then the
    broadcast of all robots; then robots by number.
    """
    slot, due_s = next_message(in_flight)
    broadcast_s = next_broadcast(phases, shared.phase_s)
    robot, robot_s = next_robot(robots)
    stopping, stopping_s = next_stop(faults)
    soonest_s = min(due_s, broadcast_s, robot_s, stopping_s)
    if math.isinf(soonest_s):
        return Event(NO_EVENT, 0, soonest_s)
    if stopping_s == soonest_s:
        return Event(ROBOT_STOPS, stopping, soonest_s)
    if due_s == soonest_s:
        return Event(MESSAGE_ARRIVES, slot, soonest_s)
    if broadcast_s == soonest_s:
        return Event(BROADCAST_DUE, 0, soonest_s)
    return Event(ROBOT_DUE, robot, soonest_s)


@lean_kernel
def next_robot(robots):
    """Return (robot, time) of the next that scans (under way or not), has waited, or may decide under way.

    The time is inf if all of them stand and decide.
    """
    soonest, soonest_s = 0, math.inf
    for index in range(len(robots)):
        robot = robots[index]
        if not robot.deciding or robot.under_way:
            due_s = robot.next_scan_s if robot.under_way else min(robot.next_scan_s, robot.redecide_s)
            if due_s < soonest_s:
                soonest, soonest_s = index, due_s
    return soonest, soonest_s


@lean_kernel
def events_handled(robots, in_flight, phases, faults):
    """Return a number that every event makes greater, so that none is met twice: asserted in debug builds.

    A message frees its slot. A broadcast is counted. A robot counts its scan; or it decides, having waited or
    driven since it last decided; or it puts that off. A scan may send a message, begin the wait of a robot
    that could decide, and set when it decides next: it counts for more than these three. So does a stop,
    after which a robot does not decide. Arguments as those of `next_event`.
    """
    handled = broadcasts_made(phases) + 4 * stops_counted(faults) - under_way(in_flight)
    for robot in robots:
        handled += 4 * robot.scans + int(robot.deciding) + int(math.isinf(robot.redecide_s))
    return handled
