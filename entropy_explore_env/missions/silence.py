"""When a teammate that was heard counts as silent: what it announced is free for others then."""

from __future__ import annotations

import math

from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.robots.motion import driving_time

SILENT_AFTER_S = 10.0
"""A teammate is silent if it is unheard for longer than this, beyond what one decision of it may take."""
_DETOURS = 2.0
"""Times of the straight drive that a drive may take."""


def is_silent(params, heard, time_s):
    """Return whether a teammate that was heard counts as silent.

    Until it must be heard again it may drive, for twice the time of the straight drive to the viewpoint that
    it announced, turn half round, scan, and wait behind a teammate; its message may wait for the end of a
    phase, or for the time between summaries, and be delayed or late.
    """
    unheard_s = time_s - heard["heard_s"]
    if heard["heard_s"] < 0.0 or unheard_s <= SILENT_AFTER_S:
        return False
    drive_m = 0.0
    if heard["announced_s"] >= 0.0:
        there, was = heard["announced"], heard["pose"]
        drive_m = math.sqrt((there[0] - was[0]) ** 2 + (there[1] - was[1]) ** 2 + (there[2] - was[2]) ** 2)
    drive_s = _DETOURS * driving_time(drive_m, params["max_speed_m_s"], params["acceleration_m_s2"])
    stands_s = math.pi / params["turn_rate_rad_s"] + params["scan_time_s"] + params["blocked_wait_s"]
    message_s = params["phase_s"] + params["summary_every_s"] + params["longest_delay_s"]
    return unheard_s > SILENT_AFTER_S + drive_s + stands_s + message_s


silent_since = lean_kernel(is_silent)
"""The same for kernels."""
