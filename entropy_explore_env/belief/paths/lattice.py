"""Steps of a body between neighbouring voxel centres, and what they cost, in voxel edges.

A step costs its length times the mean of its two voxels' traversal costs: the integral of the cost along the
straight line between the centres. The traversal cost of a voxel, per voxel edge, is 1 where it is believed
free and `unknown_cost` where it is unknown. A voxel is impassable if it is believed covered, if the body does
not fit in it, or if it lies in the no-fly mask.

A lattice may be coarser than the grid: its steps then lead between cells of some voxels along each axis, and
costs are in edges of cells. A cell is passable if the body fits in one of its voxels, and free or unknown as
the first of those is. In `classify_voxel`, voxels are those of the grid; in searches they are cells.
"""

from __future__ import annotations

import itertools
import math
from typing import NamedTuple

import numpy as np

from entropy_explore_env.belief.raycast import STOP_AT_COVERED
from entropy_explore_env.belief.voxel_index import flat_index
from entropy_explore_env.compilation.kernels import inlined_kernel, lean_kernel, record_type
from entropy_explore_env.errors import SettingError

IMPASSABLE, FREE, UNKNOWN = 0, 1, 2
"""Classes of voxels."""

KNOWN_RATIO = 2.0
"""A voxel is known once its precision is this many times the prior one, that is, half a bit was gained."""

_GRAIN = 2.0**-30
DIAGONALS = (1.0, round(math.sqrt(2.0) / _GRAIN) * _GRAIN, round(math.sqrt(3.0) / _GRAIN) * _GRAIN)
"""Lengths of steps along one, two and three axes, to 2⁻³⁰: sums up to 2²² are exact in any order.

So paths of equal length compare equal, and ties do not depend on rounding.
"""

_MOST_OFFSETS = 1 << 21
"""Most voxels of the box around a body's footprint: a radius of 64 voxels in 3-D, of 700 in a plane."""

_BLOCK_VOXELS = 32
"""Voxels that are classified together: it takes little more time than one, and most are needed soon."""

MOVE = record_type(
    [
        ("step", "i8", (3,)),  # -1, 0 or 1 along x, y and z
        ("code", "i8"),  # 9 (x + 1) + 3 (y + 1) + z + 1
        ("offset", "i8"),  # change of the voxel's number
        ("length", "f8"),
        ("needs", "i8"),  # bit k: move k must be possible, too; a diagonal move needs those along its axes
        ("first", "i8"),  # slice of `footprint_offsets`: voxels that the body newly touches after the step
        ("last", "i8"),  # one past the last
    ],
)
"""A step to a neighbouring voxel."""

NO_FLY_NOWHERE = np.zeros(0, np.bool_)
"""A no-fly mask that forbids nothing."""


class Lattice(NamedTuple):
    """Steps of a body between voxel centres. Made by `new_lattice`."""

    size: tuple[int, int, int]
    """Voxels along x, y and z."""
    layer: int
    """The only voxel layer that is searched; -1 = all."""
    moves: np.ndarray
    """(8 or 26,) MOVE, moves along one axis first."""
    footprint_offsets: np.ndarray
    """(K,) int64, offsets of voxel numbers: the body's footprint, then what each move newly touches."""
    footprint: np.ndarray
    """(B, 3) int64 index offsets of the voxels that the body touches; empty = its own voxel only."""
    block_voxels: int
    """How many voxels with consecutive numbers are classified together: a power of two."""
    margin: tuple[int, int, int]
    """Layers at either end of each axis in which the body would touch the boundary."""
    edge: int
    """Voxels of the grid along a cell's edge; 1 = cells are voxels."""
    grid: tuple[int, int, int]
    """Voxels of the grid along x, y and z."""


class Costs(NamedTuple):
    """Traversal costs, from a belief or from a field."""

    mean: np.ndarray
    """(V,) float32 expected coverage."""
    precision: np.ndarray
    """(V,) float32 1/σ² of it."""
    known_precision: float
    """Voxels with less precision are unknown; see KNOWN_RATIO."""
    unknown_cost: float
    """Traversal cost of unknown voxels, ≥ 1."""
    per_edge: np.ndarray
    """(V,) float32 traversal cost of each voxel, inf = impassable; empty = the belief decides."""
    min_per_edge: float
    """A lower bound of the traversal costs; 1 for a belief."""
    no_fly: np.ndarray
    """(V,) bool: voxels that may not be entered, whatever is believed; empty = none. Used with a belief."""


def new_lattice(
    shape: tuple[int, int, int], body_radius: float = 0.0, layer: int | None = None, edge: int = 1
) -> Lattice:
    """Return the steps of a ball-shaped body in a workspace.

    A diagonal step is possible only if every voxel at the edges that it crosses is passable. The body fits
    where its footprint contains no covered voxel, as in `World.collision_mask`. Outside the workspace
    everything counts as covered, except above and below a body that stays in its layer.

    Args:
        shape: (X, Y, Z) voxels.
        body_radius: In voxel edges.
        layer: The only voxel layer that is searched (planar robots); None = all of them.
        edge: Voxels along a cell's edge; 1 where there is a layer.

    Raises:
        SettingError: The radius is not a finite number ≥ 0 or is too large, or there is no such layer.
    """
    if not (0.0 <= body_radius < math.inf):
        raise SettingError("body_radius", body_radius, "a finite number ≥ 0, in voxel edges")
    if layer is not None and not 0 <= layer < shape[2]:
        raise SettingError("layer", layer, f"None or a whole number from 0 to {shape[2] - 1}")
    layer = 0 if shape[2] == 1 else layer
    body, cells = _footprint(shape, body_radius, layer), tuple(-(-n // edge) for n in shape)
    extent = int(body.max(initial=0))
    strides, of_cells = (np.array([n[1] * n[2], n[2], 1], np.int64) for n in (shape, cells))
    steps: list[tuple[int, ...]] = [
        s for s in itertools.product((-1, 0, 1), repeat=3) if any(s) and (layer is None or s[2] == 0)
    ]
    steps.sort(key=lambda s: sum(map(abs, s)))
    moves, offsets = np.zeros(len(steps), MOVE), [body]
    first = len(body)
    for move, step in zip(moves, steps, strict=True):
        new = _newly_touched(body, step)
        sides = itertools.product(*({0, axis} for axis in step))
        move["step"], move["code"], move["offset"] = step, _code(step), np.dot(of_cells, step)
        move["length"] = DIAGONALS[sum(map(abs, step)) - 1]
        move["needs"] = sum(1 << steps.index((x, y, z)) for x, y, z in sides if x or y or z)
        move["first"], move["last"] = first, first + len(new)
        first += len(new)
        offsets.append(new)
    return Lattice(
        (int(cells[0]), int(cells[1]), int(cells[2])),
        -1 if layer is None else layer,
        moves,
        np.concatenate(offsets) @ strides,
        body,
        _BLOCK_VOXELS if not len(body) and edge == 1 and (layer is None or shape[2] == 1) else 1,
        (extent, extent, extent if layer is None else 0),
        edge,
        (int(shape[0]), int(shape[1]), int(shape[2])),
    )


def longest_edge(body_radius: float) -> int:
    """Return the longest edge of cells between which no steps lead through a wall, in voxels.

    The centres of voxels in two cells that share a face are at most ((2 edge - 1)² + 2 (edge - 1)²)^½ apart,
    those in which the body fits on either side of a wall at least twice its radius; diagonal steps are
    possible only where steps along the axes lead to the same cell.

    Args:
        body_radius: In voxel edges.
    """
    edge = 1
    while (2 * edge + 1) ** 2 + 2 * edge**2 < 4.0 * body_radius**2:
        edge += 1
    return edge


def _code(step: tuple[int, ...]) -> int:
    return 9 * (step[0] + 1) + 3 * (step[1] + 1) + step[2] + 1


def _footprint(shape: tuple[int, int, int], radius: float, layer: int | None) -> np.ndarray:
    """Return (B, 3) int64 index offsets of the voxels that a body touches; none if only its own voxel.

    They are in lexicographic order.
    """
    if radius <= 0.5 + 1e-9:
        return np.zeros((0, 3), np.int64)
    reach = min(math.ceil(radius - 0.5), max(shape))
    low, high = (-reach, reach) if layer is None else (max(-reach, -layer), min(reach, shape[2] - 1 - layer))
    across, up = np.arange(-reach, reach + 1), np.arange(low, high + 1)
    if len(across) ** 2 * len(up) > _MOST_OFFSETS:
        allowed = f"less, so that the body and its margin touch at most {_MOST_OFFSETS:,} voxels of this grid"
        raise SettingError("body_radius_m with localization.margin_m, in voxel edges", radius, allowed)
    far_x, far_z = (np.maximum(np.abs(axis) - 0.5, 0.0) ** 2 for axis in (across, up))
    touched = far_x[:, None, None] + far_x[:, None] + far_z < radius**2 - 1e-9
    return np.ascontiguousarray(np.argwhere(touched) + np.array([-reach, -reach, low]))


def _newly_touched(body: np.ndarray, step: tuple[int, ...]) -> np.ndarray:
    """Return the offsets of a body that after a step are at none of its former places."""
    if not len(body):
        return body
    low = body.min(axis=0) - 1
    touched = np.zeros(body.max(axis=0) - low + 2, np.bool_)
    touched[tuple((body - low).T)] = True
    return body[~touched[tuple((body + step - low).T)]]


def costs_of(per_edge: np.ndarray, min_per_edge: float) -> Costs:
    """Return traversal costs of a (V,) float32 field that is known to be valid, and a lower bound of them."""
    none = per_edge[:0]
    return Costs(none, none, 0.0, 1.0, per_edge, min_per_edge, NO_FLY_NOWHERE)


@inlined_kernel
def in_no_fly(costs, voxel):
    """Return whether a voxel lies in the no-fly mask."""
    return len(costs.no_fly) > 0 and costs.no_fly[voxel]


@inlined_kernel
def classify_voxel(lattice, costs, voxel, x, y, z, first, last):
    """Return the class of a voxel: IMPASSABLE, FREE or UNKNOWN.

    Args:
        x: Its index along x.
        y: Along y.
        z: Along z.
        first: First of the `footprint_offsets` at which voxels have to be uncovered.
        last: One past the last of them.
    """
    if len(costs.per_edge) > 0:
        return FREE if costs.per_edge[voxel] < math.inf else IMPASSABLE
    if costs.mean[voxel] > STOP_AT_COVERED or in_no_fly(costs, voxel):
        return IMPASSABLE
    size, margin = lattice.grid, lattice.margin
    if x < margin[0] or y < margin[1] or z < margin[2]:
        return IMPASSABLE
    if x >= size[0] - margin[0] or y >= size[1] - margin[1] or z >= size[2] - margin[2]:
        return IMPASSABLE
    for i in range(first, last):
        if costs.mean[voxel + lattice.footprint_offsets[i]] > STOP_AT_COVERED:
            return IMPASSABLE
    return UNKNOWN if costs.precision[voxel] < costs.known_precision else FREE


@inlined_kernel
def cell_of(lattice, voxel):
    """Return the number of the cell that holds a voxel, at indices (x, y, z) of the grid."""
    edge = lattice.edge
    return flat_index(lattice.size, voxel[0] // edge, voxel[1] // edge, voxel[2] // edge)


@lean_kernel
def standing_voxel(lattice, costs, cell):
    """Return (kind, voxel): the class of a cell, and the first of its voxels in which the body fits.

    Cell and voxel are indices (x, y, z). Where the body fits in none, the voxel is the cell's first one.
    """
    edge, grid, body = lattice.edge, lattice.grid, len(lattice.footprint)
    first = (cell[0] * edge, cell[1] * edge, cell[2] * edge)
    for x in range(first[0], min(first[0] + edge, grid[0])):
        for y in range(first[1], min(first[1] + edge, grid[1])):
            for z in range(first[2], min(first[2] + edge, grid[2])):
                kind = classify_voxel(lattice, costs, flat_index(grid, x, y, z), x, y, z, 0, body)
                if kind != IMPASSABLE:
                    return kind, (x, y, z)
    return IMPASSABLE, first


@lean_kernel
def classify_range(costs, first, last, base, marks):
    """Set the marks of the voxels `first` … `last` - 1 to `base` plus the class of each.

    For bodies that touch their own voxel only.
    """
    if len(costs.per_edge) > 0:
        for voxel in range(first, last):
            marks[voxel] = np.uint32(base + (FREE if costs.per_edge[voxel] < math.inf else IMPASSABLE))
        return
    for voxel in range(first, last):
        kind = UNKNOWN if costs.precision[voxel] < costs.known_precision else FREE
        covered = costs.mean[voxel] > STOP_AT_COVERED or in_no_fly(costs, voxel)
        marks[voxel] = np.uint32(base + (IMPASSABLE if covered else kind))
