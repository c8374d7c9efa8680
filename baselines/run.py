"""Run a mission and show it: `python -m baselines.run room --strategy gradient --robots 3 --seed 0`.

Shows a progress bar and a table; with `--out DIR` writes `mission.json` (the figures and time
series), `mission.png` (curves and maps) and `mission.gif` (the mission as it went).
"""

from __future__ import annotations

import dataclasses
import json
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from baselines.command import Positional, make_folder, parse, print_json, run_command
from baselines.mission import run_mission, scripted
from baselines.strategies import make_strategy
from baselines.strategy import Strategy
from entropy_explore_env.config import Channel, Ending, RangeSensor, Robot, Scenario, with_settings
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.errors import SettingError
from entropy_explore_env.reports.animation import animate
from entropy_explore_env.reports.metrics import mission_figures
from entropy_explore_env.reports.painting import Painter, remaining_share
from entropy_explore_env.reports.recording import Recorder
from entropy_explore_env.scenarios import ROOM, find_scenario
from entropy_explore_env.writing import write_atomically

_GIF_FRAMES = 50
_GIF_FRAME_S = 0.1
_GIF_LAST_FRAMES = 20
"""The end is shown so many times as long as the rest."""
_SERIES_POINTS = 500


@dataclass
class Args:
    """Run a mission of a strategy and show it."""

    scenario: Positional[str] = "room"
    """A named scenario: room, office, cave, … (the README lists them)."""
    strategy: str = "gradient"
    """How robots choose viewpoints: random, gradient, gradient-plane."""
    robots: int = 3
    """Team size."""
    seed: int = 0
    """Of the world, the starts and every other draw."""
    world: str | None = None
    """A world file in place of the scenario's world; entropy_explore_env.worlds lists the kinds."""
    voxel_size_m: float | None = None
    """Resample the world file's voxels to this size; default: the scenario's."""
    out: Path | None = None
    """Folder for mission.json, mission.png and mission.gif."""
    json: bool = False
    """Print one JSON object and nothing else."""
    robot: Robot = dataclasses.field(default_factory=Robot)
    sensor: RangeSensor = dataclasses.field(default_factory=RangeSensor)
    channel: Channel = dataclasses.field(default_factory=Channel)
    ending: Ending = dataclasses.field(default_factory=Ending)


def main(words: Sequence[str]) -> int:
    """Run the command."""
    named = parse(Args, words, default=_defaults(ROOM), description=__doc__).scenario
    args = parse(Args, words, default=_defaults(find_scenario(named)), description=__doc__)
    strategy = make_strategy(args.strategy)
    scenario = _scenario(args)
    if args.seed < 0:
        raise SettingError("seed", args.seed, "a whole number ≥ 0")
    if args.out is not None:
        make_folder("out", args.out)
    env = EntropyExploreEnv(scenario)
    started = time.perf_counter()
    log = _run(env, strategy, args)
    figures = mission_figures(env.missions, 0, floor=True)
    figures = {
        "scenario": figures.pop("scenario"),
        "strategy": args.strategy,
        **figures,
        "wall_s": round(time.perf_counter() - started, 3),
    }
    if args.out is not None:
        _write(args.out, figures, scenario, log)
    if args.json:
        print_json(figures)
    else:
        _print_table(figures, args.out)
    return 0


def _defaults(scenario: Scenario) -> Args:
    return Args(
        scenario=scenario.name,
        robots=scenario.robots,
        robot=scenario.robot,
        sensor=scenario.sensor,
        channel=scenario.channel,
        ending=scenario.ending,
    )


def _scenario(args: Args) -> Scenario:
    """The scenario with the command line's settings."""
    base = scripted(find_scenario(args.scenario))
    settings: dict[str, Any] = {"scored": True} | {
        name: getattr(args, name) for name in ("robots", "robot", "sensor", "channel", "ending")
    }
    if args.world is not None:
        settings["world"] = args.world
    elif args.voxel_size_m is not None:
        raise SettingError("voxel_size_m", args.voxel_size_m, "given together with --world only")
    if args.voxel_size_m is not None:
        settings["grid"] = {"voxel_size_m": args.voxel_size_m}
    return with_settings(base, settings)


class _Log:
    """What is kept of a mission while it runs: its series, and pictures if they are wanted."""

    def __init__(self, env: EntropyExploreEnv, pictures: bool) -> None:
        self.recorder = Recorder(env.missions)
        self.painter = Painter("rgb_array" if pictures else None)
        self.pictures: list[np.ndarray] = []
        self._every_s, self._due_s = 1.0, 0.0

    def note(self, env: EntropyExploreEnv) -> None:
        """Note a step; when there are too many pictures, every other one is dropped."""
        self.recorder.note()
        self.painter.watch(env.missions)
        time_s = float(env.missions.state.missions[0]["time_s"])
        picture = self.painter.picture(env.missions) if time_s >= self._due_s or not env.agents else None
        if picture is not None:
            self.pictures.append(picture)
            self._due_s = time_s + self._every_s
        if len(self.pictures) > 2 * _GIF_FRAMES:
            self.pictures = [*self.pictures[:-1:2], self.pictures[-1]]
            self._every_s *= 2.0


def _run(env: EntropyExploreEnv, strategy: Strategy, args: Args) -> _Log:
    """Run the mission under a progress bar."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn(
            "entropy left {task.fields[left]:>6.1%}  simulated {task.fields[time_s]:>7,.0f} s  "
            "shared {task.fields[shared]:>7,}"
        ),
        TimeElapsedColumn(),
    )
    logs: list[_Log] = []
    progress = Progress(*columns, console=Console(file=sys.stderr), transient=True, disable=args.json)
    task = progress.add_task(f"{args.scenario}, {args.strategy}", total=1.0, left=1.0, time_s=0.0, shared=0)

    def after_step(env: EntropyExploreEnv) -> None:
        if not logs:
            progress.start()
            logs.append(_Log(env, args.out is not None))
        logs[0].note(env)
        left = max(float(remaining_share(env.missions, 0).min()), 0.0)
        sent = int(env.missions.state.robots[0]["measurements_sent"].sum())
        progress.update(task, completed=1.0 - left, left=left, time_s=logs[0].recorder.latest_s, shared=sent)

    try:
        run_mission(env, strategy, args.seed, after_step)
    finally:
        if logs:
            progress.stop()
    return logs[0]


def _write(folder: Path, figures: dict[str, Any], scenario: Scenario, log: _Log) -> None:
    """Write the mission's three files, each whole or not at all."""
    from baselines.figures import mission_picture

    recorder = log.recorder
    rows = recorder.spread(_SERIES_POINTS)
    series = {
        "time_s": recorder.time_s[rows].tolist(),
        "entropy_bits": recorder.entropy_bits[rows].tolist(),
        "scans": recorder.scans[rows].tolist(),
        "shared_measurements": recorder.shared[rows].tolist(),
    }
    settings = dataclasses.asdict(scenario)
    content = {**figures, "settings": _finite(settings), "series": series}
    write_atomically(folder / "mission.json", json.dumps(content, indent=1, allow_nan=False) + "\n")
    write_atomically(folder / "mission.png", mission_picture(recorder, _named(figures), figures["strategy"]))
    kept = log.pictures[:: max(1, round(len(log.pictures) / _GIF_FRAMES))]
    animate([*kept, *[log.pictures[-1]] * _GIF_LAST_FRAMES], folder / "mission.gif", _GIF_FRAME_S)


def _finite(settings: Any) -> Any:  # noqa: ANN401 - a tree of anything that dataclasses hold
    """JSON has no infinity: it becomes the text "inf"."""
    if isinstance(settings, dict):
        return {name: _finite(value) for name, value in settings.items()}
    if isinstance(settings, list | tuple):
        return [_finite(value) for value in settings]
    return "inf" if settings == float("inf") else settings


_ROWS: tuple[tuple[str, str, Callable[[Any], str]], ...] = (
    ("finished", "finished", lambda v: "yes" if v else "no"),
    ("ended because", "end_reason", str),
    ("mission time", "t_mission_s", lambda v: f"{v:,.1f} s"),
    ("half, 90 %, 99 % of the bits after", "reached", str),
    ("scans", "scans", lambda v: f"{v:,}"),
    ("scans over the floor", "scans_over_floor", lambda v: f"{v:.2f}"),
    ("measurements", "measurements", lambda v: f"{v:,}"),
    ("shared measurements", "shared_measurements", lambda v: f"{v:,}"),
    ("bits sent", "bits_sent", lambda v: f"{v:,}"),
    ("bits gained per bit sent", "bits_gained_per_bit_sent", lambda v: f"{v:.3f}"),
    ("measurements below I_min", "overlap", lambda v: f"{v:.0%}"),
    ("explored by the team", "explored", lambda v: f"{v:.1%}"),
    ("map error, mean", "error", lambda v: f"{v:.4f}"),
    ("voxels on the wrong side of ½", "wrong", lambda v: f"{v:.2%}"),
    ("imbalance between robots", "balance", lambda v: f"{v:.2f}"),
    ("entropy at first", "entropy_start_bits", lambda v: f"{v:,.0f} bits"),
    ("entropy at the end", "entropy_end_bits", lambda v: f"{v:,.0f} bits"),
    ("driven", "distance_m", lambda v: f"{v:,.1f} m"),
    ("blocked moves", "blocked_moves", lambda v: f"{v:,}"),
    ("computed in (with compiling and drawing)", "wall_s", lambda v: f"{v:,.2f} s"),
)


def _named(figures: dict[str, Any]) -> str:
    """Scenario and, where it says more, its world."""
    same = figures["world"] in ("empty", "furnished")
    return figures["scenario"] if same else f"{figures['scenario']} ({figures['world']})"


def _print_table(figures: dict[str, Any], folder: Path | None) -> None:
    from rich.console import Console
    from rich.table import Table

    team = f"{figures['robots']} robot" + ("s" if figures["robots"] > 1 else "")
    print(f"{_named(figures)}, {figures['strategy']}, {team}, seed {figures['seed']}")
    table = Table(show_header=False)
    table.add_column(style="dim")
    table.add_column(justify="right")
    marks = (figures["t50_s"], figures["t90_s"], figures["t99_s"])
    reached = ", ".join("-" if mark is None else f"{mark:,.0f}" for mark in marks)
    values = {**figures, **figures["joint"], "reached": reached + " s"}
    for label, name, shown in _ROWS:
        if values[name] is not None:
            table.add_row(label, shown(values[name]))
    console = Console()
    console.print(table)
    if folder is not None:
        console.print(
            f"written: {folder}/mission.json, mission.png, mission.gif", highlight=False, soft_wrap=True
        )


if __name__ == "__main__":
    raise SystemExit(run_command(main))
