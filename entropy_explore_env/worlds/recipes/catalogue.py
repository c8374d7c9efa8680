"""The recipes by name.

A recipe takes the workspace and a generator, from which it draws all that varies between its worlds. It
raises a WorldError where the grid is flat, too small or too coarse for it. Unless its docstring says
otherwise, all free space in which a body of 0.3 m radius fits is connected, and in 3-D everything is as high
as the workspace.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np

from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.worlds.recipes.bhattacharya import bhattacharya_cluttered, bhattacharya_office
from entropy_explore_env.worlds.recipes.cave import cave
from entropy_explore_env.worlds.recipes.cliff import cliff
from entropy_explore_env.worlds.recipes.corridor import corridor
from entropy_explore_env.worlds.recipes.hybrid import hybrid
from entropy_explore_env.worlds.recipes.obstacles import cluttered, occlusions
from entropy_explore_env.worlds.recipes.office import office
from entropy_explore_env.worlds.recipes.rooms import empty, furnished, lab
from entropy_explore_env.worlds.recipes.terrain import rough_terrain, smooth_terrain, terrain
from entropy_explore_env.worlds.world import World

RECIPES: Mapping[str, Callable[[Grid, np.random.Generator], World]] = MappingProxyType(
    {
        "empty": empty,
        "furnished": furnished,
        "office": office,
        "corridor": corridor,
        "cluttered": cluttered,
        "hybrid": hybrid,
        "cave": cave,
        "terrain": terrain,
        "terrain-smooth": smooth_terrain,
        "terrain-rough": rough_terrain,
        "occlusions": occlusions,
        "cliff": cliff,
        "lab": lab,
        "bhattacharya-office": bhattacharya_office,
        "bhattacharya-cluttered": bhattacharya_cluttered,
    }
)
"""Name of a recipe → World from a grid and a generator."""


def about_recipe(name: str) -> str:
    """Return what a recipe makes, by its docstring: a room with boxes."""
    first = inspect.cleandoc(RECIPES[name].__doc__ or "").partition("\n\n")[0]
    made = " ".join(first.split()).removeprefix("Return ")
    return made[:1].upper() + made[1:]
