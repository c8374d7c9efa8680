"""States of the voxels of one robot's map, and which of them changed in an update.

A voxel is explored once its σ has fallen to a stated level. Voxels are known by number, C order.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from entropy_explore_env.belief.raycast import STOP_AT_COVERED
from entropy_explore_env.compilation.kernels import inlined_kernel, lean_kernel

UNEXPLORED = 1
"""σ is above the level that counts as explored now."""
UNMAPPED = 2
"""σ is above the first such level: no place to drive through."""
COVERED = 4
"""Believed covered: it stops rays and bodies."""
_TOGETHER = 128
"""Voxels that are compared together, by vector instructions, before single ones are."""


class VoxelStates(NamedTuple):
    """States of V voxels."""

    state: np.ndarray
    """(V,) uint8: UNEXPLORED, UNMAPPED, COVERED."""
    changed: np.ndarray
    """(N,) int32, the voxels that changed in the latest update come first: N is the most in one update."""
    opened: np.ndarray
    """(V + X·Y,) int32, the first `opened_count` are voxels past which more may be visible than before."""
    opened_count: np.ndarray
    """(1,) int64; set to 0 by the reader."""
    size: tuple[int, int, int]


def new_states(shape: tuple[int, int, int], at_once: int) -> VoxelStates:
    """Return the states of (X, Y, Z) voxels of which nothing is explored; `at_once` are updated at once."""
    voxels = math.prod(shape)
    return VoxelStates(
        state=np.full(voxels, UNEXPLORED | UNMAPPED, np.uint8),
        changed=np.zeros(min(voxels, at_once), np.int32),
        opened=np.zeros(voxels + shape[0] * shape[1], np.int32),
        opened_count=np.zeros(1, np.int64),
        size=(int(shape[0]), int(shape[1]), int(shape[2])),
    )


@inlined_kernel
def _state_of(mean, precision, levels):
    """Return the state of a voxel without branches: for many voxels at once."""
    unexplored, unmapped = np.uint8(precision < levels[0]), np.uint8(precision < levels[1])
    covered = np.uint8(mean > np.float32(STOP_AT_COVERED)) & ~unmapped
    return np.uint8(unexplored * UNEXPLORED | unmapped * UNMAPPED | covered * COVERED)


@inlined_kernel
def note_opened(states, voxel):
    """Note that more may be visible past a voxel than before."""
    states.opened[states.opened_count[0]] = voxel
    states.opened_count[0] += 1


@lean_kernel
def update_states(states, mean, precision, levels, begin, end):
    """Bring the states of the voxels from `begin` up to but without `end` up to date with a belief.

    Args:
        states: Of the robot.
        mean: (V,) float32.
        precision: (V,) float32 1/σ² > 0.
        levels: (explored, mapped): precisions from which on a voxel is explored, and mapped.
        begin: Number of the first voxel.
        end: One past the last; there are no more than `states.changed` holds.

    Returns:
        How many of them are in another state than at the latest update.
    """
    state, count = states.state, 0
    for first in range(begin, end, _TOGETHER):
        last, different = min(first + _TOGETHER, end), np.uint8(0)
        states_here, means, precisions = state[first:last], mean[first:last], precision[first:last]
        for place in range(last - first):
            different |= states_here[place] ^ _state_of(means[place], precisions[place], levels)
        if different == 0:
            continue
        for voxel in range(first, last):
            before, now = state[voxel], _state_of(mean[voxel], precision[voxel], levels)
            if now != before:
                state[voxel] = now
                states.changed[count] = voxel
                count += 1
                if before & COVERED > now & COVERED or before & UNEXPLORED < now & UNEXPLORED:
                    note_opened(states, voxel)
    return count
