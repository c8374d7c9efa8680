"""Play the maps of a recorded bag through a strategy: its goals, and the milliseconds that they take.

Robots and sensors are those of a scenario; the bag holds the robots' poses and maps. The goals have no effect
on what the bag plays next.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from tabulate import tabulate

from baselines.cli.arguments import print_json
from baselines.cli.options import Mark
from baselines.strategies import make_strategy
from entropy_explore_env.errors import RecordError, SettingError
from entropy_explore_env.explorer.explorer import Explorer
from entropy_explore_env.interop.bag_reader import BagReader, MapHeard, ScanHeard
from entropy_explore_env.settings.validation import check_whole, checked_path

_SCAN_VOXEL_M = 0.1
SUFFIXES = (".mcap", ".db3", ".bag")
"""Of bags that are files; others are folders."""


@dataclass
class BagArgs:
    """Play a recorded bag's maps, or its scans, through a strategy."""

    bag: Annotated[Path, Mark.POSITIONAL] = Path("bag")
    """The folder of a ROS 2 bag, a file in it, or a .bag of ROS 1."""
    strategy: str = "best"
    """Strategy that chooses the goals."""
    scenario: str | None = None
    """Scenario of robots, sensors and ending; default: ground robots with a scanner, in 3-D office-3d."""
    topic: str | None = None
    """Topic of the maps or scans; default: all maps, or all scans of a bag without maps."""
    map_frame: str = "map"
    """Frame of the poses."""
    frames: tuple[str, ...] = ()
    """Frames of the robots; default: those of Odometry, or base_footprint or base_link."""
    every_s: float = 1.0
    """Seconds of the bag between decisions of a robot, at least."""
    voxel_size_m: float = _SCAN_VOXEL_M
    """Edge of the voxels of a map that is made from scans."""
    seed: int = 0
    """Seed of the strategy's draws."""
    json: bool = False
    """Print one JSON object and nothing else."""


def is_bag(words: Sequence[str]) -> bool:
    """Return whether the first word of a command line names a bag."""
    if not words or words[0].startswith("-"):
        return False
    path = checked_path("bag", words[0])
    return path.is_dir() or path.suffix in SUFFIXES


def replay_bag(args: BagArgs) -> int:
    """Print a strategy's decisions on the maps of a bag."""
    check_whole("seed", args.seed, 0)
    if not 0.0 <= args.every_s < np.inf:
        raise SettingError("every_s", args.every_s, "finite seconds ≥ 0")
    reader = BagReader(args.bag, args.topic, args.map_frame, args.frames)
    rows = list(_decisions(reader, args))
    if not rows:
        allowed = f"a bag in which maps or scans and the poses of {reader.robots} are known in the frame"
        raise RecordError("bag", str(args.bag), f"{allowed} {args.map_frame!r} (--map-frame, --frames)")
    spent = [row["ms"] for row in rows[1:]] or [rows[0]["ms"]]
    summary = {
        "bag": str(args.bag),
        "strategy": args.strategy,
        "robots": reader.robots,
        "decisions": len(rows),
        "goals": sum(row["goal"] is not None for row in rows),
        "decision_ms": float(np.median(spent)),
        "worst_decision_ms": max(spent),
    }
    if args.json:
        print_json({**summary, "rows": rows})
        return 0
    heads = ["s", "robot", "at", "goal", "bits", "path m", "s to scan", "ms"]
    print(tabulate([_shown(row) for row in rows], heads, floatfmt=".1f"))
    print(f"{summary['decisions']} decisions, {summary['goals']} goals; ", end="")
    print(f"{summary['decision_ms']:.1f} ms a decision, at most {summary['worst_decision_ms']:.1f} ms")
    return 0


def _decisions(reader: BagReader, args: BagArgs) -> Iterator[dict[str, Any]]:
    """Yield the decision of each robot when it is due: figures for JSON."""
    explorer: Explorer | None = None
    decided_s = dict.fromkeys(range(len(reader.robots)), -np.inf)
    for heard in reader:
        if explorer is None:
            explorer = _explorer(heard, len(reader.robots), args)
        if isinstance(heard, MapHeard):
            if not (heard.percent >= 0).any():
                continue
            explorer.set_map(heard.percent, heard.origin, bottom_m=heard.bottom_m, values="percent")
        else:
            explorer.add_scan(heard.pose, heard.points_m, heard.robot)
        for robot in heard.poses:
            if heard.time_s - decided_s[robot] >= args.every_s:
                decided_s[robot] = heard.time_s
                row = _decision(explorer, heard, robot)
                if row is not None:
                    yield row


def _explorer(heard: MapHeard | ScanHeard, robots: int, args: BagArgs) -> Explorer:
    """Return an Explorer for the voxels of a bag's first map."""
    flat = isinstance(heard, MapHeard) and heard.percent.ndim == 2
    size_m = heard.resolution_m if isinstance(heard, MapHeard) else args.voxel_size_m
    scenario = args.scenario or (None if flat or isinstance(heard, ScanHeard) else "office-3d")
    strategy = make_strategy(args.strategy)
    return Explorer(scenario, voxel_size_m=size_m, robots=robots, strategy=strategy, seed=args.seed)


def _decision(explorer: Explorer, heard: MapHeard | ScanHeard, robot: int) -> dict[str, Any] | None:
    """Return a robot's decision; None where a robot is off the map, or in a wall by it."""
    started = time.perf_counter()
    try:
        goal = explorer.goal(heard.poses, robot, time_s=heard.time_s)
    except SettingError as error:
        if not error.field.startswith("poses["):
            raise
        return None
    spent_ms = 1e3 * (time.perf_counter() - started)
    row = {"time_s": heard.time_s, "robot": robot, "pose": heard.poses[robot].tolist(), "ms": spent_ms}
    if goal is None:
        assert explorer.no_goal is not None
        return {**row, "goal": None, "why": explorer.no_goal.value}
    ends = np.vstack([heard.poses[robot][None, :3], goal.path])
    figures = {"bits": goal.expected_bits, "seconds": goal.seconds, "why": goal.why.value}
    path_m = float(np.linalg.norm(np.diff(ends, axis=0), axis=1).sum())
    return {**row, **figures, "goal": goal.viewpoint.tolist(), "path_m": path_m}


def _shown(row: dict[str, Any]) -> list[Any]:
    """Return a row of the table."""
    place = "({:.2f}, {:.2f}, {:.2f})".format
    goal = f"none: {row['why']}" if row["goal"] is None else place(*row["goal"][:3])
    figures = (row.get(name) for name in ("bits", "path_m", "seconds", "ms"))
    return [row["time_s"], row["robot"], place(*row["pose"][:3]), goal, *figures]
