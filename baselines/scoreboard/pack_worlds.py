"""The worlds of the suites from the files of others: `python -m baselines.scoreboard.pack_worlds FOLDER`.

FOLDER holds what worlds/README.md names: `dungeons-complex/img_1.png` …, `nav2/warehouse.yaml`,
`nav2/depot.yaml`, `nav2/willow_costmap.pgm` and `octomap/geb079.bt`. Written are the saved worlds that the
suites read, at the size of the cells in which they are explored, and `starts.csv`: where the dungeons' robots
start.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image

from baselines.cli.arguments import Positional, parse, run_command
from baselines.scoreboard.suites import DUNGEON_CELL_M, STARTS, VOXEL_SIZES_M, WORLDS
from entropy_explore_env.errors import WorldError
from entropy_explore_env.settings import Grid
from entropy_explore_env.worlds.load import load_world, save_world
from entropy_explore_env.worlds.world import World
from entropy_explore_env.writing import write_atomically

DUNGEONS = 100
_WALL, _START = (127, 127, 127), (255, 216, 0)
"""In the dungeons' images: rock, and the patch in whose middle the robot starts; all else is floor."""
_SOURCES = {
    "warehouse": "nav2/warehouse.yaml",
    "depot": "nav2/depot.yaml",
    "willow": "nav2/willow_costmap.pgm",
    "geb079": "octomap/geb079.bt",
}


@dataclass
class Args:
    """Pack the worlds of the suites."""

    folder: Positional[Path] = Path("worlds")
    """Where the files of others lie."""


def dungeon(path: Path) -> tuple[World, tuple[float, float]]:
    """A dungeon, and the middle of its start mark, x and y in metres.

    Raises:
        WorldError: The image has no start mark or no floor.
    """
    colours = np.asarray(Image.open(path).convert("RGB"))
    columns = colours[::-1].transpose(1, 0, 2)  # [x, y], y up
    solid = (columns == _WALL).all(axis=-1)
    marked = np.argwhere((columns == _START).all(axis=-1))
    if len(marked) == 0:
        raise WorldError("dungeon", str(path), f"an image with a patch of the colour {_START}, the start")
    x_m, y_m = ((marked.mean(axis=0) + 0.5) * DUNGEON_CELL_M).tolist()
    grid = Grid((solid.shape[0], solid.shape[1], 1), DUNGEON_CELL_M)
    return World(grid, solid[:, :, None], path.stem), (x_m, y_m)


def main(words: Sequence[str]) -> int:
    """Run the command."""
    folder = parse(Args, words, description=__doc__).folder
    rows = io.StringIO()
    table = csv.writer(rows, lineterminator="\n")
    table.writerow(("dungeon", "x_m", "y_m"))
    for number in range(1, DUNGEONS + 1):
        world, (x_m, y_m) = dungeon(folder / "dungeons-complex" / f"img_{number}.png")
        save_world(world, WORLDS / "dungeons" / f"{number}.npz")
        table.writerow((number, f"{x_m:.2f}", f"{y_m:.2f}"))
    write_atomically(STARTS, rows.getvalue())
    for name, source in _SOURCES.items():
        save_world(load_world(folder / source, VOXEL_SIZES_M[name]), WORLDS / f"{name}.npz")
    return 0


if __name__ == "__main__":
    raise SystemExit(run_command(main))
