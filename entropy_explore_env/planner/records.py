"""The records of the planner: what a robot knows, what it remembers, and viewpoints, as structured arrays.

Places and viewpoints (x, y, z, yaw, pitch) are in grid units and radians, but where a line says otherwise.
"""

from __future__ import annotations

import enum

from entropy_explore_env.compilation.kernels import record_type
from entropy_explore_env.planner.thresholds import REMEMBERED, REMEMBERED_EDGES
from entropy_explore_env.robots.ranges import (
    COUNT,
    FAR_GRID_PLACE,
    FAR_GRID_POSE,
    FAR_POSE,
    FLAG,
    GRID_PLACE,
    GRID_POSE,
    HUGE,
    POSITIVE,
    SIGNED,
    Values,
    ranged_type,
)


class Kind(enum.IntEnum):
    """Where a candidate lies."""

    NONE = 0
    """There is no candidate of this number."""
    SPOT = 1
    """Where the robot is: another gaze."""
    NEAR = 2
    """Within reach."""
    FAR = 3
    """The first stop on the way to a far place."""


KNOWLEDGE = record_type(
    [
        ("pose", "f8", (5,)),  # where it believes to be
        ("target", "f8", (5,)),  # the viewpoint that it chose last
        ("time_s", "f8"),
        ("entropy_left", "f8"),  # share of its map's entropy
        ("gained_bits", "f8"),  # taken from its map by its own scans
        ("heard_bits", "f8"),  # taken from its map by teammates' measurements
        ("came_bits", "f8"),  # taken from its map by its latest scan
        ("move_end", "i8"),  # code of a MoveEnd: why its latest drive ended
        ("under_way", "?"),  # whether it still drives to its target
        (
            "place_variance",
            "f8",
        ),  # of its pose estimate, over all axes, squared voxel edges; 0 = exact
        ("yaw_variance", "f8"),  # rad²
        ("teammates", "i8"),  # number of them
    ],
)
"""What one robot knows at a decision, beside its belief, its teammates and its experience."""

MATE = record_type(
    [
        ("place", "f8", (3,)),  # where it was last heard
        ("max_speed_m_s", "f8"),
        ("acceleration_m_s2", "f8"),
        ("scan_time_s", "f8"),
        ("body_radius", "f8"),  # voxel edges
        ("silent", "?"),  # whether it counts as silent
    ],
)
"""A teammate that was heard."""

OPTION = record_type(
    [
        ("viewpoint", "f8", (5,)),
        ("goal", "f8", (5,)),  # the far viewpoint to which it leads, else itself
        ("bits", "f8"),  # that a scan at the goal should bring
        ("stop_bits", "f8"),  # that a scan at the viewpoint should bring
        ("seconds", "f8"),  # until the scan at the goal is taken; inf = there is no path
        ("value", "f8"),  # what it is worth to the planner: bits / s^c
        ("kind", "i8"),  # a Kind
    ],
)
"""A viewpoint of the pool out of which candidates are selected."""

CANDIDATE = ranged_type(
    [
        ("viewpoint", "f8", FAR_POSE, (5,)),  # map frame, metres; of those that are none, the first one's
        ("goal", "f8", GRID_POSE, (5,)),  # the far viewpoint to which it leads, else itself
        ("bits", "f8", POSITIVE),  # that a scan at the viewpoint should bring
        ("kind", "i8", Values(0, max(Kind))),
    ],
)
"""A viewpoint that is proposed to a robot."""

VIEW = record_type(
    [
        ("bits", "f8"),  # of a scan, but for what is left to teammates
        ("all_bits", "f8"),  # with what is left to teammates
        ("again_bits", "f8"),  # of a second scan, but for what is left to teammates
        ("seen", "i8"),  # voxels that count as seen
        ("unknown", "i8"),  # unknown ones of these
        ("distance", "f8"),  # sum over those seen, voxel edges
        ("slivers", "i8"),  # unknown voxels left beside them, one voxel thick
        ("unique", "f8"),  # sum over those seen of 1/n, with n the candidates that see the voxel
        ("announced_bits", "f8"),  # those in the announced view that it shares most with
    ],
)
"""What is expected to be seen from a candidate, or from the far place to which it leads."""

_WORTH = Values(0.0, HUGE)

EXPERIENCE = ranged_type(
    [
        ("candidates_rng", "u8", None, (1,)),  # random state of its candidates
        ("most_bits", "f8", _WORTH),  # most bits ever expected of a viewpoint
        ("decided_s", "f8", POSITIVE),  # when it last decided at a stop
        ("decided_bits", "f8", POSITIVE),  # what its own scans had brought by then
        ("exponent", "f8", _WORTH),  # c of bits / s^c, now
        ("going", "?", FLAG),  # whether it is on its way to a far place
        ("goal", "f8", GRID_POSE, (5,)),  # that far place
        ("far_value", "f8", _WORTH),  # what the best far place was worth when they were last evaluated
        ("looked_far", "?", FLAG),  # whether they ever were, with this exponent
        ("far_at", "f8", GRID_PLACE, (3,)),  # where the robot was then
        ("patience", "i8", SIGNED),  # decisions until far places are evaluated again on the same spot
        # where it stopped last, but for steps of less than a voxel edge
        ("stood_at", "f8", GRID_PLACE, (3,)),
        # in a row, taken there; once they are DEPLETED_SCANS, taken anywhere
        ("low_gain_scans", "i8", COUNT),
        ("blocked", "i8", COUNT),  # decisions during which it keeps clear of teammates
        ("edges", "i8", COUNT),  # drives that the end of the ground cut short
        # places just beyond it, the last of these drives
        ("edge_at", "f8", FAR_GRID_PLACE, (REMEMBERED_EDGES, 3)),
        ("failures", "i8", COUNT),  # number of viewpoints that failed, of which the last are kept
        ("failed", "f8", FAR_GRID_POSE, (REMEMBERED, 5)),  # viewpoints that did not bring what was expected
        # of the expected bits that came; 0 = not reached, 1 = forgotten
        ("share", "f8", Values(0.0, 1.0), (REMEMBERED,)),
        ("forget_at", "f8", POSITIVE, (REMEMBERED,)),  # distance from it at which it is forgotten
    ],
)
"""What a robot remembers from one decision to the next."""
