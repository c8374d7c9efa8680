"""Steps of a body between neighbouring voxel centres, and what a way through a belief costs, in voxel edges.

A step costs its length times the mean of the two voxels' rates: the rate's integral along the
straight line between the centres. A voxel believed free has rate 1, an unknown one `unknown_cost`;
none can be entered that is believed covered, in which the body does not fit, or that is closed.
"""

from __future__ import annotations

import itertools
import math
from typing import NamedTuple

import numpy as np

from entropy_explore_env.belief.raycast import STOP_AT_COVERED
from entropy_explore_env.compilation.kernels import inlined_kernel, lean_kernel
from entropy_explore_env.errors import SettingError

IMPASSABLE, FREE, UNKNOWN = 0, 1, 2
"""What can be done in a voxel."""

KNOWN_RATIO = 2.0
"""A voxel is known once its precision is this many times the prior one: half a bit was learnt of it."""

MOST_RATE = 1e6
"""Rates are at most this many times the least one: a search works off a bucket for each least step."""

_GRAIN = 2.0**-30
DIAGONALS = (1.0, round(math.sqrt(2.0) / _GRAIN) * _GRAIN, round(math.sqrt(3.0) / _GRAIN) * _GRAIN)
"""Lengths of steps along one, two and three axes, to 2⁻³⁰: sums up to 2²² are exact in any order.

So ways of equal length are equal, and ties do not hang on rounding.
"""
_SQRT2, _SQRT3 = DIAGONALS[1], DIAGONALS[2]

_TOGETHER = 32
"""So many voxels are looked at in little more time than one, and most will be needed soon."""

MOVE = np.dtype(
    [
        ("step", "i8", (3,)),  # -1, 0 or 1 along x, y and z
        ("code", "i8"),  # 9 (x + 1) + 3 (y + 1) + z + 1
        ("offset", "i8"),  # what is added to the voxel's number
        ("length", "f8"),
        (
            "needs",
            "i8",
        ),  # bits by number of a move: the voxel that is entered and those that are squeezed past
        ("first", "i8"),  # of `ball`: what the body touches after the step and did not before
        ("last", "i8"),
    ],
    align=True,
)


NOTHING_CLOSED = np.zeros(0, np.bool_)


class Lattice(NamedTuple):
    """Steps of a body between voxel centres. Made by `new_lattice`."""

    size: tuple[int, int, int]
    """Voxels along x, y and z."""
    layer: int
    """The only voxel layer that is searched; -1 = all."""
    moves: np.ndarray
    """(8 or 26,) MOVE."""
    ball: np.ndarray
    """(K,) int64, number offsets of voxels that the body touches: all of them first, then by move."""
    touched: np.ndarray
    """(B, 3) int64, the same for the whole body by axis; empty if it touches its own voxel only."""
    together: int
    """How many voxels, one after the other by number, are looked at together: a power of two."""
    margin: tuple[int, int, int]
    """Layers at either end of each axis that are too near to the boundary."""


class Costs(NamedTuple):
    """What a search walks on: a belief, or rates. Made by `belief_costs`, `rate_costs`, or in kernels."""

    mean: np.ndarray
    """(V,) float32 expected coverage."""
    precision: np.ndarray
    """(V,) float32 1/σ² of it."""
    known_precision: float
    """Voxels with less are unknown: see KNOWN_RATIO."""
    unknown_cost: float
    """Rate of unknown voxels, ≥ 1."""
    rates: np.ndarray
    """(V,) float32 rates, inf = impassable, in place of the belief; empty = by the belief."""
    least_rate: float
    """No rate is less; 1 for a belief."""
    closed: np.ndarray
    """(V,) bool, with a belief: nobody enters there, whatever is believed; empty = nothing is closed."""


def new_lattice(shape: tuple[int, int, int], body_radius: float = 0.0, layer: int | None = None) -> Lattice:
    """Steps of a ball-shaped body in a workspace.

    A diagonal step needs every voxel that it squeezes past to be passable. The body fits where it
    touches no covered voxel, as in `World.collision_mask`; the boundary of the workspace counts as
    covered, but not above and below a body that stays in its layer.

    Args:
        shape: (X, Y, Z) voxels.
        body_radius: In voxel edges.
        layer: The only voxel layer that is searched (planar robots); None = all, if there are more.

    Raises:
        SettingError: The radius is no finite number ≥ 0, or there is no such layer.
    """
    if not (0.0 <= body_radius < math.inf):
        raise SettingError("body_radius", body_radius, "a finite number ≥ 0, in voxel edges")
    if layer is not None and not 0 <= layer < shape[2]:
        raise SettingError("layer", layer, f"None or a whole number from 0 to {shape[2] - 1}")
    layer = 0 if shape[2] == 1 else layer
    body = _touched(shape, body_radius, layer)
    reaches = max((max(offset) for offset in body), default=0)
    numbers = np.array([shape[1] * shape[2], shape[2], 1], np.int64)
    steps: list[tuple[int, ...]] = [
        s for s in itertools.product((-1, 0, 1), repeat=3) if any(s) and (layer is None or s[2] == 0)
    ]
    steps.sort(key=lambda s: sum(map(abs, s)))
    moves, ball = np.zeros(len(steps), MOVE), list(body)
    for move, step in zip(moves, steps, strict=True):
        fresh = [o for o in body if tuple(np.add(o, step).tolist()) not in body]
        sides = itertools.product(*({0, axis} for axis in step))
        move["step"], move["code"], move["offset"] = step, _code(step), np.dot(numbers, step)
        move["length"] = DIAGONALS[sum(map(abs, step)) - 1]
        move["needs"] = sum(1 << steps.index((x, y, z)) for x, y, z in sides if x or y or z)
        move["first"], move["last"] = len(ball), len(ball) + len(fresh)
        ball += fresh
    return Lattice(
        (int(shape[0]), int(shape[1]), int(shape[2])),
        -1 if layer is None else layer,
        moves,
        np.array([np.dot(numbers, offset) for offset in ball], np.int64),
        np.array(list(body), np.int64).reshape(len(body), 3),
        _TOGETHER if not body and (layer is None or shape[2] == 1) else 1,
        (reaches, reaches, reaches if layer is None else 0),
    )


def _code(step: tuple[int, ...]) -> int:
    return 9 * (step[0] + 1) + 3 * (step[1] + 1) + step[2] + 1


def _touched(
    shape: tuple[int, int, int], radius: float, layer: int | None
) -> dict[tuple[int, int, int], None]:
    """Offsets of the voxels that a body touches, in order; none if it touches its own only."""
    if radius <= 0.5 + 1e-9:
        return {}
    reach = min(math.ceil(radius - 0.5), max(shape))
    across = range(-reach, reach + 1)
    layers = across if layer is None else range(max(-reach, -layer), min(reach, shape[2] - 1 - layer) + 1)
    inside = radius**2 - 1e-9
    return {
        (x, y, z): None
        for x, y, z in itertools.product(across, across, layers)
        if sum(max(abs(axis) - 0.5, 0.0) ** 2 for axis in (x, y, z)) < inside
    }


def belief_costs(
    mean: np.ndarray,
    precision: np.ndarray,
    prior_precision: float,
    unknown_cost: float = 1.0,
    closed: np.ndarray | None = None,
) -> Costs:
    """Search through a belief.

    Args:
        mean: (X, Y, Z) or (V,) float32 expected coverage; above ½ nobody enters.
        precision: The same shape, float32, 1/σ².
        prior_precision: That of a voxel that nobody has measured; known are voxels with KNOWN_RATIO
            times as much.
        unknown_cost: What a voxel edge of way through unknown voxels costs.
        closed: The same shape, bool, where the body may not be whatever is believed: above a ceiling, see
            `worlds.world.no_fly_mask`. None = nowhere.

    Raises:
        SettingError: The cost is no number from 1 to MOST_RATE, or `closed` has another shape or type.
    """
    if closed is not None and (closed.shape != mean.shape or closed.dtype != np.bool_):
        raise SettingError("closed", f"{closed.shape} {closed.dtype}", f"None, or {mean.shape} bool")
    if not (1.0 <= unknown_cost <= MOST_RATE):
        raise SettingError("unknown_cost", unknown_cost, f"a number from 1 to {MOST_RATE:g}")
    flat = _numbered(mean)
    return Costs(
        flat,
        _numbered(precision),
        KNOWN_RATIO * float(prior_precision),
        float(unknown_cost),
        flat[:0],
        1.0,
        NOTHING_CLOSED if closed is None else np.ascontiguousarray(closed).reshape(-1),
    )


def rate_costs(rates: np.ndarray) -> Costs:
    """Search over a field of cost rates; the body plays no part.

    Args:
        rates: (X, Y, Z) or (V,) float32, > 0, what a voxel edge of way costs; inf = impassable.

    Raises:
        SettingError: A rate is not above 0, or finite and over MOST_RATE times the least one.
    """
    flat = _numbered(rates)
    least = float(flat.min(initial=np.inf))
    if not least > 0.0:  # NaN is not either
        raise SettingError("rates", least, "rates > 0; inf = impassable")
    most = float(flat.max(initial=0.0, where=np.isfinite(flat)))
    if most > MOST_RATE * least:
        raise SettingError("rates", most, f"finite rates of at most {MOST_RATE:g} times the least, {least:g}")
    return Costs(flat[:0], flat[:0], 0.0, 1.0, flat, least if math.isfinite(least) else 1.0, NOTHING_CLOSED)


def _numbered(field: np.ndarray) -> np.ndarray:
    """A field by voxel number, read-only, so that kernels are compiled for one kind of array."""
    flat = np.ascontiguousarray(field, np.float32).reshape(-1).view()
    flat.setflags(write=False)
    return flat


@inlined_kernel
def place_of(lattice, voxel):
    """(x, y, z) of a voxel by its number: (v + ½)/Z is never near a whole number, so no division."""
    column = int((voxel + 0.5) * (1.0 / lattice.size[2]))
    row = int((column + 0.5) * (1.0 / lattice.size[1]))
    return row, column - row * lattice.size[1], voxel - column * lattice.size[2]


@inlined_kernel
def is_closed(costs, voxel):
    """Whether a voxel is closed to robots, whatever they believe of it."""
    return len(costs.closed) > 0 and costs.closed[voxel]


@inlined_kernel
def look_at(lattice, costs, voxel, x, y, z, first, last):
    """What can be done in a voxel: impassable, free or unknown.

    Args:
        lattice: The steps.
        costs: The belief, or the rates.
        voxel: Its number.
        x: Its place.
        y: Likewise.
        z: Likewise.
        first: The body's voxels in `lattice.ball` that have to be looked at, from here …
        last: … to one before here.
    """
    if len(costs.rates) > 0:
        return FREE if costs.rates[voxel] < math.inf else IMPASSABLE
    if costs.mean[voxel] > STOP_AT_COVERED or is_closed(costs, voxel):
        return IMPASSABLE
    size, margin = lattice.size, lattice.margin
    if x < margin[0] or y < margin[1] or z < margin[2]:
        return IMPASSABLE
    if x >= size[0] - margin[0] or y >= size[1] - margin[1] or z >= size[2] - margin[2]:
        return IMPASSABLE
    for i in range(first, last):
        if costs.mean[voxel + lattice.ball[i]] > STOP_AT_COVERED:
            return IMPASSABLE
    return UNKNOWN if costs.precision[voxel] < costs.known_precision else FREE


@lean_kernel
def look_along(costs, first, last, number, marks):
    """Fill in the marks of voxels `first` … `last` - 1: what can be done in each, added to a number.

    For bodies that touch their own voxel only.
    """
    if len(costs.rates) > 0:
        for voxel in range(first, last):
            marks[voxel] = np.uint32(number + (FREE if costs.rates[voxel] < math.inf else IMPASSABLE))
        return
    for voxel in range(first, last):
        kind = UNKNOWN if costs.precision[voxel] < costs.known_precision else FREE
        covered = costs.mean[voxel] > STOP_AT_COVERED or is_closed(costs, voxel)
        marks[voxel] = np.uint32(number + (IMPASSABLE if covered else kind))
