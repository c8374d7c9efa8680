"""Explore every world file of a folder: `python -m baselines.world_sweep FOLDER [--strategy NAME]`.

Plans are explored by ground robots (the settings of `office`), other worlds by flying ones (those of `room`).
A mission ends when the map is known or its time is up; the table says which, and how far it came.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from baselines.cli.arguments import Positional, given_options, parse, print_json, run_command
from baselines.cli.world_options import Reading, world_settings
from baselines.experiments.mission import run_mission, scripted
from baselines.experiments.tables import markdown_table
from baselines.strategies import make_strategy, resolved
from entropy_explore_env.command import allow_read_memory
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
    """How robots choose viewpoints; as in baselines.run."""
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
    read_memory_mib: float | None = None
    """MiB of memory that reading a world file may take; default: by the file's size."""
    time_limit_s: float = 600.0
    """Simulated time after which a mission is cut off."""
    out: Path | None = None
    """A Markdown file for the table."""
    json: bool = False
    """Print one JSON object and nothing else."""


def main(words: Sequence[str]) -> int:
    """Run the command."""
    args = parse(Args, words, description=__doc__)
    allow_read_memory(args.read_memory_mib)
    files = world_files(args.folder)
    make_strategy(args.strategy)
    rows = []
    for number, path in enumerate(files):
        if not args.json:
            print(f"{number + 1} of {len(files)}: {path.name}", file=sys.stderr, flush=True)
        rows.append(explore(path, args))
    if args.out is not None:
        options = given_options(args, leave_out=("folder", "out", "json"))
        command = " ".join(["python -m baselines.world_sweep", args.folder.name, *options])
        about = f"Made by `{command}`: strategy {resolved(args.strategy)}, {args.robots} robots, "
        about += f"seed {args.seed}; missions are cut off after {args.time_limit_s:g} s."
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
    world = world_settings((str(path),), edge_m, reading if path.suffix.lower() in _IMAGES else Reading())
    return EntropyExploreEnv(
        scenario, robots=args.robots, track_truth=True, time_limit_s=args.time_limit_s, **world
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
    joint = {str(_JOINT.get(name, name)): value for name, value in figures.pop("joint").items()}
    shape = env.scenario.grid.shape
    return {
        **{name: value for name, value in figures.items() if name != "per_robot"},
        **joint,
        "world": path.name,
        "voxels": " × ".join(map(str, shape if shape[2] > 1 else shape[:2])),
        "voxel_size_m": env.scenario.grid.voxel_size_m,
        "wall_s": round(time.perf_counter() - started, 2),
    }


_JOINT = {"entropy_bits": "joint_bits"}
_HEAD: dict[str, tuple[str, str]] = {
    "voxels": ("voxels", ""),
    "voxel_size_m": ("edge (m)", "g"),
    "end_reason": ("end", ""),
    "t_mission_s": ("t (s)", ",.0f"),
    "scans": ("scans", ","),
    "explored": ("explored", ".1%"),
    "error": ("map error", ".3f"),
    "wall_s": ("computed in (s)", ".1f"),
}
_MORE: dict[str, tuple[str, str]] = {
    "t50_s": ("T₅₀ (s)", ",.0f"),
    "t90_s": ("T₉₀ (s)", ",.0f"),
    "t99_s": ("T₉₉ (s)", ",.0f"),
    "scans_over_floor": ("scans over the floor", ".2f"),
    "entropy_end_bits": ("best map (bits)", ",.0f"),
    "entropy_mean_bits": ("mean map (bits)", ",.0f"),
    "joint_bits": ("joint map (bits)", ",.0f"),
    "wrong": ("voxels wrong at ½", ".2%"),
    "distance_m": ("driven (m)", ",.0f"),
    "blocked_moves": ("blocked moves", ","),
    "overlap": ("below I_min", ".0%"),
    "balance": ("imbalance", ".2f"),
    "bits_sent": ("bits sent", ","),
    "bits_gained_per_bit_sent": ("bits gained per bit sent", ".3f"),
}
"""Columns: their heads and the form of their numbers."""


def table(rows: list[dict[str, Any]]) -> str:
    """The rows in Markdown, how the teams did, and why worlds were refused."""
    explored = [row for row in rows if "refused" not in row]
    reasons = "".join(f"\nRefused: {row['refused']}\n" for row in rows if "refused" in row)
    more = "\n" + _table(explored, _MORE) if explored else ""
    return _table(rows, _HEAD) + more + reasons


def _table(rows: list[dict[str, Any]], columns: dict[str, tuple[str, str]]) -> str:
    """Some columns; what cannot be said is `-`."""
    body = [[row["world"], *(_shown(row, name, form) for name, (_, form) in columns.items())] for row in rows]
    return markdown_table(["world", *(head for head, _ in columns.values())], body)


def _shown(row: dict[str, Any], name: str, form: str) -> str:
    if "refused" in row:
        return "refused" if name == "end_reason" else "-"
    partial = name == "scans_over_floor" and not row["finished"]  # the floor is a whole map's
    return "-" if row[name] is None or partial else format(row[name], form)


if __name__ == "__main__":
    raise SystemExit(run_command(main))
