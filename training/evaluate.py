"""Compare a learned policy with the strategies.

    python -m training.evaluate --pretrained room
    python -m training.evaluate --strategy runs/mine --against gradient,best --world test/*.png

Runs the policy and its rivals on the same seeds, in worlds of the test split, which no training uses, and
prints how long their missions take. `baselines.run` and `baselines.benchmark` take the same policies as
strategies: `pretrained:room`, the folder of a run, a file of planner weights.
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar

import numpy as np

from baselines.cli.arguments import make_folder, parse, print_json, run_command
from baselines.cli.options import Mark
from baselines.cli.task_options import (
    TaskOptions,
    base_task,
    is_whole_scenario,
    parsed_for,
    settings_in,
    tasked,
)
from baselines.cli.worker_options import WorkerOptions
from baselines.experiments.mission import Surroundings, counted_time_s
from baselines.experiments.ray_cluster import RayCluster
from baselines.experiments.rows import Record
from baselines.experiments.statistics import Interval, median_interval, median_ratio_interval
from baselines.experiments.tables import terminal_table
from baselines.experiments.trials import Cell, How, by_cell, run_cells
from baselines.strategies import is_learned, make_strategy, resolved, shown_names
from entropy_explore_env.errors import SettingError, counted
from entropy_explore_env.explorer.planned_rate import PlannedRate
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.settings.scenarios import SCENARIOS, find_scenario
from entropy_explore_env.settings.validation import check_whole
from training import extra  # noqa: F401 - before what is not there without it
from training.checkpoints import latest_checkpoint, load_checkpoint
from training.policy import POLICIES, PREFIX, policy_folder

SIMPLE = ("gradient", "random")
"""A policy must beat the better one of these, whatever else it is compared with."""


@dataclass
class Args(WorkerOptions):
    """Compare a learned policy with the strategies."""

    usual: ClassVar = (
        *("pretrained", "strategy", "against", "scenario", "robots", "seeds", "world", "voxel_size_m"),
        *("settings", "time_limit_s", "jobs", "cluster", "runs", "json"),
    )

    pretrained: str | None = None
    """A policy that comes with the project: room or plans."""
    strategy: str | None = None
    """The folder of a run of training.ppo, or of one of its checkpoints, or a file of planner weights."""
    against: str | None = None
    """Strategies to compare with, as in baselines.run, separated by commas; default:
    gradient,random, and for one over candidates planned-rate before them."""
    scenario: str | None = None
    """Named scenario; default: that of training, with its robots, sensors and channel."""
    robots: int | None = None
    """Robots in a team; default: as in training."""
    task: Annotated[TaskOptions, Mark.INLINE] = dataclasses.field(default_factory=TaskOptions)
    seeds: int = 100
    """Missions of each strategy, with the seeds 0, 1, …"""
    runs: Path = Path("results/evaluation-runs")
    """Folder where missions are kept: a stopped evaluation continues where it was."""
    json: bool = False
    """Print one JSON object and nothing else."""


def main(words: Sequence[str]) -> int:
    """Run the command."""
    args = parse(Args, words, description=__doc__)
    if (args.pretrained is None) == (args.strategy is None):
        raise SettingError("strategy", args.strategy, "either --strategy or --pretrained")
    check_whole("seeds", args.seeds, 1)
    workers = args.workers
    policy = args.strategy if args.pretrained is None else PREFIX + args.pretrained
    assert policy is not None
    trained = trained_in(policy)
    base = base_task(evaluation_scenario(trained, args.scenario, args.robots), args.task.settings)
    if args.scenario is not None and is_whole_scenario(args.task.settings):
        raise SettingError("scenario", args.scenario, "no value: --settings holds a scenario of its own")
    given = {} if args.task.settings is None else settings_in(args.task.settings)
    if "split" not in given or is_whole_scenario(args.task.settings):
        base = base._replace(scenario=with_settings(base.scenario, {"split": "test"}))
    args = parsed_for(base, args, words)
    elsewhere = args.scenario or args.task.settings or args.task.world
    made = {scenario.world for scenario in SCENARIOS.values()}  # the recipes
    if trained.world not in made and not elsewhere:
        raise SettingError("world", "left out", "world files to test in, as the policy learned in files")
    scenario, surroundings = tasked(base.scenario, args.task, args.robots)
    against = default_rivals(policy, trained) if args.against is None else args.against.split(",")
    rivals = list(dict.fromkeys(map(resolved, against)))
    for name in (policy, *rivals):
        make_strategy(name).reset(scenario, np.random.default_rng(0))
    make_folder("runs", args.runs)
    began = time.perf_counter()
    compared = compare(policy, rivals, scenario, args.seeds, args.runs, workers, args.json, surroundings)
    if args.json:
        print_json({**compared, "wall_s": round(time.perf_counter() - began, 1)})
    else:
        show(compared)
    return 0


def planner_tasks(policy: str) -> tuple[str, ...] | None:
    """Return the tasks NAME:ROBOTS that planner weights were found in; None = of a policy of networks."""
    if is_learned(policy):
        return None
    strategy = make_strategy(policy)
    if not isinstance(strategy, PlannedRate) or strategy.weights is None:
        raise SettingError("strategy", policy, "a learned policy or a file of planner weights; see --against")
    return strategy.weights.tasks


def trained_in(policy: str) -> Scenario:
    """Return the scenario that a policy, or the first one that planner weights, learned in.

    Raises:
        SettingError: It is no policy, or does not say where it learned.
        CheckpointError: It cannot be used.
    """
    tasks = planner_tasks(policy)
    if tasks is None:
        return load_checkpoint(latest_checkpoint(policy_folder(policy), *POLICIES)).settings.scenario
    if not tasks:
        raise SettingError("tasks", tasks, f"a task NAME:ROBOTS in the weights {policy}")
    return task_of(tasks[0])


def task_of(task: str) -> Scenario:
    """Return the scenario NAME:ROBOTS.

    Raises:
        SettingError: There is no such scenario, or no such team.
    """
    name, _, robots = task.partition(":")
    if not robots.isdecimal() or int(robots) < 1:
        raise SettingError("tasks", task, "NAME:ROBOTS, a named scenario and a number of robots")
    return with_settings(find_scenario(name), {"robots": int(robots)})


def default_rivals(policy: str, trained: Scenario) -> list[str]:
    """Return the strategies that a policy is compared with; one over candidates also with the planner."""
    over_candidates = trained.action.kind == "candidates" or planner_tasks(policy) is not None
    return [*(["planned-rate"] if over_candidates else []), *SIMPLE]


def evaluation_scenario(learned: Scenario, name: str | None = None, robots: int | None = None) -> Scenario:
    """Return the scenario of a test: that of a name with test worlds, and training's robots and channel.

    Args:
        learned: The scenario of training.
        name: Of the scenario; None = that of training.
        robots: Team size; None = that of training.
    """
    size = learned.robots if robots is None else robots
    changes = {"robots": size, "split": "test", "channel": learned.channel}
    if name is not None:
        return with_settings(find_scenario(name), changes)
    changes |= {each: getattr(learned, each) for each in ("robot", "sensor", "extra_kinds", "start_radius_m")}
    return with_settings(SCENARIOS.get(learned.name, learned), changes)


def compare(
    policy: str,
    rivals: Sequence[str],
    scenario: Scenario,
    seeds: int,
    runs: Path,
    workers: int | RayCluster,
    quiet: bool,
    surroundings: Surroundings | None = None,
) -> dict[str, Any]:
    """Run a policy and its rivals on the seeds 0, 1, … and compare their mission times.

    Args:
        policy: Name of the policy as a strategy.
        rivals: Names of strategies.
        scenario: The missions' scenario.
        seeds: Missions of each.
        runs: Folder where missions are kept.
        workers: Processes of this machine, or a Ray cluster.
        quiet: Whether to show no progress.
        surroundings: World files and starts of the missions; None = those that the scenario says.

    Returns:
        `scenario`, `split` of its worlds, `robots`, `seeds`, and `rows`: of each strategy its name,
        `median_s` with its 95 % interval (`low_s`, `high_s`), `mean_s`, `finished` of the missions, `scans`
        (median); of rivals also `ratio`, the policy's median over theirs, with its paired interval, and
        `faster`, the number of seeds on which the policy was faster.
        `better_rival` is the one of SIMPLE with the smaller median, `faster_than_simple` the number of seeds
        on which the policy was faster than all of SIMPLE among the rivals.
    """
    folder = f"{scenario.name}/robots-{scenario.robots}"
    around = None if surroundings == Surroundings() else surroundings
    cells = [
        Cell(f"{folder}/{name}", scenario, name, seeds, surroundings=around) for name in (policy, *rivals)
    ]
    records = by_cell(run_cells(cells, runs / "missions.jsonl", How(workers, "evaluation", quiet)))
    missions = {name: records[cell.id] for name, cell in zip((policy, *rivals), cells, strict=True)}
    times = {
        name: np.array([counted_time_s(record, scenario) for record in own]) for name, own in missions.items()
    }
    rows = [_row(name, missions[name], times[name], times[policy], name == policy) for name in missions]
    simple = [name for name in SIMPLE if name in rivals]
    return {
        "scenario": scenario.name,
        "split": scenario.split,
        "robots": scenario.robots,
        "seeds": seeds,
        "policy": policy,
        "rows": rows,
        "better_rival": min(simple, key=lambda name: float(np.median(times[name])), default=None),
        "faster_than_simple": int(np.all([times[policy] < times[name] for name in simple], axis=0).sum())
        if simple
        else None,
    }


def _row(
    name: str, records: Sequence[Record], times: np.ndarray, ours: np.ndarray, is_policy: bool
) -> dict[str, Any]:
    """Return a strategy's row of the table."""
    median, low, high = median_interval(times)
    row: dict[str, Any] = {
        "strategy": name,
        "median_s": median,
        "low_s": low,
        "high_s": high,
        "mean_s": float(times.mean()),
        "finished": int(sum(record["finished"] for record in records)),
        "scans": float(np.median([record["scans"] for record in records])),
    }
    if not is_policy:
        ratio, low, high = median_ratio_interval(ours, times)
        row |= {"ratio": ratio, "ratio_low": low, "ratio_high": high, "faster": int((ours < times).sum())}
    return row


def show(compared: dict[str, Any]) -> None:
    """Print a comparison as a table."""
    seeds, robots = compared["seeds"], compared["robots"]
    missions = f"{counted(seeds, 'mission')} each, worlds of the split {compared['split']}"
    print(f"{compared['scenario']}, {counted(robots, 'robot')}, {missions}\n")
    names = shown_names(row["strategy"] for row in compared["rows"])
    rows = []
    for row in compared["rows"]:
        name, median, _, *others = table_cells(row, seeds)
        short = (cell.partition(" of ")[0].replace(" (", "\n(") for cell in (median, *others))
        rows.append([names[name], *short])
    print(terminal_table(["strategy", "mission time", "finished", "scans", "ratio", "faster"], rows))
    print("mission time: median; ratio: the policy's median over the strategy's, both with")
    print("95 % intervals; faster: starts on which the policy was faster")
    there = {row["strategy"] for row in compared["rows"]}
    simple = [name for name in SIMPLE if name in there]
    if len(simple) > 1:
        print(
            f"better one of {' and '.join(simple)}: {compared['better_rival']};\n"
            f"faster than both: on {compared['faster_than_simple']} of {seeds} starts"
        )


def table_cells(row: dict[str, Any], seeds: int) -> list[str]:
    """Return a row as text."""
    cells = [
        row["strategy"],
        f"{row['median_s']:,.0f} s ({row['low_s']:,.0f} … {row['high_s']:,.0f})",
        f"{row['mean_s']:,.0f} s",
        f"{row['finished']} of {seeds}",
        f"{row['scans']:,.0f}",
    ]
    if "ratio" not in row:
        return [*cells, "", ""]
    ratio = Interval(row["ratio"], row["ratio_low"], row["ratio_high"])
    return [*cells, f"{ratio:.2f}", f"{row['faster']} of {seeds}"]


if __name__ == "__main__":
    raise SystemExit(run_command(main))
