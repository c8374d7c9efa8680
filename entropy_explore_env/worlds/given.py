"""Worlds given as objects, in place of the recipe or file that a scenario names."""

from __future__ import annotations

import dataclasses
import os
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from entropy_explore_env.errors import SettingError, WorldError, WorldWarning
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.worlds.files.voxels import box_of_use, cropped_note
from entropy_explore_env.worlds.formats import FORMATS, NAMES
from entropy_explore_env.worlds.load import world_from_file
from entropy_explore_env.worlds.world import World, part_of

GIVEN = "given"
"""`Scenario.world` of missions whose worlds were given as objects: nothing can be made from it alone."""
_ALLOWED = (
    "a recipe's name, a file's path, a World, a list of Worlds and paths, or a mapping: `path` and options"
)
_PATHS = "a mapping with the `path` of a file, or a list of paths"


def with_given_worlds(scenario: Scenario, settings: Mapping[str, Any]) -> tuple[Scenario, tuple[World, ...]]:
    """Return the scenario with settings changed, and the worlds that its missions are to be in.

    Args:
        scenario: What to start from.
        settings: As for `config.with_settings`; `world` may also be a World, a list of Worlds and of files'
            paths, or a mapping of a file's `path` (or a list of paths) and options of `load_world`, whose
            voxels have the scenario's size unless it says another. The grid is then the world's; that of
            several holds each of them (`on_one_grid`). Of a single world large margins without free space are
            cropped.

    Returns:
        The scenario, and its worlds (N,); none where they come from a recipe or a file.

    Raises:
        SettingError: A setting is unknown or not allowed, or there is a `grid` beside a world's own.
        WorldError: A world's file cannot be used, or worlds differ in their grids.
    """
    world = settings.get("world")
    if world is None or isinstance(world, str):
        return with_settings(scenario, settings), ()
    if isinstance(world, os.PathLike):
        return with_settings(scenario, {**settings, "world": os.fspath(world)}), ()
    given = _from_options(scenario, world) if isinstance(world, Mapping) else _from_list(scenario, world)
    given = tuple(_without_margins(each) for each in given) if len(given) == 1 else given
    grid = given[0].grid
    if settings.get("grid", grid) != grid:
        raise SettingError("Scenario.grid", settings["grid"], "no value: the world brings its own")
    return with_settings(scenario, {**settings, "world": GIVEN, "grid": grid}), given


def in_given_worlds(scenario: Scenario, given: Sequence[World]) -> Scenario:
    """Return the scenario of missions in these worlds, with their grid.

    Raises:
        SettingError: They are no worlds, or the scenario does not fit their grid.
        WorldError: They differ in their grids.
    """
    return dataclasses.replace(scenario, world=GIVEN, grid=checked_worlds(given)[0].grid)


def checked_worlds(given: object) -> tuple[World, ...]:
    """Return one or more Worlds, all of one grid.

    Raises:
        SettingError: It is something else.
        WorldError: They differ in their grids.
    """
    several = given if isinstance(given, list | tuple) else (given,)
    worlds = tuple(world for world in several if isinstance(world, World))
    if not worlds or len(worlds) < len(several):
        raise SettingError("world", given, _ALLOWED)
    for number, world in enumerate(worlds):
        if world.grid != worlds[0].grid:
            raise WorldError(f"world[{number}].grid", world.grid, f"that of the first, {worlds[0].grid}")
    return worlds


def _from_list(scenario: Scenario, asked: object) -> tuple[World, ...]:
    """Return the worlds of a list of Worlds and paths, or a single World, on a grid that holds each.

    Raises:
        SettingError, WorldError: As of `with_given_worlds`.
    """
    several: list[Any] = list(asked) if isinstance(asked, list | tuple) else [asked]
    known = all(isinstance(each, World | os.PathLike) or _names_a_file(each) for each in several)
    if not several or not known:
        raise SettingError("world", asked, _ALLOWED)
    size_m = scenario.grid.voxel_size_m
    worlds = [each if isinstance(each, World) else world_from_file(Path(each), size_m) for each in several]
    for number, world in enumerate(worlds):
        if world.grid.voxel_size_m != worlds[0].grid.voxel_size_m:
            allowed = f"voxels of {worlds[0].grid.voxel_size_m} m, as the first one's"
            raise WorldError(f"world[{number}].grid", world.grid, allowed)
    if all(world.grid == worlds[0].grid for world in worlds):
        return tuple(worlds)
    return tuple(on_one_grid(worlds))


def _names_a_file(word: object) -> bool:
    return isinstance(word, str) and (word in NAMES or Path(word).suffix.lower() in FORMATS)


def _without_margins(world: World) -> World:
    """Return a world without large margins in which nothing is free; the rest stays where it was.

    Warns:
        WorldWarning: Margins were cropped.
    """
    box = box_of_use(np.logical_not(world.occupied.all(axis=2)))
    if box is None:
        return world
    note = cropped_note(world.grid.shape, box)
    warnings.warn(f"{world.name}: {note}", WorldWarning, stacklevel=4)
    return part_of(world, (*box, slice(0, world.grid.shape[2])))


def _from_options(scenario: Scenario, asked: Mapping[str, Any]) -> tuple[World, ...]:
    """Return the worlds that a mapping of one or several files' `path` and options stands for."""
    options = dict(asked)
    path = options.pop("path", None)
    paths = list(path) if isinstance(path, list | tuple) else [path]
    if not paths or not all(isinstance(each, str | os.PathLike) for each in paths):
        raise SettingError("world", dict(asked), _PATHS)
    size_m = options.pop("voxel_size_m", None)
    size_m = scenario.grid.voxel_size_m if size_m is None else size_m
    worlds = [world_from_file(Path(each), size_m, **options) for each in paths]
    if len(worlds) == 1:
        return tuple(worlds)
    names = distinct_names([Path(each) for each in paths])
    return tuple(on_one_grid([_named(world, name) for world, name in zip(worlds, names, strict=True)]))


def _named(world: World, name: str) -> World:
    return world if world.name == name else dataclasses.replace(world, name=name)


def on_one_grid(worlds: Sequence[World]) -> list[World]:
    """Return worlds of different sizes on a grid that holds each: what a smaller one lacks is solid.

    All begin at the first one's origin; the frames of their own files are given up. Where one of them has a
    ceiling, all have one: columns that had none are free of it.

    Args:
        worlds: Of one voxel size, all one voxel high or none.

    Raises:
        WorldError: Some are plans and some are not.
    """
    first = worlds[0].grid
    for number, world in enumerate(worlds):
        if world.grid.flat != first.flat:
            kind = "one voxel high" if first.flat else "more than one voxel high"
            raise WorldError(f"world[{number}]", world.name, f"{kind}, as {worlds[0].name} is")
    shape = tuple(max(world.grid.shape[axis] for world in worlds) for axis in range(3))
    grid = Grid((shape[0], shape[1], shape[2]), first.voxel_size_m, first.origin_m)
    return [_widened(world, grid, any(each.ceiling is not None for each in worlds)) for world in worlds]


def _widened(world: World, grid: Grid, with_ceiling: bool) -> World:
    """Return a world on a larger grid, solid where it was not."""
    if world.grid == grid and (world.ceiling is not None or not with_ceiling):
        return world
    x, y, z = world.grid.shape
    solid, ceiling, masks = np.ones(grid.shape, bool), None, {}
    solid[:x, :y, :z] = world.occupied
    for name, mask in (("unknown", world.unknown), ("unreadable", world.unreadable)):
        if mask is not None:
            masks[name] = np.zeros(grid.shape, bool)
            masks[name][:x, :y, :z] = mask
    if with_ceiling:
        ceiling = np.full(grid.shape[:2], grid.shape[2], np.int32)
        if world.ceiling is not None:
            ceiling[:x, :y] = world.ceiling
    return World(grid, solid, world.name, ceiling, **masks)


def distinct_names(paths: Sequence[Path]) -> list[str]:
    """Return names of files without suffix, each with as many folders as make it differ from the others.

    Files that differ in their suffix alone keep it; a file that is named twice has the same name twice.
    """
    whole = [path.absolute() for path in paths]
    bare = {path: path.with_suffix("") for path in whole}
    return [
        _tail(bare[path], [bare[other] for other in whole if other != path]) or path.name for path in whole
    ]


def distinct_paths(paths: Sequence[Path]) -> list[str]:
    """Return the names of files, each with as many of its folders as make it differ from the others."""
    whole = [path.absolute() for path in paths]
    return [_tail(path, [other for other in whole if other != path]) or path.as_posix() for path in whole]


def _tail(path: Path, others: Sequence[Path]) -> str | None:
    """Return as much of a path's end as no other path ends with; None = another path is the same."""
    for length in range(1, len(path.parts)):
        tail = path.parts[-length:]
        if all(other.parts[-length:] != tail for other in others):
            return Path(*tail).as_posix()
    return None
