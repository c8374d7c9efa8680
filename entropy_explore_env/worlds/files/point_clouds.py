"""Point clouds: PCD (ASCII, binary, compressed by LZF) read with NumPy, LAS with `las`, PLY with trimesh.

Clouds are in metres and z points up, unless `scale` (metres of a unit) and `up` say otherwise. A PCD's head
is read as PCL and its forerunners write it, versions .5 to .7: COUNT may lack, and fields with none are
skipped. A voxel is solid if a point lies in it, and with `gap_m` where points around it leave gaps of at most
that size. A cloud has no information about free space: all other voxels in its box count as free. It has no
resolution of its own. A PLY with faces is a mesh (`meshes`).
"""

from __future__ import annotations

import io
import math
import re
from pathlib import Path
from typing import NamedTuple

import numpy as np

from entropy_explore_env.worlds.files.voxels import (
    FREE,
    SOLID,
    Options,
    RefusedError,
    Voxels,
    checked_shape,
    content,
)

NEEDS = (("lzf", "python-neo-lzf"),)
_POINTS_AT_ONCE = 1 << 20
_MAX_SHRINKING = 64
"""LZF expands by about this factor at most; a header that states more is wrong."""
_MAX_HEAD_BYTES = 1 << 20
_DATA = re.compile(rb"^DATA[ \t]+(\w+)[^\n]*\n", re.MULTILINE | re.IGNORECASE)
_KINDS = {"F": "f", "I": "i", "U": "u"}
_KILOMETRE = 1000.0


class _Field(NamedTuple):
    """A field of a PCD's points: one number or several, `count`, or none."""

    name: str
    dtype: np.dtype
    count: int

    @property
    def width(self) -> int:
        """Bytes of the field in a point."""
        return self.dtype.itemsize * self.count


def read(path: Path, options: Options) -> Voxels:
    """Return the voxels that a PCD's points lie in."""
    data = content(path)
    found = _DATA.search(data[:_MAX_HEAD_BYTES])
    if found is None:
        raise RefusedError(f"a PCD with a line DATA in its first {_MAX_HEAD_BYTES >> 20} MiB")
    fields, points = _head(data[: found.start()], len(data))
    places = [next((n for n, each in enumerate(fields) if each.name == axis), None) for axis in "xyz"]
    if any(place is None or fields[place].count != 1 for place in places):
        raise RefusedError("a PCD with the fields x, y and z")
    body, at = data[found.end() :], [place for place in places if place is not None]
    return voxels_of(_coordinates(found[1].lower(), body, fields, points, at), options)


def _head(head: bytes, size: int) -> tuple[list[_Field], int]:
    """Return the fields and the number of points that a head states, checked against the file's bytes."""
    lines = head.decode("ascii", "replace").splitlines()
    words = {line.split()[0].upper(): line.split()[1:] for line in lines if line.strip()}
    names = words.get("FIELDS") or words["COLUMNS"]
    kinds = [
        f"<{_KINDS[kind.upper()]}{size}" for kind, size in zip(words["TYPE"], words["SIZE"], strict=True)
    ]
    counts = [int(count) for count in words.get("COUNT") or ["1"] * len(names)]
    fields = [
        _Field(name.lower(), np.dtype(kind), count)
        for name, kind, count in zip(names, kinds, counts, strict=True)
        if count > 0
    ]
    across = [int(words[name][0]) for name in ("WIDTH", "HEIGHT") if name in words]
    points = int(words["POINTS"][0]) if "POINTS" in words else math.prod(across)
    width = sum(field.width for field in fields)
    most = _MAX_SHRINKING * size
    if not (0 < points <= most and 0 < width <= 1 << 12 and points * width <= most + 4096):
        raise RefusedError("a PCD with as many points as its header says")
    return fields, points


def _coordinates(
    encoding: bytes, body: bytes, fields: list[_Field], points: int, at: list[int]
) -> np.ndarray:
    """Return the coordinates (N, 3) float64 of points.

    Args:
        encoding: As the line DATA names it.
        body: What follows that line.
        fields: Of a point, in order.
        points: How many the head states.
        at: Which of the fields are x, y and z.
    """
    before = np.cumsum([0, *(field.width for field in fields)]).tolist()
    if encoding == b"ascii":
        columns = [sum(field.count for field in fields[:n]) for n in at]
        rows = np.loadtxt(io.BytesIO(body), np.float64, usecols=columns, max_rows=points, ndmin=2)
        if len(rows) != points:
            raise RefusedError("a PCD with as many points as its header says")
        return rows
    if encoding == b"binary":
        kinds = [(str(n), field.dtype, (field.count,)) for n, field in enumerate(fields)]
        rows = np.frombuffer(body, np.dtype(kinds), points)
        return np.concatenate([rows[str(n)].astype(np.float64) for n in at], axis=1)
    if encoding != b"binary_compressed":
        raise RefusedError("a PCD whose DATA is ascii, binary or binary_compressed")
    import lzf

    packed, size = np.frombuffer(body, "<u4", 2).tolist()
    if size != points * before[-1]:
        raise RefusedError("a PCD with as many points as its header says")
    whole = lzf.decompress(body[8 : 8 + packed], size)  # field by field
    of_axes = [np.frombuffer(whole, fields[n].dtype, points, before[n] * points) for n in at]
    return np.stack([each.astype(np.float64) for each in of_axes], axis=1)


def upright(places: np.ndarray, options: Options, up: str = "z", unit_m: float = 1.0) -> np.ndarray:
    """Return places (N, 3) in metres with z up, by the options `scale` and `up`, or as the file has them.

    Args:
        places: In the file's units and axes.
        options: Those of the user.
        up: The file's axis that points up, "y" or "z".
        unit_m: The file's unit.
    """
    places = places * (options.get("scale") or unit_m)
    if (options.get("up") or up) == "z":
        return places
    return np.column_stack((places[:, 0], -places[:, 2], places[:, 1]))


def check_extent(extent_m: np.ndarray, voxel_m: float, options: Options) -> tuple[int, int, int]:
    """Return the shape that covers an extent (3,) in metres.

    Raises:
        RefusedError: It is too many voxels; of kilometres, the message asks whether they are millimetres.
    """
    try:
        return checked_shape(extent_m / voxel_m)
    except RefusedError as error:
        if options.get("scale") is not None or not _KILOMETRE <= extent_m.max() < math.inf:
            raise
        box = " × ".join(f"{edge:,.0f}" for edge in extent_m)
        asked = "is it in millimetres? scale=0.001 (--scale 0.001) says so"
        raise RefusedError(f"{error}; the box is {box} m: {asked}") from None


def voxels_of(points_m: np.ndarray, options: Options) -> Voxels:
    """Return voxels, on multiples of the voxel size, that points (N, 3) lie in; only finite ones count.

    Points are as the file has them: `scale` and `up` apply.
    """
    voxel_m = options.need("voxel_size_m", "a point cloud")
    points_m = upright(points_m, options)
    finite = np.isfinite(points_m).all(axis=1)
    if not finite.all():
        points_m = points_m[finite]
    if len(points_m) == 0:
        raise RefusedError("a point cloud with points in it")
    low = np.floor(points_m.min(axis=0) / voxel_m + 1e-9)
    extent = np.floor(points_m.max(axis=0) / voxel_m + 1e-9) - low + 1.0
    labels = np.full(check_extent(extent * voxel_m, voxel_m, options), FREE, np.int8)
    for first in range(0, len(points_m), _POINTS_AT_ONCE):
        some = points_m[first : first + _POINTS_AT_ONCE]
        index = (np.floor(some / voxel_m + 1e-9) - low).astype(np.int64)
        labels[tuple(index.T)] = SOLID
    gap_m = options.get("gap_m")
    if gap_m is not None:
        labels = _closed(labels, max(1, round(0.5 * gap_m / voxel_m)))
    x, y, z = (float(v) for v in low * voxel_m)
    if not all(math.isfinite(v) for v in (x, y, z)):
        raise RefusedError("a point cloud whose corner is finite")
    return Voxels(labels, voxel_m, (x, y, z))


def _closed(labels: np.ndarray, voxels: int) -> np.ndarray:
    """Return the labels (X, Y, Z) with what is solid closed by a cube; `voxels` is half of its edge."""
    from scipy import ndimage

    cube = np.ones((3, 3, 3), np.bool_)
    grown = ndimage.binary_dilation(labels == SOLID, cube, voxels)
    closed = ndimage.binary_erosion(grown, cube, voxels, border_value=1)
    return np.where(closed, np.int8(SOLID), labels)
