"""Variants of the learning, each without one of its parts, and the table of what `ablations` found."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from baselines.experiments.tables import markdown_table
from baselines.scoreboard.suites import team_name
from entropy_explore_env.errors import SettingError


class Variant(NamedTuple):
    """Stages, and options of theirs."""

    title: str
    stages: tuple[str, ...]
    """The last one's policy is compared with the planner."""
    options: tuple[str, ...] = ()
    ppo_options: str = ""
    shares: str = ""
    """Of the whole, with which everything up to this stage is the same: it is not done again."""


WHOLE = "whole"
FASTER = "--learning-rate 1e-3 --target-kl 0.03 --rollout-steps 128 --critic-first 1"
"""PPO updates more often and moves farther: a small budget would else leave every choice as it was."""
VARIANTS: dict[str, Variant] = {
    WHOLE: Variant("labels, regression, PPO", ("labels", "regression", "ppo")),
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


def shown(folder: Path) -> str:
    """What was written to a folder, as a Markdown table; nothing where nothing was.

    Raises:
        SettingError: Something else lies there.
    """
    files = sorted(folder.glob("*.json"))
    found = [read_result(file) for file in files]
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
        f"{budget['ppo_steps']:,} steps of PPO (`{FASTER}`){search}.\n"
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


def read_result(file: Path) -> dict[str, Any]:
    """A file that the command wrote.

    Raises:
        SettingError: It did not write this one.
    """
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
