"""Worlds given as objects, in place of the recipe or file that a scenario names."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from entropy_explore_env.errors import SettingError, WorldError
from entropy_explore_env.scenario import Scenario, with_settings
from entropy_explore_env.worlds.load import world_from_file
from entropy_explore_env.worlds.world import World

GIVEN = "given"
"""`Scenario.world` of missions whose worlds were given as objects: nothing can be made from it alone."""
_ALLOWED = "a recipe's name, a file's path, a World, a list of Worlds, or a mapping: `path` and options"


def with_given_worlds(scenario: Scenario, settings: Mapping[str, Any]) -> tuple[Scenario, tuple[World, ...]]:
    """The scenario with settings changed, and the worlds that its missions are to be in.

    Args:
        scenario: What to start from.
        settings: As for `config.with_settings`; `world` may also be a World, a sequence of Worlds of one
            grid, or a mapping of a file's `path` and options of `load_world`, whose voxels have the
            scenario's size unless it says another. The grid is then the world's.

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
    given = _from_options(scenario, world) if isinstance(world, Mapping) else checked_worlds(world)
    grid = given[0].grid
    if settings.get("grid", grid) != grid:
        raise SettingError("Scenario.grid", settings["grid"], "not given: the world brings its own")
    return with_settings(scenario, {**settings, "world": GIVEN, "grid": grid}), given


def in_given_worlds(scenario: Scenario, given: Sequence[World]) -> Scenario:
    """The scenario of missions in these worlds, with their grid.

    Raises:
        SettingError: They are no worlds, or the scenario does not fit their grid.
        WorldError: They differ in their grids.
    """
    return dataclasses.replace(scenario, world=GIVEN, grid=checked_worlds(given)[0].grid)


def checked_worlds(given: object) -> tuple[World, ...]:
    """One or more Worlds, all of one grid.

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


def world_in_turn(given: Sequence[World], seed: int, episode: int) -> World:
    """The world of a mission: dealt in turn by its seed, the next one with each episode that follows."""
    return given[(seed + episode) % len(given)]


def _from_options(scenario: Scenario, asked: Mapping[str, Any]) -> tuple[World, ...]:
    """The world that a mapping of a file's path and options stands for."""
    options = dict(asked)
    path = options.pop("path", None)
    if not isinstance(path, str | os.PathLike):
        raise SettingError("world", dict(asked), "a mapping with the `path` of a file")
    size_m = options.pop("voxel_size_m", None)
    size_m = scenario.grid.voxel_size_m if size_m is None else size_m
    return (world_from_file(Path(path), size_m, **options),)
