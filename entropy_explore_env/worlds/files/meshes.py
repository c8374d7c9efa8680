"""Meshes, OBJ, STL, GLB, DAE and PLY, read and made voxels of with trimesh.

A voxel is solid if the surface passes through it, and, with `fill`, if the surface encloses it. All others in
the mesh's box are free; `clearance_m` adds free space around it. With `inside` the mesh is a building drawn
by its inner walls: what the surface encloses is free, and all else is solid. A mesh has no resolution of its
own. OBJ, STL and PLY are taken in metres with z up; GLB has y up (glTF 2.0, section 3.4), and DAE states its
unit and its axis. The options `scale`, metres of a unit, and `up` say otherwise. All are turned upright.
Nothing beside the file is read: no materials, no textures.
"""

from __future__ import annotations

import io
import math
import re
from pathlib import Path
from typing import Any

import numpy as np

from entropy_explore_env.errors import SettingError
from entropy_explore_env.worlds.files.point_clouds import check_extent, upright, voxels_of
from entropy_explore_env.worlds.files.voxels import (
    FREE,
    SOLID,
    Options,
    RefusedError,
    Voxels,
    content,
)

NEEDS = (("trimesh", "trimesh"), ("scipy.ndimage", "scipy"))
_INWARDS = 1e-3
"""Triangles are moved inwards by this many voxels, and their corners towards their middles: a surface between
two voxels, where files in float32 leave it a little to one side, belongs to the solid."""
_SHARE = 2.0
"""Triangles are cut into four until no edge is longer than a voxel divided by this; the surface's voxels are
those that a corner of these small triangles lies in."""
_LONG_HALVINGS, _THIN = 7, 4.0
"""A triangle is long and thin if it would be cut into four more often than this, and that would make too many
times as many small ones as would cover it: it is covered by lines instead, no further from each other."""
_HALVINGS_AT_ONCE = 8
_POINTS_AT_ONCE = 1 << 18
"""Corners of small triangles that are made at once: memory follows the result, not the area."""

_UP_AXIS = re.compile(rb"<up_axis>\s*([XYZ])_UP\s*</up_axis>")
_UNIT = re.compile(rb"<unit\s[^>]*?meter\s*=\s*[\"']([^\"']+)[\"']")
"""How a DAE states its axis, y unless stated, and its unit."""
_ENCLOSES_NOTHING = (
    "a mesh whose surface encloses space at this voxel size (a larger voxel_size_m closes gaps; "
    "without inside, --inside, what lies around the surface is free)"
)
_HOLLOW = (
    "a map with free space at this voxel size: this mesh encloses all of it "
    "(hollow keeps it free: fill=False, --hollow; clearance_m adds free space around; "
    "inside, --inside: it is a building drawn by its inner walls)"
)


def read(path: Path, options: Options) -> Voxels:
    """Return the voxels of all meshes of a file, or of a PLY's points."""
    import trimesh

    kind = path.suffix.lower()[1:]
    extra: dict[str, Any] = {"skip_materials": True} if kind in ("obj", "glb") else {}
    data = content(path)
    scene = trimesh.load_scene(io.BytesIO(data), file_type=kind, **extra)
    mesh = scene.to_mesh()
    if len(mesh.faces) == 0:
        clouds = [part.vertices for part in scene.geometry.values() if isinstance(part, trimesh.PointCloud)]
        if kind != "ply" or not clouds:
            raise RefusedError("a mesh with faces")
        return voxels_of(np.concatenate(clouds).astype(np.float64), options)
    up, unit_m = _axis_and_unit(data) if kind == "dae" else ("y" if kind == "glb" else "z", 1.0)
    return _voxels(mesh, options, up, unit_m)


def _axis_and_unit(data: bytes) -> tuple[str, float]:
    """Return the axis of a DAE that points up, and its unit in metres."""
    axis, unit = _UP_AXIS.search(data), _UNIT.search(data)
    up, unit_m = (axis[1].decode().lower() if axis else "y"), (float(unit[1]) if unit else 1.0)
    if up == "x" or not 0 < unit_m < math.inf:
        raise RefusedError("a DAE with y or z up and a unit > 0")
    return up, unit_m


def _voxels(mesh: Any, options: Options, up: str = "z", unit_m: float = 1.0) -> Voxels:  # noqa: ANN401
    from scipy import ndimage

    voxel_m = options.need("voxel_size_m", "a mesh")
    fill, clearance_m = options.get("fill"), options.get("clearance_m") or 0.0
    inside = bool(options.get("inside"))
    if inside and (fill is not None or clearance_m):
        raise SettingError("inside", True, "None together with fill (--hollow) and clearance_m")
    vertices = upright(np.asarray(mesh.vertices, np.float64), options, up, unit_m)
    if not np.isfinite(vertices).all():
        raise RefusedError("a mesh whose vertices are finite")
    margin = math.ceil(clearance_m / voxel_m - 1e-9)
    check_extent(np.ptp(vertices, axis=0) + (2.0 + 2.0 * margin) * voxel_m, voxel_m, options)
    corners = vertices[np.asarray(mesh.faces)[mesh.unique_faces()]] / voxel_m - 0.5
    wound_outwards = _volume(corners) >= 0.0
    moved = _moved(corners, -1.0 if inside and wound_outwards else 1.0)  # the solid's side is the outer one
    if wound_outwards and not inside:
        _keep_inside(moved, corners)
    solid, low = _surface(moved)
    if inside:
        enclosed = np.asarray(ndimage.binary_fill_holes(solid), np.bool_) & ~solid
        if not enclosed.any():
            raise RefusedError(_ENCLOSES_NOTHING)
        solid = ~enclosed
    elif fill is not False:
        filled = np.asarray(ndimage.binary_fill_holes(solid), np.bool_)
        if margin == 0 and filled.all() and not solid.all():
            raise RefusedError(_HOLLOW)
        solid = filled
    labels = np.full([n + 2 * margin for n in solid.shape], FREE, np.int8)
    box = tuple(slice(margin, margin + n) for n in solid.shape)
    labels[box][solid] = SOLID
    x, y, z = (float(v) for v in (low - margin) * voxel_m)
    return Voxels(labels, voxel_m, (x, y, z))


def _moved(corners: np.ndarray, sign: float) -> np.ndarray:
    """Return triangles (M, 3, 3), voxels, a little smaller and moved against their normals, times a sign."""
    a, b, c = np.moveaxis(corners, 1, 0)
    normals = sign * _unit(np.cross(b - a, c - a))[:, None]
    return corners - _INWARDS * (normals + _unit(corners - corners.mean(axis=1, keepdims=True)))


def _keep_inside(moved: np.ndarray, corners: np.ndarray) -> None:
    """Bring triangles that were moved inwards back where a slope ends in a sharp edge, out of the solid.

    They stay within the box of the triangles as they were, moved inwards, too; along the axes that it has.
    """
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    thick = high - low > 2.0 * _INWARDS
    np.clip(moved, np.where(thick, low + _INWARDS, -np.inf), np.where(thick, high - _INWARDS, np.inf), moved)


def _volume(corners: np.ndarray) -> float:
    """Return the volume within triangles (M, 3, 3); below 0 where they are wound inwards."""
    a, b, c = np.moveaxis(corners - corners[0, 0], 1, 0)
    return float((np.cross(a, b) * c).sum()) / 6.0


def _unit(vectors: np.ndarray) -> np.ndarray:
    """Return (…, 3) vectors of length 1, or 0 where a vector is 0."""
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-300)


def _surface(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the voxels that the corners of a surface, divided into small triangles, lie in.

    Args:
        corners: (M, 3, 3) triangles in voxels, which have their centres on whole numbers.

    Returns:
        (X, Y, Z) bool, the voxels of the surface's box, and (3,) float64, its lowest voxel.
    """
    places = corners.reshape(-1, 3)
    low, high = np.round(places.min(axis=0)), np.round(places.max(axis=0))
    solid = np.zeros((high - low + 1.0).astype(np.int64), np.bool_)
    _mark(solid, low, places)
    thin = _are_thin(corners)
    for ends, of_parts in (
        (_divided(corners[~thin]), _corners_of_parts),
        (_lines(corners[thin]), _places_on),
    ):
        halvings = _halvings(ends)
        for count in np.unique(halvings).tolist():
            shares, alike = of_parts(count), ends[halvings == count]
            at_once = max(1, _POINTS_AT_ONCE // len(shares))
            for first in range(0, len(alike), at_once):
                some = alike[first : first + at_once]
                for begin in range(0, len(shares), _POINTS_AT_ONCE):
                    of_each = shares[begin : begin + _POINTS_AT_ONCE]
                    _mark(solid, low, np.einsum("ps,tsx->tpx", of_each, some).reshape(-1, 3))  # no BLAS
    return solid, low


def _mark(solid: np.ndarray, low: np.ndarray, places: np.ndarray) -> None:
    """Make the voxels solid that places (N, 3) lie in, in voxels; the first one's centre is `low`."""
    at = np.clip(np.round(places) - low, 0.0, np.array(solid.shape) - 1.0)  # sums of shares are rounded
    solid[tuple(at.astype(np.int64).T)] = True


def _corners_of_parts(halvings: int) -> np.ndarray:
    """Return (P, 3) shares of its corners in those of the triangles that one is cut into, four each time."""
    parts = 1 << halvings
    b, c = np.nonzero(np.add.outer(np.arange(parts + 1), np.arange(parts + 1)) <= parts)
    return np.stack((parts - b - c, b, c), axis=1) / parts


def _places_on(halvings: int) -> np.ndarray:
    """Return (P, 2) shares of a line's ends in the places that divide it into 2^halvings equal parts."""
    parts = np.arange((1 << halvings) + 1) / (1 << halvings)
    return np.stack((1.0 - parts, parts), axis=1)


def _are_thin(corners: np.ndarray) -> np.ndarray:
    """Return (M,) which of the triangles (M, 3, 3) are long and thin.

    Cut into four at the middles of its edges, a triangle keeps its form: a needle of a thousand small
    triangles in a row would become a million.
    """
    halvings = _halvings(corners)
    return (halvings > _LONG_HALVINGS) & (4.0**halvings > _THIN * _by_area(corners))


def _lines(corners: np.ndarray) -> np.ndarray:
    """Return lines (N, 2, 3) side by side that cover long thin triangles (M, 3, 3), in voxels.

    They go from both ends of a triangle's longest side to places on its height above that side.
    """
    sides = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
    order = (np.argmax(sides, axis=1)[:, None] + np.arange(3)) % 3  # the longest side is from a to b
    a, b, c = np.moveaxis(np.take_along_axis(corners, order[..., None], axis=1), 1, 0)
    along = b - a
    foot = a + along * (((c - a) * along).sum(axis=1) / (along**2).sum(axis=1))[:, None]
    steps = np.ceil(_SHARE * np.linalg.norm(c - foot, axis=1)).astype(np.int64)
    which = np.repeat(np.arange(len(corners)), steps + 1)
    step = np.arange(len(which)) - np.repeat(np.cumsum(steps + 1) - steps - 1, steps + 1)
    up = (step / np.maximum(steps, 1)[which])[:, None]
    to = foot[which] + up * (c - foot)[which]
    return np.concatenate([np.stack((a[which], to), axis=1), np.stack((b[which], to), axis=1)])


def _divided(corners: np.ndarray) -> np.ndarray:
    """Return triangles (M, 3, 3), the largest ones cut into four at the middles of their edges."""
    done = [corners[:0]]
    while len(corners):
        large = _halvings(corners) > _HALVINGS_AT_ONCE
        done.append(corners[~large])
        a, b, c = np.moveaxis(corners[large], 1, 0)
        ab, bc, ca = 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)
        parts = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        corners = np.concatenate([np.stack(part, axis=1) for part in parts])
    return np.concatenate(done)


def _longest_sides(corners: np.ndarray) -> np.ndarray:
    """Return (M,) the longest side of each of the triangles (M, 3, 3), or the length of lines (M, 2, 3)."""
    return np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2).max(axis=1, initial=0.0)


def _halvings(corners: np.ndarray) -> np.ndarray:
    """Return (M,) how often triangles (M, 3, 3) or lines, in voxels, are cut until no edge is too long."""
    return np.ceil(np.log2(np.maximum(_SHARE * _longest_sides(corners), 1.0))).astype(np.int64)


def _by_area(corners: np.ndarray) -> np.ndarray:
    """Return (M,) about how many triangles with no edge too long would cover triangles (M, 3, 3), voxels."""
    sides = _longest_sides(corners)
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    along, across = 2.0 * _SHARE * sides, 2.0 * _SHARE * areas / np.maximum(sides, 1e-300)
    return np.maximum(along, 1.0) * np.maximum(across, 1.0)
