"""A small file of every kind, as bytes, written with independent writers or by hand."""

from __future__ import annotations

import io
import json
import struct
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

SHAPE = (7, 11, 5)
YAML = b"image: plan.pgm\nresolution: 0.1\norigin: [-1.0, 2.0, 0.5]\nnegate: 0\n"
YAML += b"occupied_thresh: 0.65\nfree_thresh: 0.196\nmode: trinary\n"


class Sample(NamedTuple):
    """A file and what lies beside it: name → bytes; the first is the one to load, with these options."""

    files: dict[str, bytes]
    options: dict[str, Any]


def plan(rows: int = 7, columns: int = 11, seed: int = 0) -> np.ndarray:
    """Return (rows, columns) uint8 shades of a plan: black walls, white floor, grey unknown."""
    shades = np.random.default_rng(seed).choice([0, 205, 254, 254, 254], (rows, columns))
    return shades.astype(np.uint8)


def sketch() -> np.ndarray:
    """Return a plan with nothing unknown, as it is read without a YAML."""
    return np.where(plan() == 205, 254, plan()).astype(np.uint8)


def pgm(shades: np.ndarray) -> bytes:
    """Return a PGM of (rows, columns) uint8 shades."""
    return b"P5\n%d %d\n255\n" % (shades.shape[1], shades.shape[0]) + shades.tobytes()


def image(pixels: np.ndarray, kind: str = "PNG") -> bytes:
    """Return an image of these pixels, of a kind by Pillow's name."""
    from PIL import Image

    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, kind)
    return buffer.getvalue()


def octomap_bytes(suffix: str) -> bytes:
    """Return an OctoMap tree, `.bt` or `.ot`."""
    import octomap

    tree = octomap.OcTree(0.2)
    labels = np.random.default_rng(0).choice([-1, 0, 0, 1], SHAPE)
    for voxel in np.argwhere(labels >= 0):
        tree.updateNode((voxel + 0.5) * 0.2, bool(labels[tuple(voxel)] == 1))
    tree.updateInnerOccupancy()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"map{suffix}"
        assert (tree.writeBinary if suffix == ".bt" else tree.write)(str(path).encode())
        return path.read_bytes()


def points(count: int = 60) -> np.ndarray:
    """Return (count, 3) float32 places."""
    return np.random.default_rng(1).uniform(0.0, SHAPE, (count, 3)).astype(np.float32)


def pcd(encoding: str) -> bytes:
    """Return a PCD of `points`."""
    from pypcd4.pypcd4 import Encoding, PointCloud

    buffer = io.BytesIO()
    PointCloud.from_xyz_points(points()).save(buffer, Encoding(encoding))
    return buffer.getvalue()


def ply(binary: bool) -> bytes:
    """Return a PLY of points only, written by hand."""
    some = points()
    form = b"binary_little_endian" if binary else b"ascii"
    head = b"ply\nformat %s 1.0\nelement vertex %d\n" % (form, len(some))
    head += b"property float x\nproperty float y\nproperty float z\nend_header\n"
    return head + (some.tobytes() if binary else b"".join(b"%g %g %g\n" % tuple(p) for p in some.tolist()))


def las(compressed: bool) -> bytes:
    """Return a laser scan of `points`, `.las` or `.laz`."""
    import laspy

    scan = laspy.create(point_format=3, file_version="1.4")
    scan.header.scales = np.full(3, 0.001)
    scan.x, scan.y, scan.z = points().T.astype(np.float64)
    buffer = io.BytesIO()
    scan.write(buffer, do_compress=compressed)
    return buffer.getvalue()


def mesh(kind: str) -> bytes:
    """Return a box and a ramp in a format of trimesh."""
    import trimesh

    box = trimesh.creation.box(bounds=[[0, 0, 0], [2, 3, 1]])
    ramp = trimesh.Trimesh(
        [[4, 0, 0], [7, 0, 0], [4, 5, 0], [4, 0, 4]], [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]
    )
    both: Any = trimesh.util.concatenate([box, ramp])
    written = both.export(file_type=kind)
    return written.encode() if isinstance(written, str) else written


def heights(rows: int = 11, columns: int = 7) -> np.ndarray:
    """Return (rows, columns) float32 metres."""
    return np.random.default_rng(2).uniform(10.0, 14.0, (rows, columns)).astype(np.float32)


def esri_grid() -> bytes:
    """Return an ESRI ASCII grid of `heights`, by hand."""
    rows = heights()
    head = f"ncols {rows.shape[1]}\nnrows {rows.shape[0]}\nxllcorner 100\nyllcorner 200\ncellsize 1\n"
    return (head + "\n".join(" ".join(f"{height:.3f}" for height in row) for row in rows)).encode()


def npz(**arrays: Any) -> bytes:  # noqa: ANN401 - whatever an archive may hold
    """Return a NumPy archive of these arrays."""
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays)
    return buffer.getvalue()


def geotiff(
    samples: np.ndarray,
    scale: tuple[float, ...] = (1.0, 1.0, 0.0),
    tie: tuple[float, ...] = (0.0, 0.0, 0.0, 100.0, 200.0, 0.0),
    model: int = 1,
    directory: tuple[int, ...] | None = None,
    **more: Any,  # noqa: ANN401 - options of tifffile
) -> bytes:
    """Return a GeoTIFF of (rows, columns) heights; its tags of place and its keys may be empty."""
    import tifffile

    keys = (1, 1, 0, 1, 1024, 0, 1, model) if directory is None else directory
    tags = [(33550, "d", 3, scale, True), (33922, "d", 6, tie, True), (34735, "H", len(keys), keys, True)]
    tags = [tag for tag in tags if tag[3]]
    tags += more.pop("tags", [])
    buffer = io.BytesIO()
    tifffile.imwrite(buffer, samples, extratags=tags, metadata=None, **more)
    return buffer.getvalue()


def saved_world() -> bytes:
    """Return a world of this library, with a ceiling."""
    from entropy_explore_env.settings.grid import Grid
    from entropy_explore_env.worlds.load import save_world
    from entropy_explore_env.worlds.world import World

    occupied = np.random.default_rng(3).random(SHAPE) < 0.3
    ceiling = np.random.default_rng(4).integers(1, 6, SHAPE[:2]).astype(np.int32)
    world = World(Grid(SHAPE, 0.3, (1.0, -2.0, 0.1)), occupied, "lab", ceiling, 0.7)
    with tempfile.TemporaryDirectory() as folder:
        save_world(world, Path(folder) / "lab.npz")
        return (Path(folder) / "lab.npz").read_bytes()


def glb_of_json(gltf: dict[str, Any], blob: bytes = b"") -> bytes:
    """Return a GLB with this JSON, for what no writer would write."""
    text = json.dumps(gltf).encode()
    text += b" " * (-len(text) % 4)
    body = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(blob), 0x004E4942) + blob
    return struct.pack("<III", 0x46546C67, 2, 12 + len(body)) + body


_CELL = {"voxel_size_m": 0.5}

SAMPLES: dict[str, Callable[[], list[Sample]]] = {
    "octomap": lambda: [Sample({f"map{suffix}": octomap_bytes(suffix)}, {}) for suffix in (".bt", ".ot")],
    "map_server": lambda: [
        Sample({"map.yaml": YAML, "plan.pgm": pgm(plan())}, {}),
        Sample({"map.yaml": YAML.replace(b"pgm", b"png"), "plan.png": image(plan())}, {}),
    ],
    "image": lambda: [Sample({"plan.png": image(sketch())}, {}), Sample({"plan.pgm": pgm(sketch())}, {})],
    "height png": lambda: [
        Sample(
            {"hills.png": image(plan().astype(np.uint16) * np.uint16(200))},
            {"resolution_m": 1.0, "elevation_step_m": 0.001},
        )
    ],
    "pcd": lambda: [
        Sample({"cloud.pcd": pcd(each)}, _CELL) for each in ("ascii", "binary", "binary_compressed")
    ],
    "ply": lambda: [
        Sample({"cloud.ply": ply(True)}, _CELL),
        Sample({"cloud.ply": ply(False)}, _CELL),
        Sample({"box.ply": mesh("ply")}, _CELL),
    ],
    "obj": lambda: [Sample({"box.obj": mesh("obj")}, _CELL)],
    "stl": lambda: [Sample({"box.stl": mesh(kind)}, _CELL) for kind in ("stl", "stl_ascii")],
    "glb": lambda: [Sample({"box.glb": mesh("glb")}, _CELL)],
    "height npz": lambda: [Sample({"hills.npz": npz(elevation=heights(), spacing_m=np.float64(0.5))}, {})],
    "geotiff": lambda: [
        Sample({"hills.tif": geotiff(heights())}, {}),
        Sample({"hills.tif": geotiff(heights(), compression="zlib")}, {}),
        Sample({"hills.tif": geotiff(heights(), compression="lzw", predictor=3)}, {}),
    ],
    "world npz": lambda: [Sample({"lab.npz": saved_world()}, {})],
    "las": lambda: [Sample({"scan.las": las(False)}, _CELL), Sample({"scan.laz": las(True)}, _CELL)],
    "dae": lambda: [Sample({"box.dae": mesh("dae")}, _CELL)],
    "esri grid": lambda: [Sample({"hills.asc": esri_grid()}, {})],
    "other images": lambda: [
        Sample({f"plan.{suffix}": image(sketch(), kind)}, {})
        for suffix, kind in (("jpg", "JPEG"), ("bmp", "BMP"), ("gif", "GIF"))
    ],
}
"""Format of worlds → its files, of every kind that is read."""
