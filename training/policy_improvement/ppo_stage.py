"""The last stage: the options of `training.ppo` that it runs with, checked before the first stage."""

from __future__ import annotations

import shlex
from typing import NamedTuple

from entropy_explore_env.command import UsageError
from entropy_explore_env.errors import SettingError
from entropy_explore_env.scenario import Scenario
from training import ppo_options

_OF_THE_STAGES = (
    "scenario",
    "robots",
    "actions",
    "candidates",
    "width",
    "attention-layers",
    "critic",
    "start",
    "out",
    "resume",
)
"""Options of training.ppo that this command says."""


class PpoStage(NamedTuple):
    """What a command line says of the last stage."""

    candidates: int
    width: int
    """Units of each candidate in the networks."""
    attention_layers: int
    seed: int
    steps: int
    """Counted per robot."""
    options: str
    """Further options of training.ppo in one text."""


def ppo_words(stage: PpoStage, task: Scenario) -> list[str]:
    """Options of training.ppo for the last stage: small steps from where the one before ended."""
    robots = str(task.robots)
    chosen = {
        "scenario": task.name,
        "robots": robots,
        "actions": "candidates",
        "candidates": str(stage.candidates),
        "width": str(stage.width),
        "attention-layers": str(stage.attention_layers),
        "critic": "privileged",
        "reward": "seconds",
        "discount": "seconds",
        "gamma": "1.0",
        "learning-rate": "1e-4",
        "entropy": "0.0",
        "target-kl": "0.01",
        "critic-first": "3",
        "missions": "8",
        "rollout-steps": "256",
        "batch": "512",
        "total-steps": str(stage.steps),
        "validate-every": str(max(stage.steps // 8, 1)),
        "checkpoint-every": str(max(stage.steps // 8, 1)),
        "seed": str(stage.seed),
    }
    words = [word for name, value in chosen.items() for word in (f"--{name}", value)]
    return [*words, "--no-video", *_split(stage.options)]


def _split(options: str) -> list[str]:
    """The words of a text as a command line has them."""
    try:
        return shlex.split(options)
    except ValueError as error:
        allowed = f"options as on a command line ({error})"
        raise SettingError("ppo_options", options, allowed) from None


def check_ppo(stage: PpoStage, task: Scenario) -> None:
    """Raise a SettingError where the last stage would refuse its options, or they would undo the others."""
    words = _split(stage.options)
    for name in _OF_THE_STAGES:
        option = f"--{name}"
        if any(word == option or word.startswith(f"{option}=") for word in words):
            raise SettingError("ppo_options", stage.options, f"no {option}, which the stages say")
    try:
        options = ppo_options.parsed(ppo_words(stage, task))
        ppo_options.check(options)
        ppo_options.training_task(options)
    except (SettingError, UsageError) as error:
        allowed = f"options of training.ppo: {error}"
        raise SettingError("ppo_options", stage.options, allowed) from None
