"""Sujan & Meggiolaro's equations, straight from the paper: voxel by voxel, slow and plain."""

from __future__ import annotations

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


def stretched(p, distance_m):
    """Eq. 7, within [0, 1], from a metre on."""
    if p < 0.5:
        out = (1.0 / (1.0 - p) / max(distance_m, 1.0) - 1.0) / 2.0
    else:
        out = 1.0 - (1.0 / p / max(distance_m, 1.0) - 1.0) / 2.0
    return min(max(out, 0.0), 1.0)


def new_information(occupancies, interests, most, weighed):
    """Eq. 8, or eq. 6 with the sign that its second sum has lost, of the occupancies in view of one kind."""
    bits = 0.0
    for level in range(LEVELS):
        n = sum(
            w
            for p, w in zip(occupancies, interests, strict=True)
            if min(int(p * LEVELS), LEVELS - 1) == level
        )
        q, p_k = min(n / most, 1.0), (level + 0.5) / LEVELS
        if q > 0.0:
            uncertainty = -(p_k * math.log2(p_k) + (1.0 - p_k) * math.log2(1.0 - p_k)) if weighed else 1.0
            bits -= uncertainty * q * math.log2(q)
    return bits


def interest(before, visibility, beta):
    """Eq. 9."""
    return before / math.exp(beta * visibility)


def rating(information, pose, viewpoint, weight, occupancy):
    """Eqs. 22 and 23 with w_NI = 1, α = 1 and LE = 0."""
    turned = (viewpoint[3] - pose[3] + math.pi) % (2.0 * math.pi) - math.pi
    squares = [(viewpoint[i] - pose[i]) ** 2 for i in (0, 1, 2, 4)]
    return (information - weight * math.sqrt(sum(squares) + turned**2)) * (1.0 - occupancy)


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
