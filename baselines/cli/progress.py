"""What a person sees of a mission in the terminal: a progress bar on standard error, then a table."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from tabulate import tabulate

from baselines.strategies import shown_name
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.errors import counted
from entropy_explore_env.reports.painting import remaining_share
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.settings.scenarios import SCENARIOS

LINE_EVERY_S = 15.0
"""On the clock, between two lines in place of a bar."""


@contextmanager
def progress_bar(title: str, hidden: bool) -> Iterator[Callable[[EntropyExploreEnv], None]]:
    """Yield a bar that is there from the first call of the function given, to be called after every step.

    Where standard error is no terminal, a line now and then stands in its place.
    """
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
    console = Console(file=sys.stderr)
    lines = not hidden and not console.is_terminal
    hidden = hidden or lines
    progress = Progress(*columns, console=console, transient=True, disable=hidden)
    task = progress.add_task(title, total=1.0, left=1.0, time_s=0.0, shared=0)

    started, told_s = False, time.monotonic()

    def show(env: EntropyExploreEnv) -> None:
        nonlocal started, told_s
        if not started:
            progress.start()
            started = True
        state = env.missions.state
        left = max(float(remaining_share(env.missions, 0).min()), 0.0)
        shared = int(state.robots[0]["measurements_sent"].sum())
        time_s = float(state.missions[0]["time_s"])
        progress.update(task, completed=1.0 - left, left=left, time_s=time_s, shared=shared)
        if lines and time.monotonic() - told_s > LINE_EVERY_S:
            told_s = time.monotonic()
            print(f"{title}: entropy left {left:.1%}, simulated {time_s:,.0f} s", file=sys.stderr, flush=True)

    try:
        yield show
    finally:
        if started:  # else it would print an empty line
            progress.stop()


_MOVED_M, _ENOUGH_SCANS = 1.0, 10
_OF_TEAMS = ("shared_measurements", "bits_sent", "balance", "entropy_mean_bits", "joint_bits")
_ROWS: tuple[tuple[str, str, Callable[[Any], str]], ...] = (
    ("finished", "finished", lambda v: "yes" if v else "no"),
    ("ended because", "end_reason", str),
    ("mission time", "t_mission_s", lambda v: f"{v:,.1f} s"),
    ("half, 90 %, 99 % of the bits after", "reached", str),
    ("scans", "scans", lambda v: f"{v:,}"),
    ("scans over the floor", "scans_over_floor", lambda v: f"{v:.2f}"),
    ("measurements", "measurements", lambda v: f"{v:,}"),
    ("shared measurements", "shared_measurements", lambda v: f"{v:,}"),
    ("summaries sent", "summaries_sent", lambda v: f"{v:,}"),
    ("bits sent", "bits_sent", lambda v: f"{v:,}"),
    ("bits gained per bit sent", "bits_gained_per_bit_sent", lambda v: f"{v:.3f}"),
    ("measurements below I_min", "overlap", lambda v: f"{v:.0%}"),
    ("explored, of what can be seen", "explored", lambda v: f"{v:.1%}"),
    ("map error, mean", "error", lambda v: f"{v:.4f}"),
    ("voxels on the wrong side of ½", "wrong", lambda v: f"{v:.2%}"),
    ("imbalance between robots", "balance", lambda v: f"{v:.2f}"),
    ("entropy at first", "entropy_start_bits", lambda v: f"{v:,.0f} bits"),
    ("entropy at the end", "entropy_end_bits", lambda v: f"{v:,.0f} bits"),
    ("entropy, mean of the team", "entropy_mean_bits", lambda v: f"{v:,.0f} bits"),
    ("entropy of the joint map", "joint_bits", lambda v: f"{v:,.0f} bits"),
    ("driven", "distance_m", lambda v: f"{v:,.1f} m"),
    ("blocked moves", "blocked_moves", lambda v: f"{v:,}"),
    ("error of what robots believe of their place, rms", "rms_error_m", lambda v: f"{v:.3f} m"),
    ("the same of their yaw", "rms_error_rad", lambda v: f"{v:.4f} rad"),
    ("sightings of fiducials", "sightings", lambda v: f"{v:,}"),
    ("sightings of landmarks in own maps", "own_sightings", lambda v: f"{v:,}"),
    ("faults", "faults_told", str),
    ("computed, compiled and drawn in", "wall_s", lambda v: f"{v:,.2f} s"),
)


def named(figures: dict[str, Any]) -> str:
    """Return the scenario and, where it says more, its world."""
    same = figures["world"] in ("empty", "furnished", figures["scenario"])
    return figures["scenario"] if same else f"{figures['scenario']} ({figures['world']})"


def _setting(scenario: Scenario) -> Iterator[tuple[str, str]]:
    """Return where a mission took place and whose robots were there: rows of the table."""
    grid = scenario.grid
    axes = 2 if grid.flat else 3
    yield "world", f"{' × '.join(map(str, grid.shape[:axes]))} voxels of {grid.voxel_size_m:.4g} m"
    edges = (f"{edge_m:.4g}" if edge_m < 1000 else f"{edge_m:,.0f}" for edge_m in grid.size_m[:axes])
    yield "its size", f"{' × '.join(edges)} m"
    named = SCENARIOS.get(scenario.name)
    if named is not None:
        there = with_settings(named, {"grid": grid})  # in a 2-D world the sensor is level
        usual = (there.robot, there.sensor, there.extra_kinds)
        changed = usual != (scenario.robot, scenario.sensor, scenario.extra_kinds)
        yield "robots and sensor", f"those of {named.name}" + (", changed" if changed else "")
    ranges = {kind.sensor.max_range_m: None for kind in scenario.kinds}  # in order, each once
    said = ("the whole world" if range_m == math.inf else f"{range_m:g} m" for range_m in ranges)
    yield "sensor's range", ", ".join(said)


def _told(faults: dict[str, int]) -> str | None:
    """Return what faults did, in words; None where there are none."""
    said = [f"{count:,} {name.replace('_', ' ')}" for name, count in faults.items() if count]
    return ("\n".join(said) or "none happened") if faults else None


def standing_still(figures: dict[str, Any], moved_m: float) -> list[str]:
    """Return warnings of robots that drove less than `moved_m` and were blocked or did not finish the map.

    In a room without obstacles a robot may well map all from where it starts, and a mission of a few scans
    says nothing.
    """
    return [
        f"warning: robot {number} has hardly moved: {robot['distance_m']:.1f} m in {robot['scans']:,} scans, "
        f"{robot['blocked_moves']:,} moves blocked"
        for number, robot in enumerate(figures["per_robot"])
        if robot["distance_m"] < moved_m
        and robot["scans"] >= _ENOUGH_SCANS
        and (robot["blocked_moves"] > 0 or not figures["finished"])
    ]


def _moved_m(scenario: Scenario) -> float:
    """Return what a robot that maps a world drives at least: a metre, its body's length twice, or a voxel."""
    lengths_m = (2 * kind.robot.body_radius_m for kind in scenario.kinds)
    return max(_MOVED_M, 2 * max(lengths_m), scenario.grid.voxel_size_m)


def print_table(figures: dict[str, Any], written: list[Path], scenario: Scenario) -> None:
    """Print what a mission came to, and the files that were written."""
    team = counted(figures["robots"], "robot")
    print(f"{named(figures)}, {shown_name(figures['strategy'])}, {team}, seed {figures['seed']}")
    marks = (figures["t50_s"], figures["t90_s"], figures["t99_s"])
    reached = ", ".join("-" if mark is None else f"{mark:,.0f}" for mark in marks)
    none = all(mark is None for mark in marks)
    joint = figures.get("joint", {})
    values = {**figures, **joint, **figures.get("localization", {})}
    values |= {"reached": "-" if none else reached + " s"}
    values["joint_bits"] = joint.get("entropy_bits")
    values["faults_told"] = _told(figures.get("faults", {}))
    rows = list(_setting(scenario))
    for label, name, shown in _ROWS:
        alone = figures["robots"] == 1 and name in _OF_TEAMS
        partial = name == "scans_over_floor" and not figures["finished"]  # the floor is a whole map's
        if values.get(name) is not None and not alone and not partial:
            rows.append((label, shown(values[name])))
    print(tabulate(rows, disable_numparse=True, colalign=("left", "right")))
    for warning in standing_still(figures, _moved_m(scenario)):
        print(warning)
    if written:
        print(f"written: {', '.join(map(str, written))}")
