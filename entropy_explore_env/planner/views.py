"""What candidates should see: which voxels, with which other candidates, and what they leave beside."""

from __future__ import annotations

import math

import numpy as np

from entropy_explore_env.belief.raycast import STOP_AT_COVERED
from entropy_explore_env.belief.visibility import in_cone
from entropy_explore_env.belief.voxel_index import grid_index
from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.planner.candidate_features import SEEN_BITS
from entropy_explore_env.viewpoints.expected_scan import imagine_scan

_SEEN_RATIO = 2.0 ** (2.0 * SEEN_BITS) - 1.0
"""Precision added to a voxel, as a share of its precision, that brings SEEN_BITS."""
_FOLD_ABOVE = 1e250
"""A product of ratios is folded into bits, by its logarithm, before it could leave a float64."""
_ONE = np.uint64(1)


@lean_kernel
def look_from(proposer, situation, at, number, most_common):
    """Find out what a scan from a viewpoint (5,) should see, VIEW `number`, and compare it with those before.

    Returns:
        Whether it sees something other than each of them: no more than the share `most_common` of the
        voxels of either in common.
    """
    scratch = proposer.scratch
    touched = imagine_scan(situation.belief, proposer.refined, at, scratch.scan)
    view = scratch.views[number]
    _gather(proposer, situation, at, touched, view)
    _count_common(scratch, number)
    common = scratch.common[number]
    for other in range(number):
        fewer = min(view.seen, scratch.views[other].seen)
        if common[other] > most_common * fewer:
            return False
    return True


@lean_kernel
def _read_batch(scratch, voxels, begin, end):
    """Copy the marks of some voxels into one array, for vectorized sums, and return how many there are."""
    count = min(len(scratch.batch), end - begin)
    for i in range(count):
        scratch.batch[i] = scratch.marks[voxels[begin + i]]
    return count


@lean_kernel
def _count_common(scratch, number):
    """Count the voxels that candidate `number`, which is not marked yet, and each one before it both see."""
    seen, common, batch = scratch.views[number].seen, scratch.common[number], scratch.batch
    for other in range(number + 1):
        common[other] = 0
    for begin in range(0, seen, len(batch)):
        count = _read_batch(scratch, scratch.scan.touched, begin, seen)
        for other in range(number):
            bit, total = np.uint64(other), np.uint64(0)
            for i in range(count):
                total += (batch[i] >> bit) & _ONE
            common[other] += np.int64(total)


@lean_kernel
def _gather(proposer, situation, at, touched, view):
    """Sum up what an imagined scan adds, and clear it; voxels that count as seen come first in `touched`."""
    scan, belief, cones = proposer.scratch.scan, situation.belief, situation.cones
    cone_bits = proposer.scratch.cone_bits
    bits, all_bits, twice_bits = 0.0, 0.0, 0.0
    growth, all_growth, twice_growth = 1.0, 1.0, 1.0
    seen, unknown, distance = 0, 0, 0.0
    for mate in range(len(cones)):
        cone_bits[mate] = 0.0
    for i in range(touched):
        voxel = scan.touched[i]
        precision = np.float64(belief.precision[voxel])
        share = np.float64(scan.added[voxel]) / precision
        scan.added[voxel] = 0.0
        x, y, z = grid_index(belief.size, voxel)
        left = scan.left[voxel] != 0
        if left:
            for mate in range(len(cones)):
                cone = cones[mate]
                if in_cone(cone, x + 0.5 - cone.apex[0], y + 0.5 - cone.apex[1], z + 0.5 - cone.apex[2]):
                    cone_bits[mate] += 0.5 * math.log2(1.0 + share)
        all_growth *= 1.0 + share
        growth *= 1.0 if left else 1.0 + share
        twice_growth *= 1.0 if left else 1.0 + 2.0 * share
        if all_growth > _FOLD_ABOVE or twice_growth > _FOLD_ABOVE:
            bits, all_bits = bits + math.log2(growth), all_bits + math.log2(all_growth)
            twice_bits += math.log2(twice_growth)
            growth, all_growth, twice_growth = 1.0, 1.0, 1.0
        if share >= _SEEN_RATIO:
            dx, dy, dz = x + 0.5 - at[0], y + 0.5 - at[1], z + 0.5 - at[2]
            scan.touched[seen] = voxel
            seen += 1
            unknown += int(precision < proposer.refined.known_precision)
            distance += math.sqrt(dx * dx + dy * dy + dz * dz)
    view.bits = 0.5 * (bits + math.log2(growth))
    view.all_bits = 0.5 * (all_bits + math.log2(all_growth))
    view.again_bits = 0.5 * (twice_bits + math.log2(twice_growth)) - view.bits
    view.seen, view.unknown, view.distance = seen, unknown, distance
    view.slivers, view.unique, view.announced_bits = 0, 0.0, 0.0
    for mate in range(len(cones)):
        view.announced_bits = max(view.announced_bits, cone_bits[mate])


@lean_kernel
def mark_view(proposer, belief, number, marked):
    """Mark the voxels that a candidate sees, as `look_from` left them, and count slivers beside them.

    Returns:
        How many voxels are in `scratch.seen` then; there were `marked`.
    """
    scratch, bit = proposer.scratch, _ONE << np.uint64(number)
    marks, touched, view = scratch.marks, scratch.scan.touched, scratch.views[number]
    for i in range(view.seen):
        voxel = touched[i]
        if marks[voxel] == 0:
            scratch.seen[marked] = voxel
            marked += 1
        marks[voxel] |= bit
    slivers, known = 0, proposer.refined.known_precision
    for i in range(view.seen):
        if belief.precision[touched[i]] < known:
            slivers += _slivers_beside(belief, touched[i], known, marks, bit)
    view.slivers = slivers
    return marked


@lean_kernel
def _is_left(belief, voxel, known, marks, bit):
    """Return whether a voxel is unknown and stays so: not seen by the candidate."""
    if marks[voxel] & bit:
        return False
    return belief.precision[voxel] < known and belief.mean[voxel] <= STOP_AT_COVERED


@lean_kernel
def _slivers_beside(belief, voxel, known, marks, bit):
    """Return how many of a voxel's six neighbours are left unknown though what lies behind each is not."""
    at, count, stride = grid_index(belief.size, voxel), 0, 1
    for axis in (2, 1, 0):
        for step in (-1, 1):
            room = at[axis] if step < 0 else belief.size[axis] - 1 - at[axis]
            if room < 1 or not _is_left(belief, voxel + step * stride, known, marks, bit):
                continue
            if room < 2 or not _is_left(belief, voxel + 2 * step * stride, known, marks, bit):
                count += 1
        stride *= belief.size[axis]
    return count


@lean_kernel
def clear_marks(proposer, count, marked):
    """Sum up how unique the views of `count` candidates are, and clear the marks of the voxels seen."""
    scratch = proposer.scratch
    batch, unique = scratch.batch, scratch.unique
    for number in range(count):
        unique[number] = 0.0
    for begin in range(0, marked, len(batch)):
        for i in range(_read_batch(scratch, scratch.seen, begin, marked)):
            seen_by = np.uint64(0)
            for number in range(count):
                seen_by += (batch[i] >> np.uint64(number)) & _ONE
            share = 1.0 / np.float64(seen_by)
            for number in range(count):
                unique[number] += share * np.float64((batch[i] >> np.uint64(number)) & _ONE)
    for number in range(count):
        scratch.views[number].unique = unique[number]
    for i in range(marked):
        scratch.marks[scratch.seen[i]] = 0
