"""The table of public worlds: name → files at a pinned commit, licence, citation, and how they are read.

A world is added by an entry of `_ENTRIES`, whose files lie in one folder of one repository. `dungeons.csv`
holds the SHA-256 of each dungeon's image and the middle of its start mark.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Any

from entropy_explore_env.settings.grid import Grid


@dataclass(frozen=True)
class Source:
    """A folder of a public repository, at a commit.

    Attributes:
        name: Folder of the cache in which its files are kept.
        folder: Owner, repository, commit and folder, as raw.githubusercontent.com has them.
        licence: SPDX name and holder.
        citation: What to cite.
    """

    name: str
    folder: str
    licence: str
    citation: str


@dataclass(frozen=True)
class PublicWorld:
    """A world that others have published.

    Attributes:
        about: What it is, in a few words.
        source: Where its files come from.
        files: File name → SHA-256; the first file is the one that is read, and may name the others.
        grid: The grid of the world as it is read by default.
        options: Options of `load_world` with which it is read, unless others are given; `voxel_size_m` is
            that of the grid.
        start_m: x and y of the start mark that the file holds, in metres; None = it has none.
    """

    about: str
    source: Source
    files: Mapping[str, str]
    grid: Grid
    options: Mapping[str, Any] = field(default_factory=dict)
    start_m: tuple[float, float] | None = None


_ARIADNE = Source(
    "ariadne",
    "marmotlab/ARiADNE/8d726ad05e6b0c38672f1679baf7fa2b083a0eb0/DungeonMaps/complex",
    "MIT, © 2023 MARMot Lab @ NUS-ME",
    "Y. Cao, T. Hou, Y. Wang, X. Yi, G. Sartoretti: ARiADNE: A Reinforcement learning approach using "
    "Attention-based Deep Networks for Exploration, ICRA 2023, doi:10.1109/ICRA48891.2023.10160565",
)
_NAV2 = Source(
    "nav2",
    "ros-navigation/navigation2/a3a97043ee93d92fe8d70ec56d183933169beb1c/nav2_bringup/maps",
    "Apache-2.0, the authors of navigation2",
    "S. Macenski, F. Martín, R. White, J. Ginés Clavero: The Marathon 2: A Navigation System, IROS 2020, "
    "doi:10.1109/IROS45743.2020.9341207",
)
_NAVIGATION = Source(
    "navigation",
    "ros-planning/navigation/9ad644198e132d0e950579a3bc72c29da46e60b0/navfn/test",
    "BSD-3-Clause, © 2008 Willow Garage, Inc.",
    "E. Marder-Eppstein, E. Berger, T. Foote, B. Gerkey, K. Konolige: The Office Marathon: Robust "
    "Navigation in an Indoor Office Environment, ICRA 2010, doi:10.1109/ROBOT.2010.5509725",
)
_OCTOMAP = Source(
    "octomap",
    "OctoMap/octomap/863e069489ef619d7179e3b21480dffb41b2af66/octomap/share/data",
    "BSD-3-Clause, © 2009-2013 K. M. Wurm and A. Hornung, University of Freiburg",
    "A. Hornung, K. M. Wurm, M. Bennewitz, C. Stachniss, W. Burgard: OctoMap: An Efficient Probabilistic "
    "3D Mapping Framework Based on Octrees, Autonomous Robots 2013, doi:10.1007/s10514-012-9321-0",
)
_C2 = Source(
    "c2",
    "Robotics-STAR-Lab/C2-Explorer/fd1c76a49a4453f91da4984e123b56932c5382f3"
    "/src/MARSIM/map_generator/resource",
    "Apache-2.0, the authors of C2-Explorer",
    "X. Yan, M. Zhang, et al.: C2-Explorer: Contiguity-Driven Task Allocation with Connectivity-Aware Task "
    "Representation for Decentralized Multi-UAV Exploration, IROS 2026, arXiv:2603.07699",
)
_C2_OPTIONS = {"gap_m": 0.4}
"""Their points lie on surfaces with gaps of two or three voxels, through which beams would enter walls."""
_ENTRIES = {
    "warehouse": PublicWorld(
        "floor of a warehouse",
        _NAV2,
        {
            "warehouse.yaml": "ec00d3d25912028e3debed9ded3d6471f70a3bf0f0d1a3f9470458f3068cc585",
            "warehouse.pgm": "934ce2ca1feacc2216b68142349c6ebb3e46cc7c76fd80a9c2d2a6fb85ba7ff7",
        },
        Grid((302, 503, 1), 0.1, (-15.1, -25.0, 0.0)),
    ),
    "depot": PublicWorld(
        "floor of a depot",
        _NAV2,
        {
            "depot.yaml": "fc724e706bfb453a5c4bf513644f754130be27b618e59d75293ead1b7e129bf6",
            "depot.pgm": "71bbac79cfc2f5db89095182bfa86b29d96b07d4ed3b7726e513ed57afffc851",
        },
        Grid((302, 154, 1), 0.1),
    ),
    "tb3_sandbox": PublicWorld(
        "hexagonal court with columns, of TurtleBot3",
        _NAV2,
        {
            "tb3_sandbox.yaml": "2a284eba0a3aa4a904bce71734c56a543e979899f1cf34daad6e8215e608b438",
            "tb3_sandbox.pgm": "0103b9dfaa3b79592af71cc35d64f69cfbd3565d173160820ad8ef56cd27b3fc",
        },
        Grid((384, 384, 1), 0.05, (-10.0, -10.0, 0.0)),
    ),
    "willow": PublicWorld(
        "floor of the office of Willow Garage",
        _NAVIGATION,
        {"willow_costmap.pgm": "25c8bebee637a1185cff9e3cc5a0c9daf29d18906fb25e8aa2736ef504963d25"},
        Grid((566, 609, 1), 0.1),
        {"resolution_m": 0.05},
    ),
    "geb079": PublicWorld(
        "scanned corridor of building 079, Freiburg",
        _OCTOMAP,
        {"geb079.bt": "7663c2466e2fe335a27d1d592f91766c8154511e63a9615aeecdad1defb04d3b"},
        Grid((244, 94, 20), 0.16, (-8.0, -7.5200000000000005, -0.32)),
    ),
    "octa_maze": PublicWorld(
        "octagonal maze for teams of drones",
        _C2,
        {"octa_maze.pcd": "58c76d34b0338734209bf03e201985005add0b039ba7afa7720abf4b5c64c345"},
        Grid((351, 351, 25), 0.1, (-17.6, -17.3, -0.2)),
        _C2_OPTIONS,
    ),
    "cubicle_office": PublicWorld(
        "office of cubicles for teams of drones",
        _C2,
        {"cubicle_office.pcd": "4345b9eaabf32a2ac857cdc0b62b836ba882bdc0f7b6770fd6954f8bfc9e061c"},
        Grid((311, 311, 26), 0.1, (-15.200000000000001, -15.700000000000001, -0.2)),
        _C2_OPTIONS,
    ),
}
_DUNGEON_CELL_M = 0.1
"""Size that a pixel of the dungeons is taken to have: their images state none."""
_BELOW_FLOOR = 140.0
"""In the dungeons' images rock has the shade 127, the start mark 157 and other floor 195."""


def _dungeons() -> Iterator[tuple[str, PublicWorld]]:
    """Yield the dungeons of ARiADNE's test set `complex`."""
    grid = Grid((640, 480, 1), _DUNGEON_CELL_M)
    options = {"resolution_m": _DUNGEON_CELL_M, "occupied_below": _BELOW_FLOOR}
    make = partial(PublicWorld, "generated dungeon of a test set", _ARIADNE, grid=grid, options=options)
    with Path(__file__).with_name("dungeons.csv").open(newline="") as file:
        for row in csv.DictReader(file):
            start_m = float(row["x_m"]), float(row["y_m"])
            yield (
                f"dungeon-{row['number']}",
                make(files={f"img_{row['number']}.png": row["sha256"]}, start_m=start_m),
            )


PUBLIC: Mapping[str, PublicWorld] = MappingProxyType({**_ENTRIES, **dict(_dungeons())})
"""Name → public world. Names have no dot, world files have one: they cannot be mistaken for each other."""
