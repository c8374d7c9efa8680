"""Sujan & Meggiolaro's equations, straight from the paper: voxel by voxel, slow and plain."""

from __future__ import annotations

import itertools
import math

import numpy as np

from tests.reference import rocha04

LEVELS = 20


def voxels_in_view(mean, start, yaw, pitch, yaws, pitches, reach):
    """The voxels that rays around a gaze cross before, and the one at which, something covered stops them."""
    seen = set()
    for a in yaws:
        for b in pitches:
            direction = rocha04.gaze(yaw + a, pitch + b)
            ray = rocha04.trace(lambda v: mean[v] > 0.5, start, direction, mean.shape, reach, 1)
            seen.update(ray.voxels)
    return seen


def new_information(occupancies, interests, most):
    """Eq. 8, of the occupancies in view of one kind."""
    bits = 0.0
    for level in range(LEVELS):
        n = sum(
            w
            for p, w in zip(occupancies, interests, strict=True)
            if min(int(p * LEVELS), LEVELS - 1) == level
        )
        q, p_k = min(n / most, 1.0), (level + 0.5) / LEVELS
        if q > 0.0:
            uncertainty = -(p_k * math.log2(p_k) + (1.0 - p_k) * math.log2(1.0 - p_k))
            bits -= uncertainty * q * math.log2(q)
    return bits


def interest(before, visibility, beta):
    """Eq. 9."""
    return before / math.exp(beta * visibility)


def neighbours_mean(occupancy, known):
    """Occupancies of a plan with each unknown cell the mean of its neighbours, by a dense linear system."""
    x, y = occupancy.shape
    matrix, right = np.eye(x * y), np.where(known, occupancy, 0.0).ravel()
    for i, j in zip(*np.nonzero(~known), strict=True):
        near = [(i - 1, j), (i + 1, j), (i, j - 1), (i, j + 1)]
        near = [(a, b) for a, b in near if 0 <= a < x and 0 <= b < y]
        for a, b in near:
            matrix[i * y + j, a * y + b] -= 1.0 / len(near)
    return np.linalg.solve(matrix, right).reshape(x, y)


def visibility(height, sigma, camera, x, y):
    """Eq. 5 with its integral up to |ray_z - Ob_z|: of every column on the line, in the middle of its way."""
    target = np.array([x + 0.5, y + 0.5, height[x, y]])
    way = np.array(camera) - target
    shares = {0.0, 1.0}
    for axis in (0, 1):
        low, high = sorted((target[axis], camera[axis]))
        shares |= {(cut - target[axis]) / way[axis] for cut in range(math.ceil(low), math.floor(high) + 1)}
    cuts, seen = sorted(shares), 1.0
    for begin, end in list(itertools.pairwise(cuts))[1:-1]:
        place = target + 0.5 * (begin + end) * way
        above = (place[2] - height[int(place[0]), int(place[1])]) / sigma[int(place[0]), int(place[1])]
        seen *= 0.5 + math.copysign(0.5 * math.erf(abs(above) / math.sqrt(2.0)), above)
    return seen


def elevation_information(height, sigma, measurements, interest, most, pose, view, reach):
    """Eq. 3 with the entropy of P_V/2 in its braces, each column weighed by the interest in it."""
    bits = 0.0
    for x, y in np.ndindex(*height.shape):
        away = np.array([x + 0.5 - pose[0], y + 0.5 - pose[1], height[x, y] - pose[2]])
        turned = (math.atan2(away[1], away[0]) - pose[3] + math.pi) % (2.0 * math.pi) - math.pi
        down = math.atan2(-away[2], math.hypot(away[0], away[1]))
        if np.linalg.norm(away) > reach or abs(turned) > view[0] / 2 or abs(down - pose[4]) > view[1] / 2:
            continue
        p = 0.5 * visibility(height, sigma, pose[:3], x, y)
        new = max(most - measurements[x, y], 0.0) / most
        bits += (
            interest[x, y] * new * -(p * math.log2(p) + (1.0 - p) * math.log2(1.0 - p)) if p > 0.0 else 0.0
        )
    return bits
