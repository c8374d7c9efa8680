"""What robots measured themselves since their latest summary: the maps that they will send next.

Nothing that a teammate sent is in them, and nothing that was sent before, so that no measurement comes to a
teammate twice. Where robots send no summaries `TeamSummaries` is None, and nothing of all this is compiled.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from entropy_explore_env.belief.map_update import gather_ray
from entropy_explore_env.belief.measurement_model import Return
from entropy_explore_env.belief.voxel_index import grid_index
from entropy_explore_env.compilation.kernels import inlined_kernel, lean_kernel
from entropy_explore_env.robots.map_tree import Tree

_NOTHING = int(Return.NOTHING)


class TeamSummaries(NamedTuple):
    """What one mission's robots have for summaries: slices of MissionState, and scratch memory."""

    mean: np.ndarray
    """(A, V) float32, of their own maps."""
    precision: np.ndarray
    """(A, V) float32, likewise; 0 = not measured since the latest summary."""
    states: np.ndarray
    """(A,) SUMMARY."""
    parcels: np.ndarray
    """(Q,) PARCEL, of the delayed messages."""
    contents: np.ndarray
    """(A·K, M) uint8, the summaries that they carry."""
    tree: Tree
    """Scratch memory; its data are the summary that is sent or heard."""


@lean_kernel
def summaries_of(tree, state, mission):
    """Return the TeamSummaries of a mission; None where robots send no summaries."""
    if tree is None:  # known while compiling: nothing of the rest is compiled
        return None
    return TeamSummaries(
        state.own_mean[mission],
        state.own_precision[mission],
        state.summaries[mission],
        state.in_flight_parcels[mission],
        state.in_flight_summaries[mission],
        tree,
    )


@lean_kernel
def note_measured(summaries, index, scan, size):
    """Fuse a robot's scan, as it takes it for, into its own map.

    Args:
        scan: Scan with crossings and precisions filled in.
    """
    if summaries is None:  # known while compiling: nothing of the rest is compiled
        return
    mean, precision = summaries.mean[index], summaries.precision[index]
    state = summaries.states[index]
    for number in range(len(scan.rays)):
        ray, crossed = scan.rays[number], scan.crossed[number]
        if ray.returned != _NOTHING and ray.voxels > 0:
            gather_ray(mean, precision, crossed, scan.coverage[number], ray.free, ray.voxels, ray.precision)
            widen(state, np.int64(crossed[0]), size)
            widen(state, np.int64(crossed[ray.voxels - 1]), size)


@inlined_kernel
def widen(state, voxel, size):
    """Widen the box of a SUMMARY by a voxel. A ray is straight: its ends are enough."""
    place = grid_index(size, voxel)
    empty = state.high[0] == 0
    for axis in range(3):
        if empty or place[axis] < state.low[axis]:
            state.low[axis] = place[axis]
        if empty or place[axis] >= state.high[axis]:
            state.high[axis] = place[axis] + 1


@lean_kernel
def forget_measured(summaries, index, size, time_s):
    """Empty a robot's own map: its summary is sent now."""
    state, mean, precision = summaries.states[index], summaries.mean[index], summaries.precision[index]
    for i in range(state.low[0], state.high[0]):
        for j in range(state.low[1], state.high[1]):
            row = (i * size[1] + j) * size[2]
            for voxel in range(row + state.low[2], row + state.high[2]):
                mean[voxel], precision[voxel] = np.float32(0.0), np.float32(0.0)
    for axis in range(3):
        state.low[axis] = state.high[axis] = 0
    state.sent_s = time_s
    state.sent += 1
