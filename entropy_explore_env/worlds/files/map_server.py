"""Floor plans of ROS's map_server: a YAML beside a PGM or PNG, read with PyYAML and Pillow.

The rules are those of http://wiki.ros.org/map_server (and of nav2_map_server, which keeps them): a pixel
of shade x in [0, 255] has the occupancy p = (255 - x)/255, or x/255 with `negate`.

    trinary  solid where p > occupied_thresh, free where p < free_thresh, unknown between
    scale    the same, but between the thresholds 1 to 99 % by how far p is between them; pixels that
             are transparent at all are unknown
    raw      x itself in percent, whatever `negate`; above 100 unknown

Shades are means over the colours; in trinary mode over colours and opacity. A world knows solid and free
only: in the modes with percentages, 50 % and more are solid.
"""

from __future__ import annotations

import math
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import Any

import numpy as np

from entropy_explore_env.validation import is_number
from entropy_explore_env.worlds.files.images import from_rows, opened, shades_of
from entropy_explore_env.worlds.files.voxels import (
    FREE,
    SOLID,
    UNKNOWN,
    Options,
    RefusedError,
    Voxels,
    content,
)

NEEDS = (("yaml", "pyyaml"),)
MAX_YAML_BYTES = 1 << 16
MODES = ("trinary", "scale", "raw")
_HALF_PERCENT = 50.0
_MAX_DEPTH = 4


def read(path: Path, options: Options) -> Voxels:
    """The plan, one voxel high; `origin` is the lower left corner of the image and its yaw."""
    del options
    about = _about(path)
    resolution = _number(about, "resolution", lambda v: v > 0)
    free = _number(about, "free_thresh", lambda v: 0 <= v <= 1)
    occupied = _number(about, "occupied_thresh", lambda v: 0 <= v <= 1)
    if free > occupied:
        raise RefusedError("a map whose free_thresh is at most its occupied_thresh")
    mode, negate = about.get("mode", "trinary"), about.get("negate", 0)
    if not isinstance(mode, str) or mode not in MODES:
        raise RefusedError("a map whose mode is one of " + ", ".join(MODES))
    if not isinstance(negate, bool | int) or negate not in (0, 1):
        raise RefusedError("a map whose negate is 0 or 1")
    x, y, yaw = _origin(about)
    shades, opacity = shades_of(opened(_image(path, about)), with_opacity=mode == "trinary")
    labels = labels_of(shades, opacity, mode, bool(negate), free, occupied)
    return Voxels(from_rows(labels)[:, :, None], resolution, (x, y, 0.0), yaw)


def labels_of(
    shades: np.ndarray,
    opacity: np.ndarray,
    mode: str,
    negate: bool,
    free_thresh: float,
    occupied_thresh: float,
) -> np.ndarray:
    """Labels (rows, columns) int8 of shades and opacity (rows, columns) in [0, 255]; opacity 0 = clear."""
    labels = np.full(shades.shape, UNKNOWN, np.int8)
    if mode == "raw":
        percent = np.rint(shades)
        labels[percent < _HALF_PERCENT] = FREE
        labels[(percent >= _HALF_PERCENT) & (percent <= 100)] = SOLID
        return labels
    p = shades / np.float32(255.0) if negate else (np.float32(255.0) - shades) / np.float32(255.0)
    labels[p < free_thresh] = FREE
    labels[p > occupied_thresh] = SOLID
    if mode == "scale":
        between = (p >= free_thresh) & (p <= occupied_thresh)
        share = (p - free_thresh) / max(occupied_thresh - free_thresh, 1e-9)
        labels[between] = np.where(1.0 + 98.0 * share[between] < _HALF_PERCENT, FREE, SOLID)
        labels[opacity < 255.0] = UNKNOWN
    return labels


def _about(path: Path) -> dict[str, Any]:
    """The entries of the YAML; aliases and tags, which no map needs, are refused before they are read."""
    import yaml

    data = content(path)
    if len(data) > MAX_YAML_BYTES:
        raise RefusedError(f"a YAML of at most {MAX_YAML_BYTES} bytes")
    depth = 0
    for event in yaml.parse(data, Loader=yaml.SafeLoader):
        depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
        if isinstance(event, yaml.AliasEvent) or getattr(event, "tag", None) or depth > _MAX_DEPTH:
            raise RefusedError("a YAML without aliases and tags, and of little depth")
    about = yaml.safe_load(data)
    if not isinstance(about, dict):
        raise RefusedError("a YAML of map_server")
    for name in ("image", "resolution", "origin", "occupied_thresh", "free_thresh"):
        if name not in about:
            raise RefusedError(f"a YAML of map_server with the entry {name}")
    return about


def _number(about: dict[str, Any], name: str, accepts: Any) -> float:  # noqa: ANN401
    value = about[name]
    if not is_number(value) or not math.isfinite(value) or not accepts(value):
        raise RefusedError(f"a map whose {name} is a number in its range")
    return float(value)


def _origin(about: dict[str, Any]) -> tuple[float, float, float]:
    origin = about["origin"]
    if not isinstance(origin, list) or len(origin) != 3 or not all(is_number(v) for v in origin):
        raise RefusedError("a map whose origin is three numbers (x, y, yaw)")
    x, y, yaw = (float(v) for v in origin)
    if not all(math.isfinite(v) for v in (x, y, yaw)):
        raise RefusedError("a map whose origin is three finite numbers (x, y, yaw)")
    return x, y, yaw


def _image(path: Path, about: dict[str, Any]) -> Path:
    """The image's path, which must lie in the YAML's folder, or in that of the file which it links to."""
    name, allowed = about["image"], "a map whose image is a .pgm or .png in the YAML's folder"
    if not isinstance(name, str) or "\0" in name:
        raise RefusedError(allowed)
    if PurePosixPath(name).is_absolute() or PureWindowsPath(name).drive or ".." in Path(name).parts:
        raise RefusedError(allowed)
    folder = path.parent.resolve()
    image = (folder / name).resolve()
    if not any(image.is_relative_to(allowed_in) for allowed_in in (folder, path.resolve().parent)):
        raise RefusedError(allowed)
    return image
