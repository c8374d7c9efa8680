"""The part `drive`: the robot's speed and the viewpoint that it chose last, which it may keep or change."""

from __future__ import annotations

from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.missions.observation.team import write_relative

DRIVE_VALUES = 8


@lean_kernel
def observe_drive(begin, params, known, row):
    """Fill (8,): speed as a share of the top speed, and the viewpoint that the robot chose last."""
    if begin is None:  # known while compiling: nothing of the rest is compiled
        return
    out = row[begin:]
    out[0] = min(known.speed_m_s / params.max_speed_m_s, 1.0)
    write_relative(params, known.pose, known.target, out[1:])
