"""Checks of the options that the commands of all trainers have."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

from entropy_explore_env.errors import SettingError
from entropy_explore_env.validation import check_whole, is_whole


class TrainerOptions(Protocol):
    """Options that every trainer has; the help of its command says what they mean."""

    total_steps: int
    seed: int
    missions: int
    learning_rate: float
    gae_lambda: float
    clip: float
    batch: int
    epochs: int
    checkpoint_every: int

    @property
    def hidden(self) -> Sequence[int]:
        """Units of the hidden layers."""
        ...


def check_options(args: TrainerOptions) -> None:
    """Raise a SettingError where an option is out of its range."""
    for name in ("total_steps", "missions", "batch", "epochs", "checkpoint_every"):
        check_whole(name, getattr(args, name), 1)
    check_whole("seed", args.seed, 0)
    check_share("gae_lambda", args.gae_lambda)
    for name in ("learning_rate", "clip"):
        if not 0.0 < getattr(args, name) < math.inf:
            raise SettingError(name, getattr(args, name), "a number above 0")
    if not args.hidden or not all(is_whole(units, 1) for units in args.hidden):
        raise SettingError("hidden", args.hidden, "whole numbers ≥ 1")


def check_share(name: str, value: float) -> None:
    """Raise a SettingError unless the value is above 0 and at most 1."""
    if not 0.0 < value <= 1.0:
        raise SettingError(name, value, "a number above 0, at most 1")


def check_new(out: Path, used: bool) -> None:
    """Raise a SettingError if there is a run in the folder of a new one already."""
    if used:
        raise SettingError("out", str(out), f"a new folder; --resume {out} continues the run in it")
