"""What a policy learns, measured: `python -m training.experiment --out docs/results`.

Trains the runs below, compares their policies with the strategies on 100 test starts, and writes `ppo.md`
with its figures. Runs and missions are kept: whatever was stopped continues where it was. `--quick` shrinks
everything to some minutes, to see that it works.
"""

from __future__ import annotations

import contextlib
import csv
import io
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from baselines.cli.arguments import make_folder, parse, print_json, run_command
from baselines.cli.worker_options import WorkerOptions
from baselines.experiments.ray_cluster import RayCluster
from baselines.experiments.worker_pool import Failure, run_each
from entropy_explore_env.errors import SettingError
from entropy_explore_env.validation import check_whole
from training import ppo
from training.checkpoints import latest_checkpoint, load_checkpoint
from training.errors import CheckpointError
from training.evaluate import SIMPLE, compare, evaluation_scenario
from training.policy import POLICIES
from training.run_folder import FILE

RIVALS = (*SIMPLE, "planned-rate")
SEEDS = 3
"""Runs of each ablation, with the seeds 0, 1, …"""


@dataclass(frozen=True)
class Task:
    """A scenario to learn.

    Attributes:
        scenario: Its name.
        steps: Steps of a run.
        seeds: Runs, with the seeds 0, 1, …
        goal: The policy's median mission time is to be at most this share of the better simple strategy's.
    """

    scenario: str
    steps: int
    seeds: int
    goal: float

    def run(self, seed: int) -> str:
        """Name of a run."""
        return f"{self.scenario}-3-seed-{seed}"


class Ablation(NamedTuple):
    """Runs with one thing changed.

    Attributes:
        change: What is changed, as a sentence.
        options: Options of `training.ppo` that change it.
        reference: The ablation that it differs from in this one thing.
    """

    change: str
    options: tuple[str, ...] = ()
    reference: str = "default"


TASKS = (Task("room", 2_500_000, SEEDS, 0.45), Task("room-furnished", 2_500_000, 1, 0.6))
ABLATIONS = {
    "default": Ablation("as in the long runs"),
    "team-reward": Ablation("the reward is the team's, not the robot's own", ("--reward", "team")),
    "overview": Ablation(
        "the whole map, pooled to 8 × 8 × 4 cells, is observed, too",
        ("--overview", "--features", "maps"),
        reference="vector",
    ),
    "vector": Ablation("an MLP alone, which overview is to be compared with", ("--features", "vector")),
    "3-pitches": Ablation("gazes and panorama with 3 pitches instead of 7", ("--pitches", "3")),
    "no-announcements": Ablation("robots do not say where they go", ("--channel.no-announcements",)),
    "burst-32": Ablation("at most 32 measurements a batch instead of 64", ("--channel.burst", "32")),
    "burst-128": Ablation("at most 128 measurements a batch", ("--channel.burst", "128")),
    "i-min-0.6215": Ablation(
        "only measurements of 0.6215 bits or more are sent", ("--channel.i-min-bits", "0.6215")
    ),
    "i-min-0.0291": Ablation("those of 0.0291 bits are, too", ("--channel.i-min-bits", "0.0291")),
    "per-decision": Ablation(
        "the discount is counted in decisions, not in seconds", ("--discount", "decisions", "--gamma", "0.9")
    ),
}
ABLATION_STEPS = 200_000


@dataclass
class Args(WorkerOptions):
    """Train, evaluate, and write docs/results/ppo.md."""

    out: Path = Path("results/ppo")
    """Folder for ppo.md; its figures and tables go into ppo in it."""
    runs: Path = Path("results/ppo-runs")
    """Folder where runs and missions are kept."""
    jobs: int | None = None
    """Runs or missions at a time, each on one thread; default: one for each processor."""
    seeds: int = 100
    """Test starts."""
    quick: bool = False
    """A few thousand steps in each run and 3 test starts."""
    only_train: str | None = None
    """Only train the runs whose names begin like this; write no page."""
    no_training: bool = False
    """Write the page from the runs that are there; ablations are left out unless all of theirs are."""
    json: bool = False
    """Print one JSON object and nothing else."""


@dataclass(frozen=True)
class ExperimentResults:
    """What the page shows.

    Attributes:
        tasks: The scenarios.
        comparisons: Scenario → what `evaluate.compare` returned for its first run's policy.
        curves: Run → rows of its curve.
        progress: Run → its progress in the end: steps and seconds.
        ablations: Name → curves of its runs; empty while runs are missing.
        ablation_steps: Steps of an ablation's run.
    """

    tasks: Sequence[Task]
    comparisons: dict[str, dict[str, Any]]
    curves: dict[str, list[dict[str, float]]]
    progress: dict[str, dict[str, Any]]
    ablations: dict[str, list[list[dict[str, float]]]] = field(default_factory=dict)
    ablation_steps: int = ABLATION_STEPS


class TrainingRun(NamedTuple):
    """A run of `training.ppo`, its folder and options."""

    folder: Path
    options: tuple[str, ...]


def main(words: Sequence[str]) -> int:
    """Run the command."""
    args = parse(Args, words, description=__doc__)
    check_whole("seeds", args.seeds, 1)
    make_folder("runs", args.runs)
    workers = args.workers
    tasks = [Task(task.scenario, 8_192, task.seeds, task.goal) for task in TASKS] if args.quick else TASKS
    steps, starts = (4_096, min(args.seeds, 3)) if args.quick else (ABLATION_STEPS, args.seeds)
    wanted = planned_runs(tasks, steps, args.quick)
    if args.only_train is not None:
        wanted = {name: options for name, options in wanted.items() if name.startswith(args.only_train)}
    if not args.no_training:
        train(wanted, args.runs, workers, args.json)
    if args.only_train is not None:
        return 0
    make_folder("out", args.out)
    results = gather(tasks, steps, args.runs, starts, workers, args.json)
    from training.experiment_page import write_page  # matplotlib: after the help

    page = write_page(args.out, results, "python -m training.experiment --out docs/results")
    if args.json:
        print_json({"compared": results.comparisons, "page": str(page)})
    else:
        print(f"written: {page} and its figures", file=sys.stderr)
    return 0


def planned_runs(tasks: Sequence[Task], steps: int, quick: bool) -> dict[str, list[str]]:
    """Run → options of `training.ppo`, in the order of seeds."""
    small = (
        "--missions 4 --rollout-steps 32 --validation-missions 2 --time-limit-s 60".split() if quick else []
    )
    runs: dict[str, list[str]] = {}
    for seed in range(SEEDS):
        for task in tasks:
            if seed < task.seeds:
                runs[task.run(seed)] = _options(task.scenario, task.steps, seed) + small
    for seed in range(SEEDS):
        for name, ablation in ABLATIONS.items():
            usual = _options("room", steps, seed)
            runs[f"ablations/{name}-{seed}"] = [*usual, *ablation.options, *small, "--no-video"]
    return runs


def _options(scenario: str, steps: int, seed: int) -> list[str]:
    return ["--scenario", scenario, "--robots", "3", "--total-steps", str(steps), "--seed", str(seed)]


def train(runs: Mapping[str, Sequence[str]], folder: Path, workers: int | RayCluster, quiet: bool) -> None:
    """Train what is missing, each run on one thread.

    Args:
        runs: Run → options of `training.ppo`.
        folder: Of all runs.
        workers: Processes of this machine, or a Ray cluster whose machines share the folder: a run that
            loses its worker goes on from its latest checkpoint, wherever it is begun again.
        quiet: Whether to print nothing.

    Raises:
        SettingError: A run failed, or another machine of the cluster kept it; start again to continue.
    """
    missing = [name for name, options in runs.items() if not _done(folder / name, options)]
    todo = [TrainingRun(folder / name, tuple(runs[name])) for name in missing]
    for done, (run, result) in enumerate(run_each(_train, todo, workers), 1):
        name = run.folder.relative_to(folder).as_posix()
        if isinstance(result, Failure):
            raise SettingError("runs", f"{name}: {result.reason}", "runs that end well")
        if not _done(run.folder, run.options):
            raise SettingError("runs", str(folder), f"a folder that all machines share: {name} is not in it")
        if not quiet:
            print(f"trained {name}, {len(todo) - done} more runs to come", file=sys.stderr, flush=True)


def _train(run: TrainingRun) -> None:
    """Begin or continue a run in this process."""
    with contextlib.redirect_stdout(io.StringIO()):
        begun = (run.folder / FILE).is_file()
        ppo.main(
            ["--threads", "1", "--json", *run.options, "--resume" if begun else "--out", str(run.folder)]
        )


def _done(run: Path, options: Sequence[str]) -> bool:
    """Whether a run has done all of its steps."""
    steps = int(options[options.index("--total-steps") + 1])
    try:
        return load_checkpoint(latest_checkpoint(run, "step")).progress["steps"] >= steps
    except CheckpointError:
        return False


def gather(
    tasks: Sequence[Task], steps: int, folder: Path, starts: int, workers: int | RayCluster, quiet: bool
) -> ExperimentResults:
    """Evaluate the first policy of each task, and read all curves."""
    comparisons = {}
    for task in tasks:
        policy = folder / task.run(0)
        trained = load_checkpoint(latest_checkpoint(policy, *POLICIES)).settings
        scenario = evaluation_scenario(trained)
        others = [str(folder / task.run(seed)) for seed in range(1, task.seeds)]
        comparisons[task.scenario] = compare(
            str(policy), [*RIVALS, *others], scenario, starts, folder / "missions", workers, quiet
        )
    names = [task.run(seed) for task in tasks for seed in range(task.seeds)]
    ablations = {name: [folder / f"ablations/{name}-{seed}" for seed in range(SEEDS)] for name in ABLATIONS}
    unfinished = [run for runs in ablations.values() for run in runs if not (run / "curve.csv").is_file()]
    last = {name: load_checkpoint(latest_checkpoint(folder / name, "step")).progress for name in names}
    return ExperimentResults(
        tasks,
        comparisons,
        {name: read_curve(folder / name) for name in names},
        last,
        {} if unfinished else {name: [read_curve(run) for run in runs] for name, runs in ablations.items()},
        steps,
    )


def read_curve(run: Path) -> list[dict[str, float]]:
    """The rows of a run's curve; empty cells are NaN."""
    with (run / "curve.csv").open(encoding="utf-8", newline="") as file:
        return [
            {name: float(cell) if cell else np.nan for name, cell in row.items()}
            for row in csv.DictReader(file)
        ]


if __name__ == "__main__":
    raise SystemExit(run_command(main))
