"""What each stage of the learning is worth: the stages without one of them, on several seeds, at small cost.

    python -m training.policy_improvement.ablations --out docs/results/policy/ablations

Every variant learns on the same labels of a seed, where it uses labels, and ends with the same comparison
with the planner, paired by start, in worlds of validation. A run that was stopped goes on.
"""

from __future__ import annotations

import json
import shutil
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from baselines.cli.arguments import make_folder, parse, run_command
from entropy_explore_env.errors import SettingError
from entropy_explore_env.starting import INTERRUPTED
from entropy_explore_env.validation import check_whole
from entropy_explore_env.writing import write_atomically
from training import extra  # noqa: F401 - before what is not there without it
from training.policy_improvement import __main__ as stages
from training.policy_improvement.ablations_table import FASTER, VARIANTS, WHOLE, Variant, read_result, shown
from training.policy_improvement.tasks import task_of


@dataclass
class Args:
    """What each stage of the learning is worth."""

    task: str = "office:1"
    """A named scenario with its robots, NAME:ROBOTS."""
    seeds: int = 3
    """Seeds 0, 1, …, of which every variant learns with each."""
    variants: str = ",".join(VARIANTS)
    """Which, commas between; the first is always run, since others share its labels."""
    threads: int = 2
    """Threads for missions and for learning."""
    compared: int = 12
    """Starts on which each policy is compared with the planner."""
    shards: int = 3
    """Files of labels."""
    missions: int = 3
    """Missions of a file of labels."""
    every: int = 30
    """Decisions for each one that is labelled, on average."""
    rounds: int = 2
    """Of the search."""
    pairs: int = 24
    """Of missions, in each round of the search."""
    ppo_steps: int = 8_192
    """Steps of PPO, counted per robot."""
    runs: Path = Path("runs/ablations")
    """Folder of the runs."""
    out: Path = Path("results/ablations")
    """Folder for VARIANT-SEED.json; the policies' page shows those in policy/ablations beside it."""


def main(words: Sequence[str]) -> int:
    """Run the command."""
    args = parse(Args, words, description=__doc__)
    for name in (
        "seeds",
        "threads",
        "compared",
        "shards",
        "missions",
        "every",
        "rounds",
        "pairs",
        "ppo_steps",
    ):
        check_whole(name, getattr(args, name), 1)
    names = list(dict.fromkeys([WHOLE, *args.variants.split(",")]))
    for name in names:
        if name not in VARIANTS:
            raise SettingError("variants", name, "some of " + ", ".join(VARIANTS))
    task_of(args.task, 2)
    for folder in (args.runs, args.out):
        make_folder("out", folder)
    for seed in range(args.seeds):
        for name in names:
            file = args.out / f"{name}-{seed}.json"
            if file.is_file():
                _check_same(args, file)
            else:
                found = learn(args, name, seed)
                if found is None:
                    return INTERRUPTED
                write_atomically(file, json.dumps(found, indent=1, allow_nan=False) + "\n")
    print(shown(args.out))
    return 0


def _check_same(args: Args, file: Path) -> None:
    """Raise a SettingError unless a file is of the same task and budget."""
    found = read_result(file)
    if found["task"] != args.task:
        raise SettingError("task", args.task, f"{found['task']}, as in {file}; or another --out")
    for name in _BUDGET:
        if found["budget"].get(name) != getattr(args, name):
            allowed = f"{found['budget'].get(name)}, as in {file}; or another --out"
            raise SettingError(name, getattr(args, name), allowed)


def learn(args: Args, name: str, seed: int) -> dict[str, Any] | None:
    """Run a variant with a seed; None if Ctrl-C stopped it."""
    variant, out = VARIANTS[name], args.runs / f"{name}-{seed}"
    if variant.shares:
        _share(args.runs / f"{WHOLE}-{seed}", out, variant)
    options = ["--tasks", args.task, "--out", str(out), "--seed", str(seed), "--threads", str(args.threads)]
    for option in ("shards", "missions", "every", "rounds", "pairs", "ppo_steps"):
        options += [f"--{option.replace('_', '-')}", str(getattr(args, option))]
    at_end = f"--validation-missions 1 --validate-every {args.ppo_steps}"  # none but the last policy is kept
    ppo_options = f"{FASTER} {at_end} {variant.ppo_options}"
    options += [*variant.options, f"--ppo-options={ppo_options}"]
    for stage in variant.stages:
        last = stage == variant.stages[-1]
        compared = str(args.compared if last else 0)
        print(f"{name}, seed {seed}: {stage}", file=sys.stderr, flush=True)
        words = [*options, "--stage", stage, "--compared", compared]
        if stages.main(words) != 0:
            return None
    told = json.loads((out / variant.stages[-1] / stages.RESULT).read_text("utf-8"))["result"]
    return {
        "variant": name,
        "seed": seed,
        "task": args.task,
        "budget": {each: getattr(args, each) for each in _BUDGET},
        "compared": told["compared"][0],
    }


_BUDGET = ("shards", "missions", "every", "rounds", "pairs", "ppo_steps")


def _share(whole: Path, out: Path, variant: Variant) -> None:
    """Copy what a variant has in common with the whole; what is there already stays."""
    for stage in variant.stages[: variant.stages.index(variant.shares) + 1]:
        if not (out / stage).exists():
            shutil.copytree(whole / stage, out / stage)


if __name__ == "__main__":
    raise SystemExit(run_command(main))
