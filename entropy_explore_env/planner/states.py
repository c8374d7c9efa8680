"""The states of a planner, and the one transition between them."""

from __future__ import annotations

import enum

from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.planner.thresholds import DEPLETED_SCANS, NO_GAIN_BITS


class PlannerState(enum.IntEnum):
    """What a planner does at a decision."""

    EXPLORING = 0
    """It goes to the viewpoint that is worth most by the recipe's bits / s^c."""
    LEAVING = 1
    """What is left around it brings few bits a second: it goes by the plain rate, c = 1."""
    DEPLETED = 2
    """Many scans in a row had a low gain: it goes by the plain rate, evaluates other far places each time
    and takes viewpoints for failures sooner."""
    WANDERING = 3
    """Nothing is expected of any viewpoint, or a teammate is in the way: it goes to a random viewpoint."""


_EXPLORING, _LEAVING, _DEPLETED, _WANDERING = (int(state) for state in PlannerState)


@lean_kernel
def next_state(low_gain_scans, leaves, best_bits, gives_way):
    """Return the PlannerState that follows from what a robot knows so far.

    It is asked after a scan, when nothing has been evaluated yet (`best_bits` is inf), and again for what the
    planner would choose.

    Args:
        low_gain_scans: Scans in a row that had a low gain.
        leaves: Whether its last decision brought few bits a second.
        best_bits: Expected bits of the viewpoint that is worth most.
        gives_way: Whether it makes room for a teammate.
    """
    if gives_way or best_bits <= NO_GAIN_BITS:
        return _WANDERING
    if low_gain_scans >= DEPLETED_SCANS:
        return _DEPLETED
    return _LEAVING if leaves else _EXPLORING
