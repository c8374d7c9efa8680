"""RochaMI's equations once more, slowly: plain Python, written from the paper, not from our code.

Beliefs are dictionaries voxel → (μ, σ); grid units (voxel edges); bits.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

from tests.reference import rocha04
from tests.reference.rocha04 import Belief, Vector, Voxel


class Cone(NamedTuple):
    """V(x, a, r, α) (eq. 2)."""

    apex: Vector
    yaw: float
    pitch: float
    radius: float
    half_angle: float


def inside(cone: Cone, voxel: Voxel) -> bool:
    """Whether a voxel's centre lies in a cone (eqs. 2 and 5)."""
    way = [index + 0.5 - at for index, at in zip(voxel, cone.apex, strict=True)]
    distance = math.hypot(*way)
    if distance > cone.radius:
        return False
    if distance == 0.0:
        return True
    cosine = sum(w * g for w, g in zip(way, rocha04.gaze(cone.yaw, cone.pitch), strict=True)) / distance
    return math.acos(max(-1.0, min(1.0, cosine))) <= cone.half_angle


def in_sight(cone: Cone, voxel: Voxel, beliefs: dict[Voxel, Belief], size: Voxel) -> bool:
    """Whether the line from the apex meets nothing covered before the voxel (not the one it starts in)."""
    way = [index + 0.5 - at for index, at in zip(voxel, cone.apex, strict=True)]
    length = math.hypot(*way)
    if length <= 1.0:
        return True
    pieces = rocha04.pieces_of(cone.apex, [w / length for w in way], size)
    between = [piece.voxel for piece in pieces[1:] if piece.entered < length and piece.voxel != voxel]
    return all(beliefs[crossed][0] <= 0.5 for crossed in between)


def visible(cone: Cone, beliefs: dict[Voxel, Belief], size: Voxel, occluded: bool = False) -> set[Voxel]:
    """Zⁱ (eq. 5), with or without what stands in the way."""
    return {
        voxel
        for voxel in beliefs
        if inside(cone, voxel) and (not occluded or in_sight(cone, voxel, beliefs, size))
    }


def voxel_bits(sigma: float, sigma_known: float) -> float:
    """A voxel's entropy above that of a known voxel, never negative: for H(C_l) of eq. 1."""
    return max(rocha04.entropy_bits(sigma) - rocha04.entropy_bits(sigma_known), 0.0)


def covered_bits(voxels: Iterable[Voxel], beliefs: dict[Voxel, Belief], sigma_known: float) -> float:
    """Σ H(C_l) over some voxels (eqs. 7 and 9)."""
    return math.fsum(voxel_bits(beliefs[voxel][1], sigma_known) for voxel in voxels)


def visibility_parameters(vectors: Iterable[Vector], yaw: float, pitch: float) -> tuple[float, float]:
    """r̂ and α̂ of a batch of measured vectors (eq. 4)."""
    lengths = [math.hypot(*vector) for vector in vectors]
    gaze = rocha04.gaze(yaw, pitch)
    cosines = [
        sum(v * g for v, g in zip(vector, gaze, strict=True)) / length
        for vector, length in zip(vectors, lengths, strict=True)
    ]
    return sum(lengths) / len(lengths), max(math.acos(max(-1.0, min(1.0, c))) for c in cosines)
