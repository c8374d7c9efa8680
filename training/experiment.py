"""What a policy learns, measured: `python -m training.experiment --out docs/results`.

Trains what is missing of the runs below, puts the policies beside the strategies on 100 test starts, and
writes `ppo.md` with its figures. Runs and missions are kept, so that whatever was stopped goes on where it
was. `--quick` shrinks everything to some minutes and shows that it works, not what can be learned.
"""

from __future__ import annotations

import csv
import os
import subprocess
import sys
import threading
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from baselines.cli.arguments import make_folder, parse, print_json, run_command
from entropy_explore_env.errors import SettingError
from entropy_explore_env.validation import check_whole
from training.checkpoints import latest_checkpoint, load_checkpoint
from training.errors import CheckpointError
from training.evaluate import SIMPLE, compare, evaluation_scenario
from training.policy import POLICIES

RIVALS = (*SIMPLE, "information-rate")
SEEDS = 3
"""Runs of each kind, with the seeds 0, 1, …"""


@dataclass(frozen=True)
class Task:
    """A scenario that policies learn.

    Attributes:
        scenario: Its name.
        steps: Of a run.
        seeds: Runs.
        goal: The policy's median mission time is to be at most this share of the better simple rival's.
    """

    scenario: str
    steps: int
    seeds: int
    goal: float

    def run(self, seed: int) -> str:
        """Name of a run."""
        return f"{self.scenario}-3-seed-{seed}"


TASKS = (Task("room", 2_500_000, SEEDS, 0.45), Task("room-furnished", 2_500_000, 1, 0.6))
ABLATIONS: dict[str, tuple[str, tuple[str, ...]]] = {
    "default": ("as in the long runs", ()),
    "team-reward": ("the reward is the team's, not the robot's own", ("--reward", "team")),
    "overview": (
        "the whole map, pooled to 8 × 8 × 4 cells, is observed, too",
        ("--overview", "--features", "maps"),
    ),
    "vector": ("an MLP alone, which overview is to be compared with", ("--features", "vector")),
    "3-pitches": ("gazes and panorama with 3 pitches instead of 7", ("--pitches", "3")),
    "no-announcements": ("robots do not say where they go", ("--channel.no-announcements",)),
    "burst-32": ("at most 32 measurements a batch instead of 64", ("--channel.burst", "32")),
    "burst-128": ("at most 128 measurements a batch", ("--channel.burst", "128")),
    "i-min-0.6215": ("only measurements of 0.6215 bits or more are sent", ("--channel.i-min-bits", "0.6215")),
    "i-min-0.0291": ("those of 0.0291 bits are, too", ("--channel.i-min-bits", "0.0291")),
    "per-decision": (
        "the future shrinks with every decision, not every second",
        ("--discount", "decisions", "--gamma", "0.9"),
    ),
}
"""What is changed, one thing at a time: a sentence, and the options."""
BESIDE = {name: "vector" if name == "overview" else "default" for name in ABLATIONS}
"""The run that each differs from in that one thing."""
ABLATION_STEPS = 200_000


@dataclass
class Args:
    """Train, evaluate, and write docs/results/ppo.md."""

    out: Path = Path("results/ppo")
    """Folder for ppo.md and, in ppo, its figures and tables."""
    runs: Path = Path("results/ppo-runs")
    """Folder that keeps runs and missions."""
    jobs: int | None = None
    """Runs at a time, each on one thread; default: one a processor."""
    seeds: int = 100
    """Test starts."""
    quick: bool = False
    """A few thousand steps a run and 3 test starts."""
    only_train: str | None = None
    """Train the runs whose names begin so, and write nothing."""
    no_training: bool = False
    """Write the page of what is there; changes that lack runs are left out."""
    json: bool = False
    """Print one JSON object and nothing else."""


@dataclass(frozen=True)
class Found:
    """What the experiment came to.

    Attributes:
        tasks: The scenarios.
        compared: Scenario → what `evaluate.compare` found of its first run's policy.
        curves: Run → rows of its curve.
        spent: Run → its progress: steps and seconds.
        ablations: Name → curves of its runs; empty while runs are missing.
        steps: Of an ablation's run.
    """

    tasks: Sequence[Task]
    compared: dict[str, dict[str, Any]]
    curves: dict[str, list[dict[str, float]]]
    spent: dict[str, dict[str, Any]]
    ablations: dict[str, list[list[dict[str, float]]]] = field(default_factory=dict)
    steps: int = ABLATION_STEPS


def main(words: Sequence[str]) -> int:
    """Run the command."""
    args = parse(Args, words, description=__doc__)
    for name, value in (("seeds", args.seeds), ("jobs", 1 if args.jobs is None else args.jobs)):
        check_whole(name, value, 1)
    make_folder("runs", args.runs)
    jobs = args.jobs or os.cpu_count() or 1
    tasks = [Task(task.scenario, 8_192, task.seeds, task.goal) for task in TASKS] if args.quick else TASKS
    steps, starts = (4_096, min(args.seeds, 3)) if args.quick else (ABLATION_STEPS, args.seeds)
    wanted = planned_runs(tasks, steps, args.quick)
    if args.only_train is not None:
        wanted = {name: options for name, options in wanted.items() if name.startswith(args.only_train)}
    if not args.no_training:
        train(wanted, args.runs, jobs, args.json)
    if args.only_train is not None:
        return 0
    make_folder("out", args.out)
    found = gather(tasks, steps, args.runs, starts, jobs, args.json)
    from training.experiment_page import write_page  # matplotlib: after the help

    page = write_page(args.out, found, "python -m training.experiment --out docs/results")
    if args.json:
        print_json({"compared": found.compared, "page": str(page)})
    else:
        print(f"written: {page}, its figures beside it", file=sys.stderr)
    return 0


def planned_runs(tasks: Sequence[Task], steps: int, quick: bool) -> dict[str, list[str]]:
    """Run → options of `training.ppo`, the first seed of everything first."""
    small = (
        "--missions 4 --rollout-steps 32 --validation-missions 2 --time-limit-s 60".split() if quick else []
    )
    runs: dict[str, list[str]] = {}
    for seed in range(SEEDS):
        for task in tasks:
            if seed < task.seeds:
                runs[task.run(seed)] = _options(task.scenario, task.steps, seed) + small
    for seed in range(SEEDS):
        for name, (_, options) in ABLATIONS.items():
            own = [*_options("room", steps, seed), *options, *small, "--no-video"]
            runs[f"ablations/{name}-{seed}"] = own
    return runs


def _options(scenario: str, steps: int, seed: int) -> list[str]:
    return ["--scenario", scenario, "--robots", "3", "--total-steps", str(steps), "--seed", str(seed)]


def train(runs: dict[str, list[str]], folder: Path, jobs: int, quiet: bool) -> None:
    """Train what is missing, each run in a process of its own, on one thread.

    Raises:
        SettingError: A run failed; the others are done or can be gone on with.
    """
    waiting = [name for name, options in runs.items() if not _done(folder / name, options)]
    failed: list[str] = []
    lock = threading.Lock()

    def work() -> None:
        while True:
            with lock:
                if not waiting or failed:
                    return
                name = waiting.pop(0)
            if not quiet:
                print(f"training {name}, {len(waiting)} more to come …", file=sys.stderr, flush=True)
            words = [sys.executable, "-m", "training.ppo", *runs[name], "--threads", "1", "--resume"]
            done = subprocess.run(
                [*words, "--json", "--out", str(folder / name)], capture_output=True, text=True, check=False
            )
            if done.returncode:
                failed.append(f"{name}: {done.stderr.strip().splitlines()[-1:]}")

    threads = [threading.Thread(target=work) for _ in range(jobs)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    if failed:
        raise SettingError("runs", failed[0], "runs that end well")


def _done(run: Path, options: Sequence[str]) -> bool:
    """Whether a run has done all its steps."""
    steps = int(options[options.index("--total-steps") + 1])
    try:
        return load_checkpoint(latest_checkpoint(run, "step")).progress["steps"] >= steps
    except CheckpointError:
        return False


def gather(tasks: Sequence[Task], steps: int, folder: Path, starts: int, jobs: int, quiet: bool) -> Found:
    """Evaluate the first policy of each task, and read all curves."""
    compared = {}
    for task in tasks:
        policy = folder / task.run(0)
        trained = load_checkpoint(latest_checkpoint(policy, *POLICIES)).settings
        scenario = evaluation_scenario(trained)
        others = [str(folder / task.run(seed)) for seed in range(1, task.seeds)]
        compared[task.scenario] = compare(
            str(policy), [*RIVALS, *others], scenario, starts, folder / "missions", jobs, quiet
        )
    names = [task.run(seed) for task in tasks for seed in range(task.seeds)]
    changed = {name: [folder / f"ablations/{name}-{seed}" for seed in range(SEEDS)] for name in ABLATIONS}
    unfinished = [run for runs in changed.values() for run in runs if not (run / "curve.csv").is_file()]
    last = {name: load_checkpoint(latest_checkpoint(folder / name, "step")).progress for name in names}
    return Found(
        tasks,
        compared,
        {name: read_curve(folder / name) for name in names},
        last,
        {} if unfinished else {name: [read_curve(run) for run in runs] for name, runs in changed.items()},
        steps,
    )


def read_curve(run: Path) -> list[dict[str, float]]:
    """The rows of a run's curve; what was not there is not a number."""
    with (run / "curve.csv").open(encoding="utf-8", newline="") as file:
        return [
            {name: float(cell) if cell else np.nan for name, cell in row.items()}
            for row in csv.DictReader(file)
        ]


if __name__ == "__main__":
    raise SystemExit(run_command(main))
