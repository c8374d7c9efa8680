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
    voxel_m = options.need("voxel_size_m", "a mesh")
    fill, clearance_m = options.get("fill"), options.get("clearance_m") or 0.0
    vertices = np.asarray(mesh.vertices, np.float64)
    if not np.isfinite(vertices).all():
        raise RefusedError("a mesh whose vertices are finite")
    margin = math.ceil(clearance_m / voxel_m - 1e-9)
    checked_shape(np.ptp(vertices, axis=0) / voxel_m + 2.0 + 2.0 * margin)
    vertices = vertices - _INWARDS * voxel_m * np.asarray(mesh.vertex_normals)
    if y_is_up:
        vertices = np.column_stack((vertices[:, 0], -vertices[:, 2], vertices[:, 1]))
    mesh.vertices = vertices - 0.5 * voxel_m  # trimesh's voxels have their centres on multiples
    surface = mesh.voxelized(voxel_m, method="subdivide", max_iter=_MOST_HALVINGS)
    solid = np.asarray((surface.fill(method="holes") if fill is not False else surface).matrix)
    labels = np.full([n + 2 * margin for n in solid.shape], FREE, np.int8)
    inside = tuple(slice(margin, margin + n) for n in solid.shape)
    labels[inside][solid] = SOLID
    low = np.rint(surface.transform[:3, 3] / voxel_m) - margin
    x, y, z = (float(v) for v in low * voxel_m)
    return Voxels(labels, voxel_m, (x, y, z))
