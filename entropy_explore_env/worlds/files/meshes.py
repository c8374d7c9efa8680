"""Meshes in metres, OBJ, STL, GLB and PLY, read and made voxels of with trimesh.

A voxel is solid if the surface passes through it, and, with `fill`, if the surface encloses it. All others
in the mesh's box are free; `clearance_m` adds free space around it. A mesh has no resolution of its own. OBJ,
STL and PLY are taken as they are, z up; GLB has y up (glTF 2.0, section 3.4) and is turned upright.
Nothing beside the file is read: no materials, no textures.
"""

from __future__ import annotations

import io
import math
from pathlib import Path
from typing import Any

import numpy as np

from entropy_explore_env.worlds.files.point_clouds import voxels_of
from entropy_explore_env.worlds.files.voxels import (
    FREE,
    SOLID,
    Options,
    RefusedError,
    Voxels,
    checked_shape,
    content,
)

NEEDS = (("trimesh", "trimesh"), ("scipy.ndimage", "scipy"))
_INWARDS = 1e-6
"""Surfaces are moved inwards by this many voxels: one between two voxels belongs to the solid's side."""
_TRIANGLES_AT_ONCE = 200_000
"""Small triangles that a surface is divided into at once: memory follows the result, not the area."""
_SHARE = 2.0
"""Triangles are divided until no edge is longer than a voxel divided by this, as by trimesh's `voxelized`."""
_MOST_HALVINGS = 64
"""Limit of the subdivisions of an edge, never reached: trimesh's own is too low for long thin triangles."""


def read(path: Path, options: Options) -> Voxels:
    """The voxels of all meshes of a file, or of a PLY's points."""
    import trimesh

    kind = path.suffix.lower()[1:]
    extra: dict[str, Any] = {"skip_materials": True} if kind in ("obj", "glb") else {}
    scene = trimesh.load_scene(io.BytesIO(content(path)), file_type=kind, **extra)
    mesh = scene.to_mesh()
    if len(mesh.faces) == 0:
        clouds = [part.vertices for part in scene.geometry.values() if isinstance(part, trimesh.PointCloud)]
        if kind != "ply" or not clouds:
            raise RefusedError("a mesh with faces")
        return voxels_of(np.concatenate(clouds).astype(np.float64), options)
    return _voxels(mesh, kind == "glb", options)


def _voxels(mesh: Any, y_is_up: bool, options: Options) -> Voxels:  # noqa: ANN401 - trimesh comes late
    from scipy import ndimage

    voxel_m = options.need("voxel_size_m", "a mesh")
    fill, clearance_m = options.get("fill"), options.get("clearance_m") or 0.0
    vertices = np.asarray(mesh.vertices, np.float64)
    if not np.isfinite(vertices).all():
        raise RefusedError("a mesh whose vertices are finite")
    margin = math.ceil(clearance_m / voxel_m - 1e-9)
    checked_shape(np.ptp(vertices, axis=0) / voxel_m + 2.0 + 2.0 * margin)
    faces = np.asarray(mesh.faces)
    vertices = vertices - _INWARDS * voxel_m * np.asarray(mesh.vertex_normals)
    if y_is_up:
        vertices = np.column_stack((vertices[:, 0], -vertices[:, 2], vertices[:, 1]))
    solid, low = _surface(vertices - 0.5 * voxel_m, faces, voxel_m)
    if fill is not False:
        solid = np.asarray(ndimage.binary_fill_holes(solid), np.bool_)
    labels = np.full([n + 2 * margin for n in solid.shape], FREE, np.int8)
    inside = tuple(slice(margin, margin + n) for n in solid.shape)
    labels[inside][solid] = SOLID
    x, y, z = (float(v) for v in (low - margin) * voxel_m)
    return Voxels(labels, voxel_m, (x, y, z))


def _surface(vertices: np.ndarray, faces: np.ndarray, voxel_m: float) -> tuple[np.ndarray, np.ndarray]:
    """The voxels that the corners of a surface, divided into small triangles, lie in.

    Args:
        vertices: (N, 3) metres, moved so that voxels have their centres on multiples of their size.
        faces: (M, 3) their indices, a triangle each.
        voxel_m: Edge of a voxel.

    Returns:
        (X, Y, Z) bool, the voxels of the surface's box, and (3,) float64, its lowest voxel.
    """
    from trimesh.remesh import subdivide_to_size

    low, high = np.round(vertices.min(axis=0) / voxel_m), np.round(vertices.max(axis=0) / voxel_m)
    solid = np.zeros((high - low + 1.0).astype(np.int64), np.bool_)
    corners = _divided(vertices[faces], voxel_m / _SHARE)
    begin = np.cumsum(_small_triangles(corners, voxel_m / _SHARE)) // _TRIANGLES_AT_ONCE
    groups = np.split(corners, np.flatnonzero(np.diff(begin)) + 1)
    for points in (vertices, *groups):
        if points.ndim == 3:
            own = np.arange(3 * len(points)).reshape(-1, 3)
            points = subdivide_to_size(points.reshape(-1, 3), own, voxel_m / _SHARE, _MOST_HALVINGS)[0]
        at = (np.round(points / voxel_m) - low).astype(np.int64)
        solid[tuple(at.T)] = True
    return solid, low


def _divided(corners: np.ndarray, longest_m: float) -> np.ndarray:
    """Triangles (M, 3, 3), those of too many small ones cut into four at the middles of their edges."""
    done = []
    while len(corners):
        large = _small_triangles(corners, longest_m) > _TRIANGLES_AT_ONCE
        done.append(corners[~large])
        a, b, c = np.moveaxis(corners[large], 1, 0)
        ab, bc, ca = 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)
        parts = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        corners = np.concatenate([np.stack(part, axis=1) for part in parts])
    return np.concatenate(done)


def _small_triangles(corners: np.ndarray, longest_m: float) -> np.ndarray:
    """(M,) about how many triangles with edges up to a length triangles (M, 3, 3) are divided into."""
    sides = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2).max(axis=1)
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    heights = areas / np.maximum(sides, 1e-300)
    return np.maximum(2.0 * sides / longest_m, 1.0) * np.maximum(2.0 * heights / longest_m, 1.0)
