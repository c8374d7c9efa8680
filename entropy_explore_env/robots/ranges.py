"""Structured types whose fields say which values they hold in a mission, so that other ones are refused.

Kernels take a state as it is: a count that is too large leads them beyond their arrays, and NaN in it leads
to NaN in observations. The ranges prevent that; they do not prove that a mission came there.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from entropy_explore_env.compilation.kernels import record_type

MOST = 1e15
"""Of seconds, metres, bits and counts: more than any mission comes to, and exact in a float64."""
HUGE = 1e300
LARGEST_COVARIANCE = 1e60
"""In m² and rad²: more than drifts come to, and its square is a float64."""
LARGEST_PRECISION = 1e37
ROUNDING = 1e-6
TURN = 4.0 * math.pi
"""Yaw and pitch may go beyond a turn while a robot turns."""


class Values(NamedTuple):
    """A range; a text is the name of a bound that depends on scenario and clock: `missions.state_ranges`."""

    least: float | str
    most: float | str
    also: float | None = None
    """Another number that is allowed."""


FLAG = Values(0, 1)
COUNT = Values(0, MOST)
POSITIVE = Values(0.0, MOST)
SIGNED = Values(-MOST, MOST)
SHARE = Values(-ROUNDING, 1.0 + ROUNDING)
ANGLE = Values(-TURN, TURN)
SPREAD = Values(-LARGEST_COVARIANCE, LARGEST_COVARIANCE)
PAST = Values(0.0, "time_s")
PAST_OR_NEVER = Values(0.0, "time_s", -1.0)
PLACE = Values("place_low", "place_high")
PLACE_OR_ZERO = Values("zero_place_low", "zero_place_high")
"""Of records that are not always in use: free ones hold zeros, wherever the workspace is."""
POSE = Values("pose_low", "pose_high")
FAR_PLACE = Values("far_place_low", "far_place_high")
"""No farther beyond the workspace than a viewpoint may be; zeros are allowed, too."""
FAR_POSE = Values("far_pose_low", "far_pose_high")
GRID_PLACE = Values("grid_place_low", "grid_place_high")
"""In grid units."""
GRID_POSE = Values("grid_pose_low", "grid_pose_high")
FAR_GRID_PLACE = Values("far_grid_place_low", "far_grid_place_high")
FAR_GRID_POSE = Values("far_grid_pose_low", "far_grid_pose_high")

_RANGES: dict[np.dtype[Any], dict[str, Values]] = {}


def ranged_type(fields: list[tuple[Any, ...]]) -> np.dtype[Any]:
    """Make a structured type, as `record_type` does, each field of which knows its range.

    Args:
        fields: (name, type, range) of each field, or (name, type, range, shape); no range where every number
            of the type is allowed.
    """
    kind = record_type([(name, number, *shape) for name, number, _, *shape in fields])
    _RANGES[kind] = {name: values for name, _, values, *_ in fields if values is not None}
    return kind


def ranges_of(kind: np.dtype[Any]) -> dict[str, Values]:
    """Return the range of each field of a type that `ranged_type` made."""
    return _RANGES[kind]
