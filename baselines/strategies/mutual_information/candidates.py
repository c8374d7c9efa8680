"""Candidate viewpoints of RochaMI's eq. 13, and the best of them: what `mutual-information` compiles.

Grid units; N_Γ(x, r) is what `steep_voxels` finds. The strategies and their
settings are in the package's `__init__`.
"""

from __future__ import annotations

import math

import numpy as np

from entropy_explore_env.belief.raycast import STOP_AT_COVERED, cast_ray
from entropy_explore_env.belief.visibility import in_cone, visible_bits
from entropy_explore_env.compilation.kernels import inlined_kernel, lean_kernel
from entropy_explore_env.robots.motion import line_believed_blocked, way_to_teammate

CANDIDATE = np.dtype(
    [
        ("place", "f8", (3,)),  # the voxel's centre, grid units; planar robots: at their sensor's height
        ("yaw", "f8"),
        ("pitch", "f8"),
        ("steepness", "f8"),  # ‖∇H‖, bits per voxel edge
        ("distance", "f8"),  # from the robot, grid units
    ],
    align=True,
)
"""A voxel to go to, and the gaze there."""
MATE = np.dtype([("begin", "f8", (3,)), ("end", "f8", (3,)), ("touching", "f8")], align=True)
"""Where a teammate was heard to be, and is heard to go to: grid units; `touching`: sum of the two radii."""
FACTORS = np.dtype(
    [
        ("distance_cost", "f8"),  # κ
        ("scale_bits", "f8"),  # ξ of eq. 12; inf = λ is 1
        ("interference", "f8"),  # η for each teammate in view
        ("static_reach", "?"),  # whether ρ heeds what is believed covered
        ("known_precision", "f8"),  # 1/σ² of a voxel that counts as known
    ],
    align=True,
)
"""How candidates are weighed."""
_TOLERANCE = 1e-6


@inlined_kernel
def _bits(precision, known_precision):
    """H(C_l) of a voxel."""
    return 0.5 * math.log2(max(known_precision / precision, 1.0))


@lean_kernel
def steep_voxels(precision, known_precision, position, radius, layer, candidates):
    """Find the voxels within a radius that have a gradient: N_Γ(x, r) of RochaMI.

    The gradient is the backward difference of Rocha04's eq. 30, of the entropy that is never negative; for
    planar robots of its projection on their layer.

    Args:
        precision: (X, Y, Z) float32 1/σ².
        known_precision: Of a voxel that counts as known.
        position: (3,) of the robot, grid units.
        radius: r̂ in grid units.
        layer: The layer of a planar robot; -1 = it flies.
        candidates: (K,) CANDIDATE, filled in.

    Returns:
        How many there are.
    """
    count, reach = 0, radius * (1.0 + _TOLERANCE)
    size = precision.shape
    first_k = max(math.floor(position[2] - reach), 0) if layer < 0 else layer
    last_k = min(math.floor(position[2] + reach) + 1, size[2]) if layer < 0 else layer + 1
    for i in range(
        max(math.floor(position[0] - reach), 0), min(math.floor(position[0] + reach) + 1, size[0])
    ):
        for j in range(
            max(math.floor(position[1] - reach), 0), min(math.floor(position[1] + reach) + 1, size[1])
        ):
            for k in range(first_k, last_k):
                z = position[2] if layer >= 0 else k + 0.5
                dx, dy, dz = i + 0.5 - position[0], j + 0.5 - position[1], z - position[2]
                squared = dx * dx + dy * dy + dz * dz
                if squared > reach * reach:
                    continue
                here = _bits(precision[i, j, k], known_precision)
                x = here - _bits(precision[i - 1, j, k], known_precision) if i > 0 else 0.0
                y = here - _bits(precision[i, j - 1, k], known_precision) if j > 0 else 0.0
                climbs = layer < 0 and k > 0
                up = here - _bits(precision[i, j, k - 1], known_precision) if climbs else 0.0
                steepness = math.sqrt(x * x + y * y + up * up)
                if steepness <= 0.0:
                    continue
                candidate = candidates[count]
                candidate.place[0], candidate.place[1], candidate.place[2] = i + 0.5, j + 0.5, z
                candidate.yaw = math.atan2(y, x)
                candidate.pitch = -math.asin(min(max(up / steepness, -1.0), 1.0))
                candidate.steepness, candidate.distance = steepness, math.sqrt(squared)
                count += 1
    return count


@lean_kernel
def fits(mean, size, ball, place):
    """Whether a body touches nothing believed covered, nor the boundary."""
    for offset in ball:
        i, j, k = int(place[0]) + offset[0], int(place[1]) + offset[1], int(place[2]) + offset[2]
        if not (0 <= i < size[0] and 0 <= j < size[1] and 0 <= k < size[2]):
            return False
        if mean[(i * size[1] + j) * size[2] + k] > STOP_AT_COVERED:
            return False
    return True


@lean_kernel
def reachability(mean, size, ball, radius, begin, end, space):
    """ρ by the belief: 1 - max μ of the voxels on the straight line; 0 where the body would touch something.

    The voxel at its end does not count, so that an unknown voxel is as good as a known one before it: the
    backward difference finds a frontier in the one or the other, depending on where it lies.

    Args:
        mean: (V,) float32 expected coverage.
        size: (X, Y, Z) voxels.
        ball: (B, 3) int64, voxels that the body touches.
        radius: Of the body.
        begin: (x, y, z).
        end: (x, y, z).
        space: What `cast_ray` needs.
    """
    crossed, entered = space
    x, y, z = end[0] - begin[0], end[1] - begin[1], end[2] - begin[2]
    length = math.sqrt(x * x + y * y + z * z)
    if length <= 0.0:
        return 1.0
    if not fits(mean, size, ball, end):
        return 0.0
    if line_believed_blocked(mean, size, ball, radius, begin, end, crossed, entered):
        return 0.0
    direction = (x / length, y / length, z / length)
    _, n, _ = cast_ray(mean, STOP_AT_COVERED, size, begin, direction, length, False, 0, crossed, entered)
    covered = 0.0
    for step in range(1, n - 1):
        covered = max(covered, mean[crossed[step]])
    return 1.0 - covered


@inlined_kernel
def _teammates(heard, begin, end, length):
    """Whether a teammate stands or drives on a straight way."""
    if length <= 0.0:
        return False
    direction = ((end[0] - begin[0]) / length, (end[1] - begin[1]) / length, (end[2] - begin[2]) / length)
    for mate in heard:
        if mate.touching > 0.0:
            frm, to = (mate.begin[0], mate.begin[1], mate.begin[2]), (mate.end[0], mate.end[1], mate.end[2])
            if way_to_teammate(begin, direction, length, frm, to, mate.touching) < length:
                return True
    return False


@lean_kernel
def best_candidate(candidates, ranked, belief, body, heard, cone, sight, marks, space, factors):
    """The candidate with the greatest value of eq. 13, of those that are worth anything.

    Candidates come in the order of what they would be worth if λ = ρ = η = 1: the first one that is not
    better than the best so far ends the search, so that λ is worked out for few of them.

    Args:
        candidates: (K,) CANDIDATE.
        ranked: (K,) int64, their order.
        belief: (mean, precision, size): (V,) float32 twice, and (X, Y, Z).
        body: (position, radius of the neighbourhood, body radius, ball) in grid units.
        heard: (M,) MATE.
        cone: A CONE with r̂ and α̂; its place and gaze are overwritten.
        sight: See belief/visibility.py.
        marks: (V,) uint8, what the teammates' cones cover.
        space: What `cast_ray` needs.
        factors: A FACTORS.

    Returns:
        Its number; -1 if none is worth anything.
    """
    mean, precision, size = belief
    position, radius, body_radius, ball = body
    begin = (position[0], position[1], position[2])
    steepest, best, found = 0.0, -math.inf, -1
    for candidate in candidates:
        steepest = max(steepest, candidate.steepness)
    for number in ranked:
        candidate = candidates[number]
        cost = factors.distance_cost * candidate.distance / radius
        worth = candidate.steepness / steepest
        if worth - cost <= best:
            break
        end = (candidate.place[0], candidate.place[1], candidate.place[2])
        if factors.static_reach:
            worth *= reachability(mean, size, ball, body_radius, begin, end, space)
        if worth <= 0.0 or worth - cost <= best:
            continue
        if len(heard) > 0:
            if _teammates(heard, begin, end, candidate.distance):
                continue
            _look(cone, candidate)
            for mate in heard:
                if _in_view(cone, mate):
                    worth *= factors.interference
            if worth - cost <= best:
                continue
            if not math.isinf(factors.scale_bits):
                _, shared = visible_bits(cone, size, precision, factors.known_precision, sight, marks)
                worth *= math.exp(-shared / factors.scale_bits)
        if worth - cost > best and worth > 0.0:
            best, found = worth - cost, number
    return found


@inlined_kernel
def _look(cone, candidate):
    """Put the cone where the candidate is, along its gaze."""
    level = math.cos(candidate.pitch)
    cone.gaze[0], cone.gaze[1] = math.cos(candidate.yaw) * level, math.sin(candidate.yaw) * level
    cone.gaze[2] = -math.sin(candidate.pitch)
    for axis in range(3):
        cone.apex[axis] = candidate.place[axis]


@inlined_kernel
def _in_view(cone, mate):
    """Whether a teammate stands, or will stand, in a cone."""
    x, y, z = mate.end[0] - cone.apex[0], mate.end[1] - cone.apex[1], mate.end[2] - cone.apex[2]
    return in_cone(cone, x, y, z)
