"""Options of `training.policy_improvement`, and their checks."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from entropy_explore_env.errors import SettingError
from entropy_explore_env.validation import check_whole, is_whole
from training.candidate_network import ATTENTION_LAYERS, WIDTH, check_attention_layers, check_width


@dataclass
class Args:
    """Learn to choose better than a planner among the viewpoints that it proposes."""

    tasks: tuple[str, ...] = ("room-furnished:3",)
    """Named scenarios with their robots, NAME:ROBOTS; files of labels are dealt to them in turn, the
    search runs in all of them, PPO learns in the first."""
    out: Path = Path("runs/improved")
    """Folder of the run, with a folder of each stage."""
    stage: Literal["labels", "regression", "search", "ppo", "all"] = "all"
    """What to do; regression needs labels."""
    seed: int = 0
    """Seed of missions, weights and all other draws."""
    threads: int = 2
    """Threads for missions and for learning."""
    candidates: int = 24
    """Viewpoints that the planner proposes at most."""
    width: int = WIDTH
    """Units of each candidate in the networks."""
    attention_layers: int = ATTENTION_LAYERS
    """Layers in which candidates look at each other; 0 = an MLP judges each alone."""
    compared: int = 64
    """Starts on which each stage's policy is compared with the planner; 0 = it is not."""
    json: bool = False
    """Print one JSON object and nothing else."""

    shards: int = 16
    """Files of labels."""
    missions: int = 4
    """Missions of a file of labels."""
    every: int = 40
    """Decisions for each one that is labelled, on average."""
    branches: int = 8
    """Candidates that are tried at a state, the planner's choice among them."""
    draws: int = 4
    """Random numbers over which a label is averaged."""
    horizon: int = 30
    """Decisions a robot until the learned time to go stands for the rest of a roll-out; 0 = never."""
    divisor: int = 4
    """So many times fewer viewpoints are drawn and refined in roll-outs."""
    states: int = 2
    """States whose roll-outs run at once: each takes branches × draws missions' memory."""
    policy: Path | None = None
    """A run whose policy leads the missions that are labelled; default: the planner."""

    epochs: int = 60
    """Passes over the labels."""
    batch: int = 128
    """States in a minibatch of the regression."""
    learning_rate: float = 1e-3
    """Of the regression."""

    rounds: int = 8
    """Of the search: how often it changes the weights."""
    begin: str = ""
    """A run, or pretrained:NAME, whose policy the search begins with; default: what the regression wrote,
    else the planner."""
    pairs: int = 48
    """Of missions, in each task and round of the search."""
    sigma: float = 0.3
    """How far the search tries weights: logits of candidates that differ by a feature's spread change by so
    much."""
    step: float = 1.0
    """Length of the search's first step, in units of sigma."""
    at_once: int = 16
    """Missions of the search that are run at once; the result does not depend on it."""

    ppo_steps: int = 200_000
    """Steps of PPO, counted per robot."""
    ppo_options: str = ""
    """Further options of training.ppo in one text: `--ppo-options='--batch 256 --clip 0.1'`."""


def check(args: Args) -> None:
    """Raise a SettingError where an option is out of its range."""
    for name in (
        "threads",
        "shards",
        "missions",
        "every",
        "divisor",
        "states",
        "epochs",
        "batch",
        "rounds",
        "pairs",
        "at_once",
        "ppo_steps",
    ):
        check_whole(name, getattr(args, name), 1)
    for name in ("seed", "horizon", "compared"):
        check_whole(name, getattr(args, name), 0)
    check_whole("candidates", args.candidates, 2)
    if not is_whole(args.branches, 2, args.candidates):
        raise SettingError(
            "branches", args.branches, f"a whole number from 2 to {args.candidates}, the candidates"
        )
    check_whole("draws", args.draws, 1)
    check_width(args.width)
    check_attention_layers(args.attention_layers)
    if not 0.0 < args.learning_rate < float("inf"):
        raise SettingError("learning_rate", args.learning_rate, "a number above 0")
    for name in ("sigma", "step"):
        if not 0.0 < getattr(args, name) <= 100.0:
            raise SettingError(name, getattr(args, name), "a number above 0, at most 100")
    if not args.tasks:
        raise SettingError("tasks", args.tasks, "at least one NAME:ROBOTS")
