"""What belongs to one mission, robot, pair of robots or message, as structured types with their ranges.

Map frame, metres, radians, seconds, bits; a pose or viewpoint is (x, y, z, yaw, pitch). A field that the
simulation does not carry from step to step is not here.
"""

from __future__ import annotations

import math

import numpy as np

from entropy_explore_env.codes import Coded
from entropy_explore_env.robots.motion import MoveEnd
from entropy_explore_env.robots.ranges import (
    COUNT,
    FAR_PLACE,
    FAR_POSE,
    FLAG,
    HUGE,
    MOST,
    PAST,
    PAST_OR_NEVER,
    POSE,
    POSITIVE,
    ROUNDING,
    SIGNED,
    Values,
    ranged_type,
)
from entropy_explore_env.settings.grid import MAX_VOXELS


class MissionEnd(Coded):
    """Why a mission is over; the value is a sentence for people."""

    RUNNING = "The mission goes on."
    MAPPED = "The entropy of the map, or of all maps, fell to the threshold."
    TIME_UP = "The simulated time reached its limit."
    CYCLES_UP = "The number of steps reached its limit."
    SEEN = "The team has seen as much of the world as the mission asks for."
    STOPPED = "All robots have stopped for good."
    EXHAUSTED = "All that robots can drive up to was seen, and scans have long shown nothing new."

    @property
    def reached_goal(self) -> bool:
        """Whether the mission came to what it asks for: then it is terminated. Others are truncated."""
        return self in (MissionEnd.MAPPED, MissionEnd.SEEN)


def goals_reached(ends: np.ndarray) -> np.ndarray:
    """Return which of some missions came to what they ask for, bool, from the codes of their ends."""
    return (ends == MissionEnd.MAPPED.code) | (ends == MissionEnd.SEEN.code)


_VOXELS = Values(0, "voxels")
_EVENT = Values(0.0, MOST, math.inf)
"""A time, or never."""

PROGRESS = (0.5, 0.9, 0.99, 1.0)
"""Shares of the bits that the mission asks for, at which the time is taken."""

SEEN_MARKS = (0.5, 0.9, 0.95, 0.99, 1.0)
"""Shares of what can be seen, at which time and driven path are taken where the truth is tracked."""

WAYPOINTS = 32
"""Most points that a planned path leads to, one after the other."""

MISSION = ranged_type(
    [
        ("entropy_start_bits", "f8", SIGNED),  # H(0), Rocha04 eq. 25
        ("entropy_end_bits", "f8", SIGNED),  # H_th, the threshold that ends the mission
        ("time_s", "f8", Values(0.0, "time_limit_s")),
        ("cycles", "i8", Values(0, "cycles")),  # steps so far
        ("end", "i8", Values(0, len(MissionEnd) - 1)),  # code of a MissionEnd
        ("enqueued", "i8", COUNT),  # delayed messages sent so far
        # when the best map had lost each of PROGRESS; -1 = not yet
        ("reached_s", "f8", PAST_OR_NEVER, (len(PROGRESS),)),
        # of the joint map, where the truth is tracked
        ("joint_bits", "f8", SIGNED),  # its entropy
        ("explored", "i8", _VOXELS),  # voxels measured at all
        ("explored_visible", "i8", _VOXELS),  # explored voxels that can be seen from where robots can be
        ("error", "f8", Values(-ROUNDING, "voxels")),  # sum of |expected - true coverage| over explored ones
        ("wrong", "i8", _VOXELS),  # explored voxels on the wrong side of ½
        ("visible", "i8", _VOXELS),  # voxels that can be seen from where robots can be
        ("visible_free", "i8", _VOXELS),  # visible voxels that are free
        ("explored_free", "i8", _VOXELS),  # visible free voxels that were measured
        # when each share of SEEN_MARKS of what is visible was explored, and what the team had driven then;
        # -1 = not yet
        ("seen_s", "f8", PAST_OR_NEVER, (len(SEEN_MARKS),)),
        ("seen_m", "f8", Values(-ROUNDING, MOST, -1.0), (len(SEEN_MARKS),)),
        # explored visible voxels, and free ones among them, that end a mission which ends by what was seen
        ("explored_end", "i8", Values(0, MAX_VOXELS)),
        ("explored_free_end", "i8", Values(-MAX_VOXELS, "voxels")),
        # since a scan showed something new, or since it was asked what is left:
        ("idle_scans", "i8", COUNT),  # the team's scans
        ("idle_from_m", "f8", Values(-ROUNDING, MOST)),  # what the team had driven when they began
    ],
)

ROBOT = ranged_type(
    [
        ("entropy_bits", "f8", SIGNED),  # of its map, carried by H -= I (Rocha04, eq. 29)
        ("deciding", "?", FLAG),  # whether it chooses a viewpoint in the next step
        ("under_way", "?", FLAG),  # whether it does so while it drives on
        ("path_blocked", "?", FLAG),  # whether a scan under way showed that the rest of its path is blocked
        # whether it stands still, or stood still until it decides, since a blocked drive
        ("waiting", "?", FLAG),
        ("origin", "f8", POSE, (5,)),  # pose at which the latest drive began
        ("goal", "f8", POSE, (5,)),  # pose at which it ends, or ended
        ("target", "f8", FAR_POSE, (5,)),  # viewpoint that was chosen, whether or not the drive ends there
        ("scan_pose", "f8", POSE, (5,)),  # pose of the latest scan
        # points to which it meant to drive straight, one after the other
        ("path", "f8", FAR_PLACE, (WAYPOINTS, 3)),
        ("waypoints", "i8", Values(0, WAYPOINTS)),  # points of the path; 0 = straight to the target
        # code of a MoveEnd: how a planned drive ends if nothing stops it
        ("path_end", "i8", Values(0, len(MoveEnd) - 1)),
        ("corners", "i8", Values(0, WAYPOINTS)),  # how many of the points the drive passes before its goal
        ("path_m", "f8", POSITIVE),  # length of the drive
        ("departed_m", "f8", Values(0.0, MOST)),  # what it had driven when the drive began
        ("depart_s", "f8", PAST),  # start of the drive
        ("lead_s", "f8", SIGNED),  # of its SpeedProfile
        ("scan_lead_m", "f8", POSITIVE),  # metres from its latest scan to the start of the drive
        ("decided_s", "f8", PAST),  # when it decided last, whether or not that changed the drive
        # when it decides under way, or when it could since; inf = not before it stops
        ("redecide_s", "f8", Values(0.0, "soon_s", math.inf)),
        ("next_scan_s", "f8", Values(0.0, "next_s")),  # when it scans next: under way, or at `ready_s`
        ("scans_under_way", "i8", COUNT),  # that it took in this drive
        ("ready_s", "f8", Values(0.0, "next_s")),  # end of the scan after it; of the wait, while it waits
        ("move_end", "i8", Values(0, len(MoveEnd) - 1)),  # code of a MoveEnd of the latest drive
        ("depth_m", "f8", Values(0.0, "longest_m")),  # r̂ of the latest scan (RochaMI, eq. 4)
        ("half_angle_rad", "f8", Values(0.0, math.pi + ROUNDING)),  # α̂ of it
        ("i_min_bits", "f8", Values(0.0, HUGE)),  # least utility that it sent of its latest scan
        ("next_i_min_bits", "f8", Values(0.0, HUGE)),  # that it will send of its next one
        ("own_bits", "f8", SIGNED),  # taken from its map by its own scans in the latest step
        ("received_bits", "f8", SIGNED),  # taken from its map by teammates' measurements in the latest step
        ("reward", "f8", Values(-HUGE, HUGE)),  # of the latest step
        ("sensor_rng", "u8", None, (1,)),  # random state of range noise
        ("channel_rng", "u8", None, (1,)),  # random state of message loss
        # counted from the mission's start
        ("distance_m", "f8", Values(0.0, MOST)),  # driven up to the mission's time
        ("scans", "i8", COUNT),
        ("measurements", "i8", COUNT),
        ("redundant", "i8", COUNT),  # measurements that brought less than its I_min to its own map
        ("gained_bits", "f8", SIGNED),  # taken from its map by its own scans
        ("heard_bits", "f8", SIGNED),  # taken from its map by teammates' measurements
        ("blocked_moves", "i8", COUNT),
        ("messages_sent", "i8", COUNT),
        ("measurements_sent", "i8", COUNT),
        ("bits_sent", "i8", COUNT),
        ("messages_received", "i8", COUNT),
        ("measurements_received", "i8", COUNT),
        ("bits_received", "i8", COUNT),
        ("messages_lost", "i8", COUNT),  # per teammate that a message did not reach by chance
        ("messages_out_of_range", "i8", COUNT),  # per teammate that was too far away for a message
    ],
)

FAULT = ranged_type(
    [
        # when each outage begins and ends; inf = never
        ("stop_s", "f8", _EVENT),
        ("stop_until_s", "f8", _EVENT),
        ("blind_s", "f8", _EVENT),
        ("blind_until_s", "f8", _EVENT),
        ("silent_s", "f8", _EVENT),
        ("silent_until_s", "f8", _EVENT),
        ("stopped", "?", FLAG),  # whether it has stopped, whether or not it works again
        ("sensor_rng", "u8", None, (1,)),  # random state of lost rays
        ("radio_rng", "u8", None, (1,)),  # random state of messages that go wrong
        # counted from the mission's start
        ("blind_scans", "i8", COUNT),
        ("rays_lost", "i8", COUNT),
        ("messages_silenced", "i8", COUNT),  # per teammate not reached by a silent radio, and those not heard
        ("messages_garbled", "i8", COUNT),  # that arrived garbled
        ("messages_repeated", "i8", COUNT),  # that arrived twice
        ("messages_late", "i8", COUNT),  # that were sent late
    ],
)

COUNTED = ROBOT.names[ROBOT.names.index("distance_m") :] if ROBOT.names else ()
"""Fields of ROBOT that count from the mission's start."""

HEARD = ranged_type(
    [
        ("heard_s", "f8", PAST_OR_NEVER),  # when the last message that arrived was sent; -1 = none did
        ("pose", "f8", FAR_POSE, (5,)),  # where its sender was
        # when the last announcement that arrived was sent; -1 = none did
        ("announced_s", "f8", PAST_OR_NEVER),
        ("announced", "f8", Values("announced_low", "announced_high"), (7,)),  # its viewpoint, r̂ and α̂
    ],
)

MESSAGE = ranged_type(
    [
        ("due_s", "f8", Values(0.0, "due_s", math.inf)),  # when it arrives; inf = a free slot
        ("sent_s", "f8", PAST),
        ("serial", "i8", Values(0, "enqueued")),  # order of sending
        ("sender", "i8", Values(0, "last_robot")),
        ("count", "i8", Values(-1, "batch")),  # measurements in it; -1 = an announcement
        ("pose", "f8", FAR_POSE, (5,)),  # where the sender was
        ("announced", "f8", Values("announced_low", "announced_high"), (7,)),
    ],
)

PHASES = ranged_type(
    [
        ("broadcasts", "i8", COUNT),  # how often the robots have broadcast
        # the buffer, 0 or 1, that takes in new batches; the other one is broadcast
        ("collecting", "i8", FLAG),
    ],
)

BATCH = ranged_type(
    [
        ("pose", "f8", FAR_POSE, (5,)),  # where the scan was taken
        ("count", "i8", Values(0, "batch")),  # measurements of it
    ],
)
