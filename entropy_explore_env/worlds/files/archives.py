"""NumPy archives, `.npz`: a World saved without loss, or a height map.

A saved world has the entries `format` ("entropy_explore_env world"), `version` (1), `shape` (3 int64),
`occupied` (uint8: bits of the voxels in C order, numpy.packbits), `voxel_size_m`, `origin_m` (3), `yaw_rad`
(float64), `name` and, where the world has them, `ceiling` (X, Y) int32, `unknown` and `unreadable`
(uint8: bits as of `occupied`, some of those that are set, none in both). A height map has an array
`elevation`, or one 2-D array of any name, in metres: rows from north to south, as in an image; its spacing is
the entry `spacing_m` (one number, or x and y) or the option `resolution_m`.
"""

from __future__ import annotations

import io
import math
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from entropy_explore_env.worlds.files.elevation import MAX_SAMPLES, columns_of_rows
from entropy_explore_env.worlds.files.voxels import (
    FREE,
    SOLID,
    UNKNOWN,
    UNREADABLE,
    Options,
    RefusedError,
    Voxels,
    checked_shape,
    content,
)

NEEDS = ()
FORMAT, VERSION = "entropy_explore_env world", 1
MAX_MEMBERS = 32
MAX_MEMBER_BYTES = 256 << 20
MAX_NAME = 256
_SOME_SOLID = {"unknown": UNKNOWN, "unreadable": UNREADABLE}


def saved(world: Voxels, **beside: Any) -> bytes:  # noqa: ANN401 - arrays and numbers
    """Return the archive of a world, with other entries beside it, which readers of worlds leave alone."""
    entries: dict[str, Any] = {
        "format": FORMAT,
        "version": VERSION,
        "shape": np.asarray(world.labels.shape, np.int64),
        "occupied": np.packbits(world.labels != FREE),
        "voxel_size_m": np.float64(world.voxel_size_m),
        "origin_m": np.asarray(world.origin_m, np.float64),
        "yaw_rad": np.float64(world.yaw_rad),
        "name": (world.name or "")[:MAX_NAME],
    }
    if world.ceiling is not None:
        entries["ceiling"] = world.ceiling
    for name, label in _SOME_SOLID.items():
        if (mask := world.labels == label).any():
            entries[name] = np.packbits(mask)
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **entries, **beside)
    return buffer.getvalue()


def read(path: Path, options: Options) -> Voxels:
    """Return a saved world, or the voxels of a height map."""
    entries = arrays(content(path))
    if "format" in entries:
        return _world(entries)
    return _height_map(entries, options)


def restored(data: bytes) -> Voxels:
    """Return the world whose archive `saved` made.

    Raises:
        RefusedError: As for `arrays`, or it holds no saved world.
    """
    entries = arrays(data)
    if "format" not in entries:
        raise RefusedError("a saved world")
    return _world(entries)


def arrays(data: bytes) -> dict[str, np.ndarray]:
    """Return the arrays of an archive, whose sizes in header and archive must agree.

    Raises:
        RefusedError: They are too many or too large, or hold objects. A broken archive raises whatever
            zipfile and NumPy raise.
    """
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        members = archive.infolist()
        if len(members) > MAX_MEMBERS or sum(each.file_size for each in members) > MAX_MEMBER_BYTES:
            raise RefusedError(f"an archive of at most {MAX_MEMBERS} arrays and {MAX_MEMBER_BYTES >> 20} MiB")
        return {each.filename.removesuffix(".npy"): _array(archive, each) for each in members}


def _array(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> np.ndarray:
    with archive.open(member) as file:
        version = np.lib.format.read_magic(file)
        if version not in ((1, 0), (2, 0)):
            raise RefusedError("an archive of plain arrays")
        headers = (np.lib.format.read_array_header_1_0, np.lib.format.read_array_header_2_0)
        shape, _, dtype = headers[version[0] - 1](file)
        if dtype.hasobject or file.tell() + math.prod(shape) * dtype.itemsize != member.file_size:
            raise RefusedError("an archive of plain arrays, each as large as its header says")
    with archive.open(member) as file:
        return np.lib.format.read_array(file, allow_pickle=False)


def _world(entries: dict[str, np.ndarray]) -> Voxels:
    if str(entries["format"]) != FORMAT or int(entries["version"]) != VERSION:
        raise RefusedError(f"a saved world of format version {VERSION}")
    shape = checked_shape(entries["shape"].astype(np.float64))
    ceiling = entries.get("ceiling")
    if ceiling is not None and not _fits(ceiling, shape):
        raise RefusedError("a saved world with a ceiling for each column")
    labels = _bits(entries["occupied"], shape).view(np.int8)
    for name, label in _SOME_SOLID.items():
        if name in entries:
            mask = _bits(entries[name], shape).view(np.bool_)
            if (labels[mask] != SOLID).any():
                raise RefusedError(f"a saved world whose {name} voxels count as solid")
            labels[mask] = label
    x, y, z = (float(v) for v in entries["origin_m"])
    edge, yaw = float(entries["voxel_size_m"]), float(entries["yaw_rad"])
    if not (0 < edge < math.inf and all(math.isfinite(v) for v in (x, y, z, yaw))):
        raise RefusedError("a saved world with a voxel size > 0 and a finite place")
    return Voxels(labels, edge, (x, y, z), yaw, ceiling, str(entries["name"])[:MAX_NAME])


def _bits(packed: np.ndarray, shape: tuple[int, int, int]) -> np.ndarray:
    """Return (X, Y, Z) uint8, 0 or 1, of packed bits."""
    if packed.dtype != np.uint8 or packed.shape != (math.ceil(math.prod(shape) / 8),):
        raise RefusedError("a saved world with a bit for each voxel")
    return np.unpackbits(packed, count=math.prod(shape)).reshape(shape)


def _fits(ceiling: np.ndarray, shape: tuple[int, int, int]) -> bool:
    """Return whether a ceiling has a valid layer for each column."""
    if ceiling.dtype != np.int32 or ceiling.shape != shape[:2]:
        return False
    return bool(ceiling.min() >= 0 and ceiling.max() <= shape[2])


def _height_map(entries: dict[str, np.ndarray], options: Options) -> Voxels:
    flat = [name for name, array in entries.items() if array.ndim == 2]
    names = ["elevation"] if "elevation" in flat else flat
    if len(names) != 1 or entries[names[0]].dtype.kind not in "iuf":
        raise RefusedError(
            "a saved world, or an archive with an array `elevation` or one 2-D array of numbers"
        )
    rows = entries[names[0]]
    if rows.size > MAX_SAMPLES:
        raise RefusedError(f"a height map of at most {MAX_SAMPLES} samples")
    if "spacing_m" in entries:
        steps = np.broadcast_to(entries["spacing_m"].astype(np.float64), (2,))
    else:
        steps = np.full(2, options.need("resolution_m", "a height map without an entry `spacing_m`"))
    spacing = (float(steps[0]), float(steps[1]))
    if not all(0 < step < math.inf for step in spacing):
        raise RefusedError("a height map whose spacing_m is > 0")
    return columns_of_rows(rows.astype(np.float64), spacing, options)


assert (FREE, SOLID) == (0, 1)  # bits are labels
