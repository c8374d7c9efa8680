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


def visible(cone: Cone, beliefs: dict[Voxel, Belief]) -> set[Voxel]:
    """Zⁱ (eq. 5); obstacles hide nothing."""
    return {voxel for voxel in beliefs if inside(cone, voxel)}


def voxel_bits(sigma: float, sigma_known: float) -> float:
    """A voxel's entropy above that of a known voxel, never negative: for H(C_l) of eq. 1."""
    return max(rocha04.entropy_bits(sigma) - rocha04.entropy_bits(sigma_known), 0.0)


def covered_bits(voxels: Iterable[Voxel], beliefs: dict[Voxel, Belief], sigma_known: float) -> float:
    """Σ H(C_l) over some voxels (eqs. 7 and 9)."""
    return math.fsum(voxel_bits(beliefs[voxel][1], sigma_known) for voxel in voxels)


# --- The strategy (eqs. 11-13)


class Mate(NamedTuple):
    """What was heard of a teammate: where it was, where it goes, what it will see from there."""

    begin: Vector
    end: Vector
    cone: Cone | None


def bounded_gradient(
    beliefs: dict[Voxel, Belief], voxel: Voxel, sigma_known: float, planar: bool
) -> list[float]:
    """Backward difference of H(C_l), a voxel edge long; projected on the robot's layer if planar."""
    gradient = []
    for axis in range(3):
        before = tuple(index - (axis == other) for other, index in enumerate(voxel))
        if voxel[axis] == 0 or (planar and axis == 2):
            gradient.append(0.0)
            continue
        gradient.append(
            voxel_bits(beliefs[voxel][1], sigma_known) - voxel_bits(beliefs[before][1], sigma_known)
        )
    return gradient


def segment_distance(point: Vector, begin: Vector, end: Vector) -> float:
    """Distance from a point to a segment."""
    way = [b - a for a, b in zip(begin, end, strict=True)]
    squared = sum(w * w for w in way)
    share = sum((p - a) * w for p, a, w in zip(point, begin, way, strict=True)) / squared if squared else 0.0
    share = min(max(share, 0.0), 1.0)
    return math.dist(point, [a + share * w for a, w in zip(begin, way, strict=True)])


def meets(begin: Vector, end: Vector, mate: Mate, touching: float, steps: int = 2000) -> bool:
    """Whether a body on a straight way comes nearer to a teammate's way than the two bodies are wide."""
    for n in range(1, steps + 1):
        place = [a + n / steps * (b - a) for a, b in zip(begin, end, strict=True)]
        if segment_distance(place, mate.begin, mate.end) < touching:
            return True
    return False


class Weights(NamedTuple):
    """The constants of eq. 13, for point-like bodies unless `touching` says more of teammates."""

    kappa: float
    scale_bits: float
    interference: float
    sigma_known: float
    touching: float


def values(
    beliefs: dict[Voxel, Belief],
    size: Voxel,
    position: Vector,
    radius: float,
    cone: tuple[float, float],
    mates: list[Mate],
    weights: Weights,
    planar: bool,
) -> dict[Voxel, float]:
    """Eq. 13 of every candidate that has a gradient and is worth anything; `cone`: own radius and angle."""
    layer = int(position[2])
    slopes = {}
    for voxel in beliefs:
        if planar and voxel[2] != layer:
            continue
        place = (voxel[0] + 0.5, voxel[1] + 0.5, position[2] if planar else voxel[2] + 0.5)
        if math.dist(place, position) <= radius:
            slope = bounded_gradient(beliefs, voxel, weights.sigma_known, planar)
            if math.hypot(*slope) > 0.0:
                slopes[voxel] = (place, slope)
    steepest = max((math.hypot(*slope) for _, slope in slopes.values()), default=1.0)
    covered = set().union(*(visible(mate.cone, beliefs) for mate in mates if mate.cone))
    found = {}
    for voxel, (place, slope) in slopes.items():
        steepness, length = math.hypot(*slope), math.dist(place, position)
        worth = steepness / steepest
        if length > 0.0:
            direction = [(b - a) / length for a, b in zip(position, place, strict=True)]
            pieces = rocha04.pieces_of(position, direction, size)
            on_way = [piece.voxel for piece in pieces[1:] if piece.entered < length]
            most = max((beliefs[crossed][0] for crossed in on_way if crossed != voxel), default=0.0)
            worth *= 0.0 if most > 0.5 or beliefs[voxel][0] > 0.5 else 1.0 - most
        if any(meets(position, place, mate, weights.touching) for mate in mates if length > 0.0):
            worth = 0.0
        yaw, pitch = math.atan2(slope[1], slope[0]), -math.asin(slope[2] / steepness)
        view = Cone(place, yaw, pitch, *cone)
        for mate in mates:
            way = math.dist(mate.end, place)
            ahead = sum(
                (e - p) * g for e, p, g in zip(mate.end, place, rocha04.gaze(yaw, pitch), strict=True)
            )
            if way <= cone[0] and (way == 0.0 or math.acos(max(-1.0, min(1.0, ahead / way))) <= cone[1]):
                worth *= weights.interference
        shared = covered_bits(visible(view, beliefs) & covered, beliefs, weights.sigma_known)
        worth *= math.exp(-shared / weights.scale_bits)
        if worth > 0.0:
            found[voxel] = worth - weights.kappa * length / radius
    return found
