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
from typing import Any, NamedTuple

import numpy as np

from baselines.cli.arguments import make_folder, parse, run_command
from baselines.experiments.tables import markdown_table
from baselines.scoreboard.suites import team_name
from entropy_explore_env.errors import SettingError
from entropy_explore_env.starting import INTERRUPTED
from entropy_explore_env.validation import check_whole
from entropy_explore_env.writing import write_atomically
from training import extra  # noqa: F401 - before what is not there without it
from training.policy_improvement import __main__ as stages
from training.policy_improvement.tasks import task_of


class Variant(NamedTuple):
    """Stages, and options of theirs."""

    title: str
    stages: tuple[str, ...]
    """The last one's policy is compared with the planner."""
    options: tuple[str, ...] = ()
    ppo_options: str = ""
    shares: str = ""
    """Of the whole, with which everything up to this stage is the same: it is not done again."""


_WHOLE = "whole"
_FASTER = "--learning-rate 1e-3 --target-kl 0.03 --rollout-steps 128 --critic-first 1"
"""PPO updates more often and moves farther: a small budget would else leave every choice as it was."""
VARIANTS: dict[str, Variant] = {
    _WHOLE: Variant("labels, regression, PPO", ("labels", "regression", "ppo")),
    "no-labels": Variant("PPO from the planner, without labels and regression", ("ppo",)),
    "no-ppo": Variant("labels and regression, without PPO", ("labels", "regression"), shares="labels"),
    "mlp": Variant(
        "an MLP in place of attention",
        ("labels", "regression", "ppo"),
        ("--attention-layers", "0"),
        shares="labels",
    ),
    "bits": Variant(
        "PPO rewarded by bits, discounted by 0.9 a second",
        ("labels", "regression", "ppo"),
        ppo_options="--reward individual --gamma 0.9",
        shares="regression",
    ),
    "search": Variant("the search alone, as the policies that come with the project", ("search",)),
}


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
    names = list(dict.fromkeys([_WHOLE, *args.variants.split(",")]))
    for name in names:
        if name not in VARIANTS:
            raise SettingError("variants", name, "some of " + ", ".join(VARIANTS))
    task_of(args.task, 2)
    for folder in (args.runs, args.out):
        make_folder("out", folder)
    for seed in range(args.seeds):
        for name in names:
            file = args.out / f"{name}-{seed}.json"
            if not file.is_file():
                found = learn(args, name, seed)
                if found is None:
                    return INTERRUPTED
                write_atomically(file, json.dumps(found, indent=1, allow_nan=False) + "\n")
    print(shown(args.out))
    return 0


def learn(args: Args, name: str, seed: int) -> dict[str, Any] | None:
    """Run a variant with a seed; None if Ctrl-C stopped it."""
    variant, out = VARIANTS[name], args.runs / f"{name}-{seed}"
    if variant.shares:
        _share(args.runs / f"{_WHOLE}-{seed}", out, variant)
    options = ["--tasks", args.task, "--out", str(out), "--seed", str(seed), "--threads", str(args.threads)]
    for option in ("shards", "missions", "every", "rounds", "pairs", "ppo_steps"):
        options += [f"--{option.replace('_', '-')}", str(getattr(args, option))]
    at_end = f"--validation-missions 1 --validate-every {args.ppo_steps}"  # none but the last policy is kept
    ppo_options = f"{_FASTER} {at_end} {variant.ppo_options}"
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


def shown(folder: Path) -> str:
    """What was written to a folder, as a Markdown table; nothing where nothing was.

    Raises:
        SettingError: Something else lies there.
    """
    files = sorted(folder.glob("*.json"))
    found = [_read(file) for file in files]
    rows = []
    for name, variant in VARIANTS.items():
        own = [each for each in found if each["variant"] == name]
        if own:
            rows.append(_row(variant, own))
    if not rows:
        return ""
    budget = found[0]["budget"]
    labelled, pairs = budget["shards"] * budget["missions"], budget["rounds"] * budget["pairs"]
    searched = any(each["variant"] == "search" for each in found)
    search = f"; a search over {pairs} pairs of missions" if searched else ""
    said = (
        f"\nOf each seed: states of {labelled} missions labelled, one decision in {budget['every']}; "
        f"{budget['ppo_steps']:,} steps of PPO (`{_FASTER}`){search}.\n"
    )
    head = ["learned by", "task", "mean of ratios, by seed", "over all seeds", "finished"]
    return markdown_table(head, rows) + said


def _row(variant: Variant, found: Sequence[dict[str, Any]]) -> list[str]:
    ratios = [each["compared"]["mean_ratio"] for each in found]
    scenario, robots = found[0]["task"].split(":")
    finished, missions = (sum(each["compared"][name] for each in found) for name in ("finished", "missions"))
    return [
        variant.title,
        team_name(scenario, int(robots)),
        ", ".join(f"{ratio:.3f}" for ratio in ratios),
        f"{float(np.exp(np.log(ratios).mean())):.3f}",
        f"{finished} of {missions}",
    ]


def _read(file: Path) -> dict[str, Any]:
    """A file that the command wrote."""
    try:
        found = json.loads(file.read_text("utf-8"))
        for name in ("mean_ratio", "finished", "missions"):
            float(found["compared"][name])
        str(found["task"]).split(":")[1]
        dict(found["budget"])
        return found if found["variant"] in VARIANTS else _refuse(file)
    except (ValueError, KeyError, TypeError, IndexError):
        return _refuse(file)


def _refuse(file: Path) -> dict[str, Any]:
    wanted = "a file that python -m training.policy_improvement.ablations wrote"
    raise SettingError("ablations", str(file), wanted) from None


if __name__ == "__main__":
    raise SystemExit(run_command(main))
