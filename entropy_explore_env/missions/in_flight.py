"""The messages of a mission that are under way, because they were delayed.

Where all messages arrive at once `InFlight` is None, and nothing of all this is compiled.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from entropy_explore_env.compilation.kernels import lean_kernel


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
