"""From a scenario to its world: made by a recipe from a world number of the split, or read from a file."""

from __future__ import annotations

import contextlib
import dataclasses
import warnings
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from entropy_explore_env.errors import SettingError, WorldError, WorldWarning, did_you_mean
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.settings.scenarios import find_scenario
from entropy_explore_env.settings.validation import check_instance, checked_path, is_whole
from entropy_explore_env.worlds.files.archives import restored, saved
from entropy_explore_env.worlds.files.jacksboro import NAME as JACKSBORO
from entropy_explore_env.worlds.files.map_server import image_of
from entropy_explore_env.worlds.files.process import Format, Limits, read_apart
from entropy_explore_env.worlds.files.resampling import resampled
from entropy_explore_env.worlds.files.voxels import (
    FREE,
    MAX_FILE_VOXELS,
    UNKNOWN,
    UNREADABLE,
    RefusedError,
    Voxels,
)
from entropy_explore_env.worlds.formats import (
    FORMATS,
    IMAGE,
    JACKSBORO_FORMAT,
    NAMES,
    OCTOMAP,
    LoadOptions,
    check_options,
    format_of,
)
from entropy_explore_env.worlds.public.fetching import public_file
from entropy_explore_env.worlds.public.table import PUBLIC, PublicWorld
from entropy_explore_env.worlds.recipes.catalogue import RECIPES
from entropy_explore_env.worlds.recipes.rooms import empty
from entropy_explore_env.worlds.splits import draw_world_number
from entropy_explore_env.worlds.world import World
from entropy_explore_env.writing import write_atomically

if TYPE_CHECKING:
    from typing_extensions import Unpack


def load_world(
    path: Path | str,
    voxel_size_m: float | None = None,
    height_m: float | None = None,
    **options: Unpack[LoadOptions],
) -> World:
    """Return the world in a file; its voxels lie in the file's frame, in metres. Unknown space is solid.

    By suffix: OctoMap (`.bt`, `.ot`), map_server (`.yaml`, `.yml`), plans as images and 16-bit height maps
    (`.png`, `.pgm`, `.jpg`, `.bmp`, `.gif`), point clouds (`.pcd`, `.ply`), meshes (`.obj`, `.stl`, `.glb`,
    `.ply`), height maps (`.npz`, `.tif`, `.tiff`), worlds of `save_world` (`.npz`). By name, without a
    suffix: matplotlib's elevation model `jacksboro`, and public worlds (`worlds/public/table.py`), whose
    files are fetched once. Each format is described in its file in `worlds/files`. Settings that do not apply
    to a file are refused.

    Args:
        path: The file, `jacksboro`, or the name of a public world.
        voxel_size_m: Edge of the voxels wanted; None = that of the table for a public world, and for others
            the file's own, which clouds and meshes do not have. Where voxels are resampled, one is free if at
            least half of it is known to be free and less than a quarter of it is occupied, so that thin walls
            stay.
        height_m: Plans are extruded to this height; None = they stay 2-D.
        resolution_m: Edge of an image's pixel (None = 0.05); spacing of a height map that does not state it.
        negate: Images: bright pixels are solid.
        occupied_below: Images and map_server: pixels darker than this shade, 0 to 255, are solid. None =
            127.5, or by the YAML's threshold.
        free_above: Images and map_server: pixels lighter than this shade are free, and those between unknown.
            None = all that are not solid, or by the YAML's threshold.
        map_rule: map_server: "nav2" (the default), thresholds count and transparent pixels are unknown; or
            "map_server", the rule before 2025, thresholds do not count and opacity is averaged with colours.
        elevation_step_m: 16-bit images: height of one count; None = 1.
        clearance_m: Height maps: sky above the highest ground (None = 5 voxels, or up to the ceiling);
            meshes: free space around them (None = none).
        ceiling_m: Height maps: the exposure surface above the ground (World.ceiling); None = none.
        fill: Meshes: whether the space that the surface encloses is solid; None = yes.
        inside: Meshes: it is a building drawn by its inner walls: what the surface encloses is free, all else
            solid.
        scale: Meshes and point clouds: metres of a unit, 0.001 for millimetres; None = as the file says, or
            1.
        gap_m: Point clouds: gaps between points that are at most this wide are solid, so that surfaces stop
            rays; None = only voxels with points are solid.
        up: Meshes and point clouds: the axis that points up, "y" or "z"; None = as the file says, or z.
        read_limit_s: Limit of the processor time for reading; None = 1.5 s, and 20 s for each MiB. On Windows
            reading ends after ten times as much elapsed time and a minute.
        read_memory_mib: Limit of the memory of the process that reads; None = 448 MiB, and 16 for each MiB
            of the file, of OctoMaps 512, up to 4096 in all. Voxels are only made at the wanted size. It holds
            where the system has /proc, as Linux does; on macOS and Windows memory is not limited.

    Raises:
        WorldError: The file is missing, too large, broken, of no known kind or has no free space, or a public
            world cannot be fetched.
        SettingError: A setting is unknown, out of its range, missing, or does not apply to this file.
        MissingExtraError: The package that reads this format is not installed.

    Warns:
        WorldWarning: The file was read in a way that its author may not have meant: of a plan of shades that
            map savers write for unknown, and of margins that were cropped.
    """
    return _load(path, {"voxel_size_m": voxel_size_m, "height_m": height_m, **options})


def load_octomap(
    path: Path | str, voxel_size_m: float | None = None, **options: Unpack[LoadOptions]
) -> World:
    """Return the world in an OctoMap tree, whatever its suffix; see `load_world`."""
    return _load(path, {"voxel_size_m": voxel_size_m, **options}, OCTOMAP)


def _load(path: Path | str, options: dict[str, Any], form: Format | None = None) -> World:
    """Return the world in a file; None = its suffix says the format."""
    check_options(options)
    height_m = options.pop("height_m", None)
    limits = Limits(options.pop("read_limit_s", None), options.pop("read_memory_mib", None))
    path = checked_path("world file", path)
    if form is None and str(path) == JACKSBORO:
        voxels = read_apart(JACKSBORO_FORMAT, JACKSBORO, options, limits)
    elif form is None and str(path) in PUBLIC:
        options = _with_defaults(PUBLIC[str(path)], options)
        file = public_file(str(path))
        voxels = read_apart(format_of(file), file, options, limits)
        voxels = dataclasses.replace(voxels, name=str(path), notes=())  # its table says how it is meant
    else:
        voxels = read_apart(form or format_of(path), path.absolute(), options, limits)
    return _world(voxels, str(path), options["voxel_size_m"], height_m)


def _with_defaults(world: PublicWorld, options: dict[str, Any]) -> dict[str, Any]:
    """Return the options of reading a public world: those given, else those of its table."""
    given = {name: value for name, value in options.items() if value is not None}
    return {"voxel_size_m": world.grid.voxel_size_m, **world.options, **given}


def save_world(world: World, path: Path | str) -> None:
    """Write a world to an `.npz`, from which `load_world` restores it without loss.

    Raises:
        SettingError: It is no World, or no path.
        OSError: The file cannot be written.
    """
    check_instance("world", world, World)
    write_atomically(checked_path("path", path), world_bytes(world))


def world_bytes(world: World) -> bytes:
    """Return the content of the file that `save_world` writes."""
    labels = world.occupied.astype(np.int8)
    for mask, label in ((world.unknown, UNKNOWN), (world.unreadable, UNREADABLE)):
        if mask is not None:
            labels[mask] = label
    voxels = Voxels(
        labels,
        world.grid.voxel_size_m,
        world.grid.origin_m,
        world.yaw_rad,
        world.ceiling,
        world.name,
    )
    return saved(voxels)


def world_from_bytes(data: bytes) -> World:
    """Restore a world from `world_bytes`. Nothing in the bytes is executed.

    Raises:
        RefusedError: It is no saved world. A broken archive raises whatever zipfile and NumPy raise.
    """
    return _world(restored(data), "", None, None)


_NO_SPACE = "a map with free space at this voxel size"
_SHADES = " (pixels darker than half of white are solid; occupied_below, --occupied-below, sets the limit)"


def _world(voxels: Voxels, path: str, voxel_size_m: float | None, height_m: float | None) -> World:
    """Return the world of a file's voxels, resampled and extruded."""
    size_m = voxel_size_m or voxels.voxel_size_m
    try:
        labels, ceiling = resampled(voxels, size_m)
    except RefusedError as error:
        raise WorldError("voxel_size_m", size_m, str(error)) from None
    if labels.size > MAX_FILE_VOXELS:
        allowed = (
            f"a map of at most {MAX_FILE_VOXELS} of its {labels.size} voxels; a larger voxel_size_m has fewer"
        )
        raise WorldError("world file", path, allowed)
    if (labels != FREE).all():
        is_image = FORMATS.get(Path(path).suffix.lower()) is IMAGE
        reasons = "".join(f"; {note}" for note in voxels.notes)
        raise WorldError("world file", path, _NO_SPACE + (_SHADES if is_image else "") + reasons)
    for note in voxels.notes:
        warnings.warn(f"{path}: {note}", WorldWarning, stacklevel=4)
    if height_m is not None:
        if labels.shape[2] != 1:
            raise SettingError("height_m", height_m, "None: the file's world is 3-D already")
        layers = round(height_m / size_m)
        most = MAX_FILE_VOXELS // labels.size
        if not 2 <= layers <= most:
            raise SettingError("height_m", height_m, f"from 2 to {most} voxels of {size_m} m")
        labels = np.repeat(labels, layers, axis=2)
    shape = (int(labels.shape[0]), int(labels.shape[1]), int(labels.shape[2]))
    grid = Grid(shape, float(size_m), voxels.origin_m)
    unknown, unreadable = labels == UNKNOWN, labels == UNREADABLE
    return World(
        grid,
        labels != FREE,
        voxels.name or Path(path).stem,
        ceiling,
        voxels.yaw_rad,
        unknown if unknown.any() else None,
        unreadable if unreadable.any() else None,
    )


def make_world(scenario: str | Scenario, world: int | np.random.Generator) -> World:
    """Return the true world of a mission: `make_world("office", 3)` is the office's world number 3.

    A world without random elements is the same for all numbers.

    Args:
        scenario: A scenario, or its name. Its `world` names a recipe or a file.
        world: A world number (worlds/splits.py), where it names a recipe; or a random generator, of which the
            number in the scenario's split is drawn.

    Raises:
        SettingError: No scenario, recipe or file has this name, or the number is not a whole number ≥ 0.
        WorldError: The file cannot be used, or the grid is too small for the recipe.
    """
    scenario = find_scenario(scenario)
    drawn = isinstance(world, np.random.Generator)
    if scenario.world not in RECIPES:
        if drawn:
            return world_from_file(scenario.world, scenario.grid.voxel_size_m)
        raise SettingError("Scenario.world", scenario.world, "a recipe: " + ", ".join(RECIPES))
    number = draw_world_number(scenario.split, world) if drawn else world
    if not is_whole(number, 0):
        raise SettingError("number", number, "a whole number ≥ 0")
    if scenario.world == "empty":
        return _empty_world(scenario)
    return RECIPES[scenario.world](scenario.grid, np.random.default_rng(np.random.SeedSequence(number)))


@lru_cache(maxsize=8)
def _empty_world(scenario: Scenario) -> World:
    return empty(scenario.grid, np.random.default_rng(0))


def world_from_file(path: Path | str, voxel_size_m: float, **options: Any) -> World:  # noqa: ANN401 - as load_world's
    """Return the world in a file, resampled; cached, so that many missions read it once.

    Args:
        path: As for `load_world`.
        voxel_size_m: Edge of the voxels wanted.
        **options: Others of `load_world`.

    Raises:
        SettingError: The file's kind is not known, or an option is unknown or not allowed.
        WorldError: It cannot be read.
    """
    path = checked_path("Scenario.world", path)
    if str(path) not in NAMES and path.suffix.lower() not in FORMATS:
        files = ", ".join(f"*{suffix}" for suffix in FORMATS)
        allowed = f"a recipe ({', '.join(RECIPES)}), a public world, a file ({files}) or a World"
        raise SettingError("Scenario.world", str(path), allowed + did_you_mean(str(path), (*RECIPES, *NAMES)))
    options["voxel_size_m"] = voxel_size_m
    check_options(options)
    path = path if str(path) in NAMES else path.parent.resolve() / path.name  # a link keeps its name
    return _cached_world(path, _file_version(path), tuple(sorted(options.items())))


def _file_version(path: Path) -> tuple[tuple[int, int], ...]:
    """Return time of the last change and size of a file, and of the image of a YAML.

    What has changed is read again.
    """
    versions = []
    with contextlib.suppress(OSError, ImportError, RefusedError):  # a name, or what reading reports
        versions.append(_changed(path))
        if path.suffix.lower() in (".yaml", ".yml"):
            versions.append(_changed(_image_of(path, versions[0])))
    return tuple(versions)


def _changed(path: Path) -> tuple[int, int]:
    """Return the time of the last change of a file, and its size."""
    about = path.stat()
    return about.st_mtime_ns, about.st_size


@lru_cache(maxsize=64)
def _image_of(path: Path, version: tuple[int, int]) -> Path:
    """Return the image of a map_server's YAML."""
    del version  # part of the key of the cache
    return image_of(path)


@lru_cache(maxsize=4)
def _cached_world(
    path: Path, version: tuple[tuple[int, int], ...], options: tuple[tuple[str, Any], ...]
) -> World:
    del version  # part of the key of the cache
    return load_world(path, **dict(options))


def world_of_file(scenario: Scenario) -> World | None:
    """Return the world of the file that a scenario names; None where it names a recipe.

    The file's voxels are resampled to the scenario's voxel size.

    Raises:
        SettingError: Neither a recipe nor a file has this name.
        WorldError: The file cannot be used.
    """
    if scenario.world in RECIPES:
        return None
    return world_from_file(scenario.world, scenario.grid.voxel_size_m)


def require_unchanged(scenario: Scenario, world: World) -> None:
    """Check that the file which a scenario names still holds the world that was read from it.

    Raises:
        WorldError: It holds another one, or cannot be read any more.
    """
    found = world_of_file(scenario)
    if found is world or found is None:
        return
    same = found.grid == world.grid and found.yaw_rad == world.yaw_rad
    for array in ("occupied", "ceiling", "unreadable"):  # the last two may be None
        same = same and np.array_equal(getattr(found, array), getattr(world, array))
    if not same:
        allowed = "a file that stays as it was read: make another environment to be in its new world"
        raise WorldError("Scenario.world", scenario.world, allowed)
