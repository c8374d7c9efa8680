"""Faults that cannot change what the code does, each with the reason: no test could find them."""

from __future__ import annotations

from typing import NamedTuple


class Equivalent(NamedTuple):
    """One fault."""

    path: str
    """Of the source, from the root of the checkout."""
    function: str
    what: str
    """The statement as it is, and with the fault."""
    reason: str
    """Why both do the same."""


_MISSIONS, _ROBOTS = "entropy_explore_env/missions", "entropy_explore_env/robots"
EQUIVALENT = (
    Equivalent(
        f"{_MISSIONS}/faults.py",
        "next_stop",
        "soonest, soonest_s = (0, math.inf)  ->  soonest, soonest_s = (1, math.inf)",
        "Where the time stays inf no robot stops, and its number is not read.",
    ),
    Equivalent(
        f"{_MISSIONS}/messages.py",
        "next_message",
        "soonest, due_s = (0, math.inf)  ->  soonest, due_s = (1, math.inf)",
        "Where the time stays inf no message is due, and its slot is not read.",
    ),
    Equivalent(
        f"{_MISSIONS}/poses.py",
        "pose_at",
        "shortest = (goal[3] - origin[3] + math.pi) % (2.0 * math.pi) - math.pi  ->  "
        "shortest = (goal[3] - origin[3] - math.pi) % (2.0 * math.pi) - math.pi",
        "Both differ by a whole turn, which the remainder takes away.",
    ),
    Equivalent(
        f"{_MISSIONS}/scoring.py",
        "holds_enough",
        "free += int(truth[voxel] <= 0.5)  ->  free += int(truth[voxel] < 0.5)",
        "No voxel of the truth is half solid.",
    ),
    Equivalent(
        f"{_ROBOTS}/motion.py",
        "time_after",
        "if since_rest_m < 0.0:  ->  if since_rest_m <= 0.0:",
        "Both formulas give the same time at rest.",
    ),
    Equivalent(
        f"{_ROBOTS}/pose_covariance.py",
        "in_field_of_view",
        "return within_half_view(params, turn, down - pitch) or within_half_view(params, turn + math.pi, "
        "math.pi - down - pitch)  ->  return within_half_view(params, turn, down - pitch) or "
        "within_half_view(params, turn - math.pi, math.pi - down - pitch)",
        "Both differ by a whole turn, which `within_half_view` takes away.",
    ),
)
