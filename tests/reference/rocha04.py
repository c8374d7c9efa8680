"""Rocha04 once more, slowly: plain Python, written from the paper's equations and not from our code.

Beliefs are dictionaries voxel → (μ, σ), in the paper's own form; rays are cut at the planes between
voxels, sorted, and looked up at the middle of every piece. Nothing here is fast, and nothing is
shared with the library. Grid units (voxel edges) unless a name ends in `_m`.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

Vector = Sequence[float]
Voxel = tuple[int, int, int]
Belief = tuple[float, float]
"""μ and σ of a voxel's coverage."""

LEAST_CHORD = 1e-9
"""A voxel that a ray touches for less than this, in its corner or along its edge, is not crossed."""

LEAST_SLOPE = 1e-100
"""A ray with less of a component along an axis never reaches a plane across it."""

HIT, WALL, OPEN = "hit", "wall", "open"


def gaze(yaw: float, pitch: float) -> tuple[float, float, float]:
    """Unit vector of a gaze: yaw counter-clockwise, pitch downwards (RochaMI, eq. 3)."""
    return (
        math.cos(yaw) * math.cos(pitch),
        math.sin(yaw) * math.cos(pitch),
        -math.sin(pitch),
    )


# --- Rays: the voxels C_i that a measurement influences (eqs. 22-23, sampled so that none is missed)


class Piece(NamedTuple):
    """A voxel on a ray, and between which distances the ray is inside it."""

    voxel: Voxel
    entered: float
    left: float


def pieces_of(start: Vector, direction: Vector, size: Voxel) -> list[Piece]:
    """All voxels on a half-line up to the boundary of the workspace."""
    cuts = [0.0]
    leaves = math.inf
    for at, along, cells in zip(start, direction, size, strict=True):
        if abs(along) < LEAST_SLOPE:
            continue
        crossings = [(plane - at) / along for plane in range(cells + 1)]
        cuts += [cut for cut in crossings if cut > 0.0]
        leaves = min(leaves, max(crossings))
    cuts = [*sorted(cut for cut in cuts if cut < leaves), leaves]
    pieces = []
    for entered, left in itertools.pairwise(cuts):
        if left - entered < LEAST_CHORD:
            continue
        middle = 0.5 * (entered + left)
        x, y, z = (math.floor(at + middle * along) for at, along in zip(start, direction, strict=True))
        pieces.append(Piece((x, y, z), entered, left))
    return pieces


class Trace(NamedTuple):
    """How a ray ended, how far it went and which voxels it influences, in order."""

    length: float
    voxels: list[Voxel]
    end: str


def trace(
    covered: Callable[[Voxel], bool],
    start: Vector,
    direction: Vector,
    size: Voxel,
    longest: float,
    behind: int,
    hit_at_longest: bool = False,
) -> Trace:
    """Follow a ray to the first covered voxel, to the wall, or for `longest`.

    A covered voxel ends it at its face (not the voxel that it starts in). After a hit, `behind`
    further voxels on the line are influenced, too. With `hit_at_longest` its whole length is a
    measured distance: what it reaches there is a hit.
    """
    pieces = pieces_of(start, direction, size)
    length, end, reached = pieces[-1].left, WALL, len(pieces)
    for number, piece in enumerate(pieces):
        if piece.entered >= longest:
            length, end, reached = longest, OPEN, number
            break
        if number > 0 and covered(piece.voxel):
            length, end, reached = piece.entered, HIT, number
            break
    else:
        if length >= longest:
            length, end = longest, OPEN
    if end == OPEN and hit_at_longest:
        end = HIT
    influenced = pieces[: reached + behind] if end == HIT else pieces[:reached]
    return Trace(length, [piece.voxel for piece in influenced], end)


def is_generic(start: Vector, direction: Vector, size: Voxel, longest: float, margin: float = 1e-6) -> bool:
    """Whether rounding cannot decide which voxels a ray crosses: no edge, no corner, no face."""
    pieces = pieces_of(start, direction, size)
    inside = all(abs(at - round(at)) > margin for at in start)
    steady = all(
        piece.left - piece.entered > margin
        and abs(piece.entered - longest) > margin
        and abs(piece.left - longest) > margin
        for piece in pieces
    )
    faces = all(
        sum(abs(first - second) for first, second in zip(one.voxel, other.voxel, strict=True)) == 1
        for one, other in itertools.pairwise(pieces)
    )
    return inside and steady and faces


def distance_to_ball(start: Vector, direction: Vector, centre: Vector, radius: float) -> float:
    """How far along a ray the first point of a ball lies; inf if the ray misses it.

    |start + t·direction - centre|² = radius², solved for t.
    """
    offset = [at - middle for at, middle in zip(start, centre, strict=True)]
    half_b = sum(o * d for o, d in zip(offset, direction, strict=True))
    c = sum(o * o for o in offset) - radius * radius
    if c <= 0.0:
        return 0.0
    root = half_b * half_b - c
    if root < 0.0 or half_b > 0.0:
        return math.inf
    return -half_b - math.sqrt(root)


# --- Sensor model (eqs. 3-5)


def is_blind(hit: bool, measured_m: float, min_range_m: float) -> bool:
    """Whether a sensor that sees nothing nearer than this gives no reading, whatever is behind."""
    return hit and measured_m < min_range_m


def measured_mean(voxel_distance_m: float, measured_m: float, voxel_size_m: float) -> float:
    """μ(dˡ, d): coverage that a measured distance says of a voxel at dˡ (eq. 4)."""
    if voxel_distance_m - measured_m < -voxel_size_m / 2.0:
        return 0.0
    if voxel_distance_m - measured_m > voxel_size_m / 2.0:
        return 1.0
    return 0.5 + (voxel_distance_m - measured_m) / voxel_size_m


def measured_sigma(measured_m: float, sigma_min: float, zeta_per_m: float) -> float:
    """σ(d) (eq. 5)."""
    return sigma_min + zeta_per_m * measured_m


def centre_distance(start: Vector, voxel: Voxel) -> float:
    """Distance from the sensor to a voxel's centre, dˡ."""
    return math.dist(start, [index + 0.5 for index in voxel])


# --- Update, entropy, utility (eqs. 15, 17-18, 25-29)


def product(first: Belief, second: Belief) -> Belief:
    """μ and σ of the product of two Gaussians (eqs. 17-18)."""
    (mean_1, sigma_1), (mean_2, sigma_2) = first, second
    total = sigma_1**2 + sigma_2**2
    mean = (mean_1 * sigma_2**2 + mean_2 * sigma_1**2) / total
    return mean, sigma_1 * sigma_2 / math.sqrt(total)


def entropy_bits(sigma: float) -> float:
    """Differential entropy of a Gaussian (eq. 15)."""
    return math.log2(math.sqrt(2.0 * math.pi * math.e)) + math.log2(sigma)


def map_entropy_bits(sigmas: Iterable[float]) -> float:
    """Entropy of a map (eq. 25)."""
    return math.fsum(entropy_bits(sigma) for sigma in sigmas)


def utility_bits(before: Iterable[float], after: Iterable[float]) -> float:
    """Information utility of a measurement from the σ of its voxels before and after it (eq. 27)."""
    return math.fsum(math.log2(old / new) for old, new in zip(before, after, strict=True))


class Sensor(NamedTuple):
    """The numbers of a range sensor (table 1)."""

    voxel_size_m: float
    sigma_min: float
    zeta_per_m: float


def integrate(
    beliefs: dict[Voxel, Belief],
    voxels: Sequence[Voxel],
    start: Vector,
    measured_m: float,
    hit: bool,
    sensor: Sensor,
) -> float:
    """Fuse one measurement into a map; returns its utility (eq. 27).

    A ray without a return within its range says that all it crossed is free.
    """
    sigma = measured_sigma(measured_m, sensor.sigma_min, sensor.zeta_per_m)
    before, after = [], []
    for voxel in voxels:
        away_m = centre_distance(start, voxel) * sensor.voxel_size_m
        mean = measured_mean(away_m, measured_m, sensor.voxel_size_m) if hit else 0.0
        before.append(beliefs[voxel][1])
        beliefs[voxel] = product(beliefs[voxel], (mean, sigma))
        after.append(beliefs[voxel][1])
    return utility_bits(before, after)


# --- Sharing (eqs. 42-43)


def is_valid_selection(utility: Sequence[float], chosen: Sequence[int], burst: int, i_min: float) -> bool:
    """The proposition of eq. 43 on the measurements `chosen`, in the three parts of its text."""
    left_out = [bits for ray, bits in enumerate(utility) if ray not in set(chosen)]
    not_too_many = len(chosen) <= burst and len(set(chosen)) == len(chosen)
    none_forgotten = len(chosen) == burst or all(bits < i_min for bits in left_out)
    most_useful = all(
        utility[ray] >= i_min and all(bits <= utility[ray] for bits in left_out) for ray in chosen
    )
    return not_too_many and none_forgotten and most_useful


def select(utility: Sequence[float], burst: int, i_min: float) -> list[int]:
    """Measurements to send: the most useful first, of equal ones the first ray."""
    ranked = sorted(range(len(utility)), key=lambda ray: (-utility[ray], ray))
    return [ray for ray in ranked if utility[ray] >= i_min][:burst]


def steered(i_min: float, utility: Sequence[float], burst: int, fill: float, gain: float) -> float:
    """I_min after a scan, steered towards the value that `fill * burst` measurements a scan reach."""
    wanted = fill * burst
    reached = len([bits for bits in utility if bits >= i_min])
    log = math.log(i_min) + gain * (min(reached, 2.0 * wanted) / wanted - 1.0)
    return max(math.exp(log), 1e-6)


# --- The gradient strategy (eqs. 30-40)


def entropy_gradient(sigma: Callable[[Voxel], float], voxel: Voxel, voxel_size_m: float) -> list[float]:
    """Backward difference of the entropy field (eq. 30).

    The paper does not say what it is along an axis on which there is no voxel before: 0 here.
    """
    gradient = []
    for axis in range(3):
        if voxel[axis] == 0:
            gradient.append(0.0)
            continue
        x, y, z = (index - (axis == other) for other, index in enumerate(voxel))
        difference = entropy_bits(sigma(voxel)) - entropy_bits(sigma((x, y, z)))
        gradient.append(difference / voxel_size_m)
    return gradient


def candidates(position: Vector, reach: float, size: Voxel) -> list[Voxel]:
    """η(pos, ξ): voxels whose centre is within reach, in C order (eq. 32)."""
    return [
        (x, y, z)
        for x in range(size[0])
        for y in range(size[1])
        for z in range(size[2])
        if centre_distance(position, (x, y, z)) <= reach
    ]


def motion_axes(yaw: float, pitch: float, roll: float = 0.0) -> tuple[list[float], list[float]]:
    """Longitudinal and transverse axis of the motion plane (eqs. 35-36).

    The paper's angles turn clockwise, and its pitch is positive upwards: ours are turned round.
    """
    theta, phi, psi = -yaw, -pitch, roll
    longitudinal = [
        math.cos(theta) * math.cos(phi),
        -math.sin(theta) * math.cos(phi),
        math.sin(phi),
    ]
    transverse = [
        math.cos(theta) * math.sin(phi) * math.sin(psi) + math.sin(theta) * math.cos(psi),
        -math.sin(theta) * math.sin(phi) * math.sin(psi) + math.cos(theta) * math.cos(psi),
        -math.cos(phi) * math.sin(psi),
    ]
    return longitudinal, transverse


def on_plane(vector: Vector, axes: tuple[Vector, Vector]) -> list[float]:
    """Projection of a vector on the motion plane (eq. 37)."""
    weights = [sum(v * a for v, a in zip(vector, axis, strict=True)) for axis in axes]
    return [weights[0] * p + weights[1] * q for p, q in zip(*axes, strict=True)]


def reachability(position: Vector, voxel: Voxel, axes: tuple[Vector, Vector]) -> float:
    """ρ(pos, l) (eq. 40)."""
    way = [index + 0.5 - at for index, at in zip(voxel, position, strict=True)]
    if math.hypot(*way) == 0.0:
        return 1.0
    return math.hypot(*on_plane(way, axes)) / math.hypot(*way)


class Choice(NamedTuple):
    """A voxel to go to, its score, and the direction to look in (None: the gradient vanishes)."""

    voxel: Voxel
    score: float
    gaze: list[float] | None


def choose(
    beliefs: dict[Voxel, Belief],
    position: Vector,
    reach: float,
    size: Voxel,
    axes: tuple[Vector, Vector] | None = None,
) -> list[Choice]:
    """All candidates, the best first: eqs. 33-34, or 38-40 where the motion plane's axes are given."""
    choices = []
    for voxel in candidates(position, reach, size):
        slope = entropy_gradient(lambda place: beliefs[place][1], voxel, 1.0)
        weight = 1.0
        if axes is not None:
            slope, weight = on_plane(slope, axes), reachability(position, voxel, axes)
        steepness = math.hypot(*slope)
        direction = [component / steepness for component in slope] if steepness > 0.0 else None
        choices.append(Choice(voxel, weight * steepness * (1.0 - beliefs[voxel][0]), direction))
    return sorted(choices, key=lambda choice: -choice.score)


# --- Motion: a trapezoid of speed, from rest to rest


def drive_s(length_m: float, speed_m_s: float, acceleration_m_s2: float) -> float:
    """Duration of a drive: speed up, cruise, brake."""
    ramp_s = speed_m_s / acceleration_m_s2
    ramps_m = acceleration_m_s2 * ramp_s**2  # both of them
    if length_m < ramps_m:
        return 2.0 * math.sqrt(length_m / acceleration_m_s2)
    return 2.0 * ramp_s + (length_m - ramps_m) / speed_m_s


def speed_at(time_s: float, length_m: float, speed_m_s: float, acceleration_m_s2: float) -> float:
    """Speed during a drive: the lowest of speeding up, cruising and braking."""
    duration = drive_s(length_m, speed_m_s, acceleration_m_s2)
    return max(0.0, min(acceleration_m_s2 * time_s, speed_m_s, acceleration_m_s2 * (duration - time_s)))


def way_at_m(
    time_s: float, length_m: float, speed_m_s: float, acceleration_m_s2: float, steps: int = 4000
) -> float:
    """Way behind the robot: the speed integrated by the trapezoid rule."""
    tick = time_s / steps
    speeds = [speed_at(n * tick, length_m, speed_m_s, acceleration_m_s2) for n in range(steps + 1)]
    return tick * (math.fsum(speeds) - 0.5 * (speeds[0] + speeds[-1]))
