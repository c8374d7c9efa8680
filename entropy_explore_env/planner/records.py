"""What is kept of a robot's candidates from one decision to the next, as plain arrays."""

from __future__ import annotations

import enum

from entropy_explore_env.compilation.kernels import record_type
from entropy_explore_env.planner.thresholds import EDGES, REMEMBERED


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


CANDIDATE = record_type(
    [
        ("viewpoint", "f8", (5,)),  # map frame: x, y, z, yaw, pitch; of those that are none, the first one's
        ("goal", "f8", (5,)),  # grid units: the far viewpoint to which it leads; else itself
        ("bits", "f8"),  # that a scan at the viewpoint should bring
        ("kind", "i8"),  # a Kind
    ],
)
"""A viewpoint that is proposed to a robot."""

EXPERIENCE = record_type(
    [
        ("candidates_rng", "u8", (1,)),  # random state of its candidates
        ("most_bits", "f8"),  # most bits ever expected of a viewpoint
        ("decided_s", "f8"),  # when it last decided at a stop
        ("decided_bits", "f8"),  # what its own scans had brought by then
        ("exponent", "f8"),  # c of bits / s^c, now
        ("best_rate", "f8"),  # most bits per second of a candidate
        ("going", "?"),  # whether it is on its way to a far place
        ("goal", "f8", (5,)),  # which one
        ("far_value", "f8"),  # what the best far place was worth when they were last looked at
        ("looked_far", "?"),  # whether that ever was
        ("far_at", "f8", (3,)),  # where the robot was then
        ("patience", "i8"),  # decisions until far places are looked at again on the same spot
        ("stood_at", "f8", (3,)),  # where it stopped last, but for steps of less than a voxel edge
        ("poor_scans", "i8"),  # poor scans in a row that it took there; once many, anywhere
        ("blocked", "i8"),  # decisions during which it keeps clear of teammates
        ("was_free", "?"),  # whether it ever was where a path led anywhere
        ("free_at", "f8", (3,)),  # where that was last
        ("edges", "i8"),  # drives that the end of the ground cut short
        ("edge_at", "f8", (EDGES, 3)),  # places just beyond it, the last of these drives
        ("failures", "i8"),  # how many of these are in use
        ("failed", "f8", (REMEMBERED, 5)),  # viewpoints that did not bring what was expected
        ("share", "f8", (REMEMBERED,)),  # of the expected bits that came; 0 = it was not reached
        ("forget_at", "f8", (REMEMBERED,)),  # distance from it at which it is forgotten, voxel edges
    ],
)
"""What a robot remembers; places and viewpoints in grid units."""
