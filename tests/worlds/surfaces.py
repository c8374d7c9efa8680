"""A hilly surface as a mesh and as a point cloud, as large as those that scanners write."""

from __future__ import annotations

from pathlib import Path

import numpy as np

_PLY = """ply
format binary_little_endian 1.0
element vertex {vertices}
property float x
property float y
property float z
element face {faces}
property list uchar int vertex_indices
end_header
"""
_PCD = """VERSION 0.7
FIELDS x y z
SIZE 4 4 4
TYPE F F F
COUNT 1 1 1
WIDTH {points}
HEIGHT 1
VIEWPOINT 0 0 0 1 0 0 0
POINTS {points}
DATA binary
"""


def hills(columns: int, rows: int, step_m: float) -> np.ndarray:
    """(columns × rows, 3) float32 metres: places of a lattice with this step, up to 4 m high at 0.1 m."""
    x, y = np.mgrid[:columns, :rows]
    z = 20.0 * (np.sin(x / 37.0) + np.cos(y / 23.0))
    return (np.stack((x, y, z), axis=-1).reshape(-1, 3) * step_m).astype(np.float32)


def write_mesh(path: Path, columns: int, rows: int, step_m: float) -> int:
    """A binary PLY of two triangles between each four of those places; the number of triangles."""
    at = np.arange(columns * rows).reshape(columns, rows)
    a, b, c, d = (part.ravel() for part in (at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]))
    corners = np.concatenate([np.stack((a, b, c), axis=1), np.stack((a, c, d), axis=1)])
    faces = np.zeros(len(corners), [("count", "u1"), ("corners", "<i4", 3)])
    faces["count"], faces["corners"] = 3, corners
    head = _PLY.format(vertices=columns * rows, faces=len(faces))
    path.write_bytes(head.encode() + hills(columns, rows, step_m).tobytes() + faces.tobytes())
    return len(faces)


def write_cloud(path: Path, columns: int, rows: int, step_m: float) -> int:
    """A binary PCD of those places; how many they are."""
    head = _PCD.format(points=columns * rows)
    path.write_bytes(head.encode() + hills(columns, rows, step_m).tobytes())
    return columns * rows
