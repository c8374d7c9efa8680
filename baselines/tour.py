"""Explore every world file of a folder: `python -m baselines.tour FOLDER [--strategy NAME] [--out FILE]`.

Plans are explored by ground robots (the settings of `office`), other worlds by flying ones (those of `room`).
A mission ends when the map is known or its time is up; the table says which, and how far it came.
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from baselines.command import Positional, parse, print_json, run_command
from baselines.experiment import markdown_table
from baselines.mission import run_mission, scripted
from baselines.strategies import make_strategy
from baselines.world_file import Reading, world_settings
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.errors import SettingError, WorldError
from entropy_explore_env.reports.metrics import mission_figures
from entropy_explore_env.scenarios import find_scenario
from entropy_explore_env.writing import write_atomically

_IMAGES = (".png", ".pgm")
_PLANS = (".yaml", ".yml", *_IMAGES)
_SUFFIXES = tuple(".bt .ot .yaml .yml .png .pgm .pcd .ply .obj .stl .glb .npz .tif .tiff".split())


@dataclass
class Args:
    """Explore every world file of a folder."""

    folder: Positional[Path] = Path("worlds")
    """Where the files lie; folders in it are looked into, too."""
    strategy: str = "gradient"
    """How robots choose viewpoints."""
    robots: int = 2
    """Team size."""
    seed: int = 0
    """Of every mission."""
    plan_voxel_size_m: float = 0.1
    """Edge of the voxels of plans, one voxel high."""
    voxel_size_m: float = 0.25
    """Edge of the voxels of all other worlds."""
    resolution_m: float | None = None
    """Edge of a pixel of the images that have no YAML; default: 0.05."""
    negate: bool = False
    """In the images that have no YAML bright is solid."""
    time_limit_s: float = 600.0
    """Simulated time after which a mission is cut off."""
    out: Path | None = None
    """A Markdown file for the table."""
    json: bool = False
    """Print one JSON object and nothing else."""


def main(words: Sequence[str]) -> int:
    """Run the command."""
    args = parse(Args, words, description=__doc__)
    files = world_files(args.folder)
    make_strategy(args.strategy)
    rows = []
    for number, path in enumerate(files):
        if not args.json:
            print(f"{number + 1} of {len(files)}: {path.name}", file=sys.stderr, flush=True)
        rows.append(explore(path, args))
    if args.out is not None:
        given = f"{args.folder.name} --strategy {args.strategy} --robots {args.robots}"
        given += "" if args.resolution_m is None else f" --resolution-m {args.resolution_m:g}"
        given += " --negate" if args.negate else ""
        about = f"Made by `python -m baselines.tour {given}`, seed {args.seed}; missions are cut off after "
        about += f"{args.time_limit_s:g} s."
        write_atomically(args.out, f"# Worlds explored\n\n{about}\n\n{table(rows)}\n")
    if args.json:
        print_json({"worlds": rows})
    else:
        print(table(rows), end="")
    return 0


def world_files(folder: Path) -> list[Path]:
    """The world files of a folder; an image that a map_server file names is no world of its own.

    Raises:
        SettingError: There are none.
    """
    found = sorted(path for path in folder.rglob("*") if path.suffix.lower() in _SUFFIXES)
    named = {path.with_suffix("") for path in found if path.suffix.lower() in _PLANS[:2]}
    files = [p for p in found if p.suffix.lower() not in _IMAGES or p.with_suffix("") not in named]
    if not files:
        raise SettingError("folder", str(folder), "a folder with world files: " + " ".join(_SUFFIXES))
    return files


def is_plan(path: Path) -> bool:
    """Whether a file is a floor plan, which ground robots explore."""
    return path.suffix.lower() in _PLANS


def env_for(path: Path, args: Args) -> EntropyExploreEnv:
    """Ground robots for plans, flying ones for everything else.

    Raises:
        WorldError: The file cannot be used.
    """
    plan = is_plan(path)
    scenario = scripted(find_scenario("office" if plan else "room"))
    edge_m = args.plan_voxel_size_m if plan else args.voxel_size_m
    reading = Reading(resolution_m=args.resolution_m, negate=args.negate)
    world = world_settings(str(path), edge_m, reading if path.suffix.lower() in _IMAGES else Reading())
    return EntropyExploreEnv(
        scenario, robots=args.robots, scored=True, time_limit_s=args.time_limit_s, **world
    )


def explore(path: Path, args: Args) -> dict[str, Any]:
    """One mission in one world: what a row of the table says; `refused` where there is no mission."""
    try:
        env = env_for(path, args)
        started = time.perf_counter()
        run_mission(env, make_strategy(args.strategy), args.seed)
    except WorldError as error:
        return {"world": path.name, "refused": str(error)}
    figures = mission_figures(env.missions, 0)
    shape = env.scenario.grid.shape
    return {
        "world": path.name,
        "voxels": " × ".join(map(str, shape if shape[2] > 1 else shape[:2])),
        "voxel_size_m": env.scenario.grid.voxel_size_m,
        **{name: figures[name] for name in ("end_reason", "t_mission_s", "scans")},
        **{name: figures["joint"][name] for name in ("explored", "error")},
        "wall_s": round(time.perf_counter() - started, 2),
    }


def table(rows: list[dict[str, Any]]) -> str:
    """The rows in Markdown, and why worlds were refused."""
    head = [
        "world",
        "voxels",
        "edge (m)",
        "end",
        "t (s)",
        "scans",
        "explored",
        "map error",
        "computed in (s)",
    ]
    shown = [
        [
            row["world"],
            row["voxels"],
            f"{row['voxel_size_m']:g}",
            row["end_reason"],
            f"{row['t_mission_s']:,.0f}",
            f"{row['scans']:,}",
            f"{row['explored']:.1%}",
            "-" if row["error"] is None or math.isnan(row["error"]) else f"{row['error']:.3f}",
            f"{row['wall_s']:.1f}",
        ]
        if "refused" not in row
        else [row["world"], "-", "-", "refused", *["-"] * 5]
        for row in rows
    ]
    reasons = "".join(f"\nRefused: {row['refused']}\n" for row in rows if "refused" in row)
    return markdown_table(head, shown) + reasons


if __name__ == "__main__":
    raise SystemExit(run_command(main))
