"""From a scenario to its world: made by a recipe from a world number of the split, or read from a file."""

from __future__ import annotations

import dataclasses
from functools import lru_cache
from pathlib import Path

import numpy as np

from entropy_explore_env.config import Scenario
from entropy_explore_env.errors import SettingError
from entropy_explore_env.validation import is_whole
from entropy_explore_env.worlds.files import load_octomap
from entropy_explore_env.worlds.recipes.catalogue import RECIPES
from entropy_explore_env.worlds.recipes.empty import empty
from entropy_explore_env.worlds.splits import draw_world_number, world_generator
from entropy_explore_env.worlds.world import World


def make_world(scenario: Scenario, rng: np.random.Generator) -> World:
    """The true world of a mission.

    Worlds without chance in them are made once and shared.

    Args:
        scenario: Its `world` names a recipe or a file.
        rng: The stream of worlds; recipes with chance take one draw of it, the world number.

    Raises:
        SettingError: Neither a recipe nor a file has this name.
        WorldError: The file cannot be used.
    """
    if scenario.world == "empty":
        return _empty_world(scenario)
    if scenario.world in RECIPES:
        return world_with_number(scenario, draw_world_number(scenario.split, rng))
    return world_from_file(Path(scenario.world), scenario.grid.voxel_size_m)


def world_with_number(scenario: Scenario, number: int) -> World:
    """The world that a recipe makes from a world number.

    Args:
        scenario: Its `world` names a recipe, its `grid` the workspace; nothing else matters.
        number: See worlds/splits.py.

    Raises:
        SettingError: No recipe has this name, or the number is not a whole number ≥ 0.
        WorldError: The grid is too small for the recipe.
    """
    if scenario.world not in RECIPES:
        raise SettingError("Scenario.world", scenario.world, "a recipe: " + ", ".join(RECIPES))
    if not is_whole(number, 0):
        raise SettingError("number", number, "a whole number ≥ 0")
    return RECIPES[scenario.world](scenario.grid, world_generator(number))


@lru_cache(maxsize=8)
def _empty_world(scenario: Scenario) -> World:
    return empty(scenario.grid, np.random.default_rng(0))


def world_from_file(path: Path, voxel_size_m: float) -> World:
    """The world in a file, its voxels resampled; kept, so that many missions read it once.

    Args:
        path: An OctoMap binary tree, `.bt`.
        voxel_size_m: Edge of the voxels wanted.

    Raises:
        SettingError: The file's kind is not known.
        WorldError: It cannot be read.
    """
    if path.suffix != ".bt":
        known = "a recipe (" + ", ".join(RECIPES) + ") or an OctoMap file (*.bt)"
        raise SettingError("Scenario.world", str(path), known)
    return _octomap(path.resolve(), voxel_size_m)


@lru_cache(maxsize=4)
def _octomap(path: Path, voxel_size_m: float) -> World:
    return load_octomap(path, voxel_size_m)


def with_world(scenario: Scenario) -> Scenario:
    """The scenario with the grid of its world's file; as it is where the world is a recipe.

    The scenario's voxel size is kept: the file's voxels are resampled to it.

    Raises:
        SettingError: Neither a recipe nor a file has this name.
        WorldError: The file cannot be used.
    """
    if scenario.world in RECIPES:
        return scenario
    world = world_from_file(Path(scenario.world), scenario.grid.voxel_size_m)
    return dataclasses.replace(scenario, grid=world.grid)
