"""Floor plans of ROS's map_server: a YAML beside an image, read with PyYAML and Pillow.

A pixel of shade x in [0, 255], the mean of its colours, has the occupancy p = (255 - x)/255, or x/255 with
`negate`:

    trinary  solid where p ≥ occupied_thresh, free where p ≤ free_thresh, unknown between
    scale    the same, but between the thresholds 0 to 100 % by how far p is between them; shade 205, which
             savers of trinary maps write for unknown, is unknown (other than in Nav2, where it is about 0 %)
    raw      x itself in percent, whatever `negate`; above 100 unknown

Pixels that are transparent at all are unknown. So reads Nav2 since 2025. With `map_rule="map_server"` plans
are read as before, and as http://wiki.ros.org/map_server has it: thresholds themselves lie between, and
opacity is one of the values whose mean is the shade in trinary mode, and ignored in raw mode. The options
`occupied_below` and `free_above`, shades, stand in for the thresholds. A world knows solid and free only: in
the modes with percentages, 50 % and more are solid.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path, PureWindowsPath
from typing import Any

import numpy as np

from entropy_explore_env.worlds.files.images import SAVED_AS_UNKNOWN, WHITE, limits, opened, plan_of
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
RULES = ("nav2", "map_server")
"""Values of the option `map_rule`; the first is the default."""
_YES, _NO = ("true", "yes", "on", "y"), ("false", "no", "off", "n")
_HALF_PERCENT = 50.0
_MAX_DEPTH = 4
_ROUNDING = 1e-6


def read(path: Path, options: Options) -> Voxels:
    """Return the plan, one voxel high; `origin` is the lower left corner of the image and its yaw."""
    about = _about(path)
    resolution = _number(about, "resolution", lambda v: v > 0)
    free = _number(about, "free_thresh", lambda v: 0 <= v <= 1)
    occupied = _number(about, "occupied_thresh", lambda v: 0 <= v <= 1)
    if free > occupied:
        raise RefusedError("a map whose free_thresh is at most its occupied_thresh")
    mode, negate = str(about.get("mode", MODES[0])).strip().lower(), _truth(about.get("negate", "0"))
    if mode not in MODES:
        raise RefusedError("a map whose mode is one of " + ", ".join(MODES))
    x, y, yaw = _origin(about)
    strict = options.get("map_rule") == "map_server"
    given = limits(options)
    image, note = _image(path, about)
    plan = plan_of(
        opened(image),
        labelling(mode, negate, free, occupied, strict, given),
        {"trinary": "averaged", "raw": "ignored"}.get(mode, "unknown") if strict else "unknown",
        with_notes=mode != "raw" and given == (None, None),
    )
    right, up = (n * resolution for n in plan.corner)
    corner = (
        x + right * math.cos(yaw) - up * math.sin(yaw),
        y + right * math.sin(yaw) + up * math.cos(yaw),
        0.0,
    )
    return Voxels(plan.labels[:, :, None], resolution, corner, yaw, notes=(*note, *plan.notes))


def labelling(
    mode: str,
    negate: bool,
    free_thresh: float,
    occupied_thresh: float,
    strict: bool = False,
    given: tuple[float | None, float | None] = (None, None),
) -> Callable[[np.ndarray], np.ndarray]:
    """Return a function from shades (N,) in [0, 255] to labels (N,) int8.

    Args:
        mode: One of MODES.
        negate: Whether bright is solid.
        free_thresh: Occupancy up to which a pixel is free.
        occupied_thresh: Occupancy from which on it is solid.
        strict: Whether the thresholds themselves lie between, as they did before Nav2's rule of 2025.
        given: `occupied_below` and `free_above`, shades after `negate`, which stand in for thresholds.
    """

    def label(shades: np.ndarray) -> np.ndarray:
        labels = np.full(shades.shape, UNKNOWN, np.int8)
        if mode == "raw":
            percent = np.rint(shades)
            labels[percent < _HALF_PERCENT] = FREE
            labels[(percent >= _HALF_PERCENT) & (percent <= 100)] = SOLID
            return labels
        light = WHITE - shades if negate else shades
        p = ((WHITE - light) / WHITE).astype(np.float32)
        free, solid = (p <= np.float32(free_thresh)), (p >= np.float32(occupied_thresh))
        if strict:
            free, solid = (p < np.float32(free_thresh)), (p > np.float32(occupied_thresh))
        below, above = given
        free = free if above is None else light > above
        solid = solid if below is None else light < below
        if mode == "scale":
            share = (p - free_thresh) / max(occupied_thresh - free_thresh, 1e-9)
            labels[:] = np.where(share < 0.5, FREE, SOLID)
            if not strict:
                labels[np.abs(shades - SAVED_AS_UNKNOWN) < _ROUNDING] = UNKNOWN
        labels[free] = FREE
        labels[solid] = SOLID
        return labels

    return label


def image_of(path: Path) -> Path:
    """Return the path of the image that a YAML names.

    Raises:
        RefusedError: It is no YAML of map_server, or its image is not there.
    """
    return _image(path, _about(path))[0]


def _about(path: Path) -> dict[str, Any]:
    """Return the entries of the YAML as texts, since 5e-2 and "0.05" are numbers to map_server.

    Aliases and tags, which no map needs, are refused before they are read.
    """
    import yaml

    data = content(path)
    if len(data) > MAX_YAML_BYTES:
        raise RefusedError(f"a YAML of at most {MAX_YAML_BYTES} bytes")
    depth = 0
    try:
        for event in yaml.parse(data, Loader=yaml.BaseLoader):
            depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
            if isinstance(event, yaml.AliasEvent) or getattr(event, "tag", None) or depth > _MAX_DEPTH:
                raise RefusedError("a YAML without aliases and tags, and of little depth")
        about = yaml.load(data, Loader=yaml.BaseLoader)
    except yaml.YAMLError as error:
        raise RefusedError(f"a file in YAML, but {' '.join(str(error).split())[:200]}") from None
    if not isinstance(about, dict):
        raise RefusedError("a YAML of map_server")
    for name in ("image", "resolution", "origin", "occupied_thresh", "free_thresh"):
        if name not in about:
            raise RefusedError(f"a YAML of map_server with the entry {name}")
    return about


def _as_number(text: Any) -> float:  # noqa: ANN401 - texts, lists and mappings
    """Return a finite number; NaN where it is none."""
    try:
        value = float(text) if isinstance(text, str) and "_" not in text else math.nan
    except ValueError:
        return math.nan
    return value if math.isfinite(value) else math.nan


def _number(about: dict[str, Any], name: str, accepts: Callable[[float], bool]) -> float:
    value = _as_number(about[name])
    if not accepts(value):
        raise RefusedError(f"a map whose {name} is a number in its range")
    return value


def _truth(text: Any) -> bool:  # noqa: ANN401 - texts, lists and mappings
    """Return whether `negate` says yes, in words or as a number."""
    word = text.strip().lower() if isinstance(text, str) else ""
    if word in _YES or word in _NO:
        return word in _YES
    if _as_number(word) not in (0.0, 1.0):
        raise RefusedError("a map whose negate is 0 or 1, true or false")
    return _as_number(word) == 1.0


def _origin(about: dict[str, Any]) -> tuple[float, float, float]:
    origin = about["origin"]
    numbers = [_as_number(each) for each in origin] if isinstance(origin, list) else []
    if len(numbers) != 3 or not all(math.isfinite(v) for v in numbers):
        raise RefusedError("a map whose origin is three finite numbers (x, y, yaw)")
    return numbers[0], numbers[1], numbers[2]


def _image(path: Path, about: dict[str, Any]) -> tuple[Path, tuple[str, ...]]:
    """Return the image's path, and a note where it is not the one that the YAML names.

    It must lie in the YAML's folder, or in that of the file which the YAML links to. Where the entry leads
    elsewhere, or differs in case, a file of that name beside the YAML is taken.
    """
    entry = about["image"]
    name = PureWindowsPath(entry).name if isinstance(entry, str) and "\0" not in entry else ""
    if not name:
        raise RefusedError("a map whose entry image names a file in the YAML's folder")
    folder = path.parent.resolve()
    folders = (folder, path.resolve().parent)
    named = Path(entry)
    beside = sorted(folder.iterdir(), key=lambda file: (file.name != name, file.name))
    alike = [file for file in beside if file.name.lower() == name.lower()]
    for image in (folder / named, *alike):
        whole = image.resolve()
        if whole.is_file() and any(whole.is_relative_to(each) for each in folders):
            if image == folder / named:
                return whole, ()
            return whole, (f"the image {entry} is read from {image.name} beside the YAML",)
    raise RefusedError(
        f"a map whose file {name} exists in the YAML's folder; its entry image is {entry[:200]}"
    )
