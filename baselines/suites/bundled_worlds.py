"""The saved worlds that come with the suites: worlds/README.md says what each was made from."""

from __future__ import annotations

import csv
import dataclasses
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

from baselines.experiments.mission import scripted
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.errors import SettingError
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.settings.scenarios import SCENARIOS

WORLDS = Path(__file__).parent / "worlds"
DUNGEON_CELL_M = 0.1
VOXEL_SIZES_M = {"warehouse": 0.1, "depot": 0.1, "willow": 0.1, "geb079": 0.16}


class Dungeon(NamedTuple):
    """A dungeon of ARiADNE, and the pose in which its robot starts."""

    name: str
    world: str
    start: tuple[float, float, float, float, float]


def dungeons() -> list[Dungeon]:
    """Return the hundred dungeons, each with its start mark.

    Raises:
        SettingError: The table of starts is missing.
    """
    starts = WORLDS / "starts.csv"
    if not starts.is_file():
        raise SettingError("suite world", str(starts), "a file that is there: it comes with the project")
    with starts.open(newline="") as file:
        rows = list(csv.DictReader(file))
    return [
        Dungeon(
            row["dungeon"],
            world_file(f"dungeons/{row['dungeon']}"),
            (float(row["x_m"]), float(row["y_m"]), DUNGEON_CELL_M / 2, 0.0, 0.0),
        )
        for row in rows
    ]


def in_world(scenario: Scenario, name: str, settings: Mapping[str, Any] | None = None) -> Scenario:
    """Return a scenario in one of the worlds, under its name and with some settings changed.

    Raises:
        SettingError: The world is missing.
    """
    path = world_file(name)
    grid = _grid_of(path, VOXEL_SIZES_M.get(name, DUNGEON_CELL_M))
    return with_settings(dataclasses.replace(scenario, name=name, world=path, grid=grid), settings or {})


def world_file(name: str) -> str:
    """Return the path of a world.

    Raises:
        SettingError: The world is missing.
    """
    path = WORLDS / f"{name}.npz"
    if not path.is_file():
        raise SettingError("suite world", str(path), "a file that is there: it comes with the project")
    return str(path)


@lru_cache(maxsize=16)
def _grid_of(path: str, voxel_size_m: float) -> Grid:
    """Return the grid of a saved world as environments read it."""
    base = with_settings(SCENARIOS["office"], {"world": path, "grid": {"voxel_size_m": voxel_size_m}})
    return EntropyExploreEnv(scripted(base)).scenario.grid
