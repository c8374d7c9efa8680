"""Explore every world file of a folder: `python -m baselines.world_sweep FOLDER [--strategy NAME]`.

Plans are explored by ground robots (the settings of `office`), other worlds by flying ones (those of `room`),
all changed by the options of the task. A mission ends when the map is known or its time is up, by default
after 600 s; the table says which, and how far it came.
"""

from __future__ import annotations

import dataclasses
import shlex
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, NamedTuple

from baselines.cli.arguments import INLINE, Positional, given_options, print_json, run_command
from baselines.cli.task_options import (
    BaseTask,
    TaskOptions,
    base_task,
    first_parsed,
    limit_s,
    parsed_for,
    tasked,
    words_of,
)
from baselines.cli.world_options import Reading
from baselines.experiments.mission import run_mission, scripted_env
from baselines.experiments.tables import markdown_table
from baselines.strategies import make_strategy, resolved
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.errors import SettingError, WorldError, counted
from entropy_explore_env.reports.metrics import mission_figures
from entropy_explore_env.writing import write_atomically

_IMAGES = (".png", ".pgm", ".ppm", ".pnm", ".jpg", ".jpeg", ".bmp", ".gif")
_PLANS = (".yaml", ".yml", *_IMAGES)
_MESHES = (".obj", ".stl", ".glb", ".dae", ".ply")
_CLOUDS = (".pcd", ".las", ".laz")
_HEIGHTS = (".tif", ".tiff", ".npz", ".asc")
_OF_SOME = {
    "height_m": _PLANS,
    "resolution_m": _IMAGES,
    "negate": _IMAGES,
    "occupied_below": _PLANS,
    "free_above": _PLANS,
    "map_rule": (".yaml", ".yml"),
    "elevation_step_m": _IMAGES,
    "clearance_m": (*_HEIGHTS, *_MESHES),
    "ceiling_m": _HEIGHTS,
    "hollow": _MESHES,
    "inside": _MESHES,
    "scale": (*_MESHES, *_CLOUDS),
    "up": (*_MESHES, *_CLOUDS),
}
"""Option of reading → the files that it is for; a YAML says itself how its image is read."""
_OWN = {"ending": {"time_limit_s": 600.0}}
_SUFFIXES = (".bt", ".ot", *_PLANS, *_CLOUDS, *_MESHES, *_HEIGHTS)


@dataclass
class Args:
    """Explore every world file of a folder."""

    folder: Positional[Path] = Path("worlds")
    """Where the files lie; folders in it are looked into, too. With --world those files in its place."""
    strategy: str = "gradient"
    """How robots choose viewpoints; as in baselines.run."""
    robots: int = 2
    """Team size."""
    seed: int = 0
    """Of every mission."""
    plan_voxel_size_m: float | None = None
    """Edge of the voxels of plans; --voxel-size-m is that of all other worlds. Default: the scenario's."""
    task: Annotated[TaskOptions, INLINE] = dataclasses.field(default_factory=TaskOptions)
    out: Path | None = None
    """A Markdown file for the table."""
    json: bool = False
    """Print one JSON object and nothing else."""


class Sweep(NamedTuple):
    """How a kind of worlds is explored."""

    task: BaseTask
    """What the options change."""
    options: TaskOptions
    args: Args


def main(words: Sequence[str]) -> int:
    """Run the command."""
    args = first_parsed(Args, words, __doc__)
    plans, others = (sweep_of(name, args, words) for name in ("office", "room"))
    files = [Path(file) for file in args.task.world] or world_files(args.folder)
    names = _distinct([path.as_posix() for path in files])
    make_strategy(args.strategy)
    rows = []
    for number, path in enumerate(files):
        if not args.json:
            print(f"{number + 1} of {len(files)}: {names[number]}", file=sys.stderr, flush=True)
        rows.append({**explore(path, plans if is_plan(path) else others), "world": names[number]})
    if args.out is not None:
        team = counted(args.robots, "robot")
        about = f"Made by `{_command(plans, others)}`: strategy {resolved(args.strategy)}, {team}, "
        limits = dict.fromkeys(f"{limit_s(one.options):g} s" for one in (plans, others))
        about += f"seed {args.seed}; missions are cut off after {' and '.join(limits)}."
        write_atomically(args.out, f"# Worlds explored\n\n{about}\n\n{table(rows)}\n")
    if args.json:
        print_json({"worlds": rows})
    else:
        print(table(rows), end="")
    return 0


def sweep_of(scenario: str, args: Args, words: Sequence[str]) -> Sweep:
    """How worlds are explored by the robots of a scenario.

    Raises:
        SettingError: An option is not allowed, whatever the world.
    """
    task = base_task(scenario, args.task.settings, _OWN)
    args = parsed_for(task, args, words, __doc__)
    nowhere = {
        "world": (),
        "voxel_size_m": None,
        "world_file": Reading(),
        "starts": None,
        "world_number": None,
    }
    tasked(task.scenario, dataclasses.replace(args.task, **nowhere), args.robots)
    if args.plan_voxel_size_m is not None and scenario == "office":
        args = dataclasses.replace(
            args, task=dataclasses.replace(args.task, voxel_size_m=args.plan_voxel_size_m)
        )
    return Sweep(task, args.task, args)


def _command(*sweeps: Sweep) -> str:
    """What makes the same table again, wherever the world files lie."""
    args = sweeps[0].args
    words = given_options(args, leave_out=("folder", "task", "out", "json"))
    changes: dict[str, list[str]] = {}
    for sweep in reversed(sweeps):  # the voxels of plans have an option of their own
        more = words_of(sweep.options, sweep.task)
        if sweep is sweeps[0] and args.plan_voxel_size_m is not None:
            more.pop("voxel_size_m", None)
        changes = more | changes
    words += [shlex.quote(word) for option in changes.values() for word in option]
    folder = [] if args.task.world else [args.folder.name]
    return " ".join(["python -m baselines.world_sweep", *folder, *words])


def _distinct(paths: Sequence[str]) -> list[str]:
    """The files' names, with their folders where two have the same one."""
    names = [Path(path).name for path in paths]
    return [name if names.count(name) == 1 else path for name, path in zip(names, paths, strict=True)]


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


def env_for(path: Path, sweep: Sweep) -> EntropyExploreEnv:
    """The environment of a mission in a file.

    Raises:
        SettingError: An option does not go with the file.
        WorldError: The file cannot be used.
    """
    suffix, asked = path.suffix.lower(), sweep.options.world_file
    foreign = {name: None for name, suffixes in _OF_SOME.items() if suffix not in suffixes}
    reading = dataclasses.replace(asked, **{name: None for name in foreign})  # type: ignore[arg-type]
    options = dataclasses.replace(sweep.options, world=(str(path),), world_file=reading)
    return scripted_env(*tasked(sweep.task.scenario, options, sweep.args.robots), track_truth=True)


def explore(path: Path, sweep: Sweep) -> dict[str, Any]:
    """One mission in one world: what a row of the table says; `refused` where there is no mission."""
    try:
        env = env_for(path, sweep)
        started = time.perf_counter()
        run_mission(env, make_strategy(sweep.args.strategy), sweep.args.seed)
    except (SettingError, WorldError) as error:
        return {"refused": str(error)}
    figures = mission_figures(env.missions, 0)
    joint = {str(_JOINT.get(name, name)): value for name, value in figures.pop("joint").items()}
    shape = env.scenario.grid.shape
    return {
        **{name: value for name, value in figures.items() if name != "per_robot"},
        **joint,
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
