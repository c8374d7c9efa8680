"""The options of `training.ppo`, what they ask for, and which of them go together."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Literal

import numpy as np

from baselines.cli.arguments import parse
from baselines.cli.task_options import (
    absolute_files,
    base_task,
    is_whole_scenario,
    parsed_for,
    settled,
    tasked,
)
from entropy_explore_env.command import home_path
from entropy_explore_env.errors import SettingError
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.validation import check_whole
from training import extra  # noqa: F401 - before what is not there without it
from training.candidate_network import ATTENTION_LAYERS, WIDTH, check_attention_layers, check_width
from training.policy import candidate_form, panorama_form
from training.runs import LearningOptions, check_options
from training.validation import TrainingTask

OWN = {"ending": {"time_limit_s": 2000.0}}
"""What training changes of named scenarios: longer missions would teach little and take all the time."""
_UPDATES, _LEAST = 8, (8, 16)
"""Of a short run by default: its updates, and the least missions and steps of a rollout."""


@dataclass
class Args(LearningOptions):
    """Train a policy with PPO."""

    usual: ClassVar = (
        *("scenario", "robots", "missions", "total_steps", "seed", "world", "validation_world", "settings"),
        *("actions", "reward", "threads", "out", "resume", "start", "json"),
    )

    missions: int = 64
    """Missions simulated at a time; fewer by default where --total-steps is small."""
    total_steps: int = 2_500_000
    """Steps to train for, counted per robot."""
    out: Path | None = None
    """Folder of a new run; default: runs/SCENARIO-ROBOTS."""
    threads: int = 2
    """Threads for missions and for updates; choosing actions takes one."""
    json: bool = False
    """Print one JSON object and nothing else."""

    reward: Literal["individual", "team", "seconds"] = "individual"
    """individual: bits that the robot's own scans take from its map; team: bits that the team's maps lose;
    seconds: less the seconds that the mission takes, and nothing else."""
    validation_world: tuple[str, ...] = ()
    """World files of validation, read as those of --world; default: the same as those learned in."""

    features: Literal["gazes", "vector", "maps"] = "gazes"
    """vector: an MLP; gazes: also a small network for gazes, over the panorama; maps: also convolutions."""
    overview: bool = False
    """Observe the whole belief, pooled to a few cells; with vector features as plain numbers."""
    patch: bool = False
    """Observe the belief around the robot; needs `--features maps`."""
    actions: Literal["discrete", "continuous", "candidates"] = "discrete"
    """discrete: 7 moves × yaws × pitches; continuous: any viewpoint within reach; candidates: one of the
    viewpoints that a planner proposes, with networks of their own that begin as the planner."""
    candidates: int = 24
    """Viewpoints that the planner proposes at most."""
    width: int = WIDTH
    """Units of each candidate in the networks of `--actions candidates`."""
    attention_layers: int = ATTENTION_LAYERS
    """Layers in which candidates look at each other; 0 = an MLP judges each alone."""
    critic: Literal["observed", "privileged"] = "observed"
    """privileged: in training the critic of `--actions candidates` also reads what no robot may know."""

    rollout_steps: int = 128
    """Steps of each mission between two updates; fewer by default where --total-steps is small."""
    batch: int = 1024
    """Decisions in a minibatch."""
    target_kl: float | None = None
    """An update ends when the policy has moved about this far, in nats; default: after all of its epochs."""
    critic_first: int = 0
    """Updates at the beginning in which only the critic learns."""
    start: str | None = None
    """A run or a checkpoint whose weights to begin with; default: fresh ones."""

    validate_every: int = 250_000
    """Steps between two validations."""
    video: bool = True
    """At the end, run a mission of the best policy and write it as a picture and an animation."""
    checkpoint_every: int = 500_000
    """Steps between two checkpoints, the first after the first update: what a run that is killed loses at
    most; one that Ctrl-C stops loses nothing."""

    @property
    def over_candidates(self) -> bool:
        """Whether actions are numbers of candidates."""
        return self.actions == "candidates"

    @property
    def networks(self) -> str:
        """Name of the networks."""
        return "candidates" if self.over_candidates else self.features

    @property
    def layers(self) -> tuple[int, ...]:
        """Units of the networks, as PolicySettings have them."""
        return (self.width,) if self.over_candidates else tuple(self.hidden)


def check(args: Args) -> None:
    """Raise a SettingError where an option is out of its range."""
    check_options(args)
    for name in ("threads", "rollout_steps"):
        check_whole(name, getattr(args, name), 1)
    if args.patch and args.features != "maps":
        raise SettingError("patch", args.patch, "--features maps beside it, whose networks read it")
    if args.target_kl is not None and not 0.0 < args.target_kl < np.inf:
        raise SettingError("target_kl", args.target_kl, "a number above 0")
    check_whole("critic_first", args.critic_first, 0)
    _check_candidates(args)
    own = base_task(args.scenario, args.task.settings, OWN).scenario.reward.cost_per_s  # as a run keeps it
    if args.reward == "seconds" and args.cost_per_s not in (None, own):
        raise SettingError("cost_per_s", args.cost_per_s, "no value beside --reward seconds")


_WITHOUT_CANDIDATES = ("features", "overview", "patch", "hidden", "yaws", "pitches")
_WITH_CANDIDATES = ("critic", "critic_first", "width", "attention_layers", "candidates")


def _check_candidates(args: Args) -> None:
    """Raise a SettingError where options of actions and networks do not go together, or would be ignored."""
    ignored = _WITHOUT_CANDIDATES if args.over_candidates else _WITH_CANDIDATES
    word = "with" if args.over_candidates else "without"
    defaults = Args()
    for name in ignored:
        if getattr(args, name) != getattr(defaults, name):
            raise SettingError(name, getattr(args, name), f"no value {word} --actions candidates")
    if args.over_candidates:
        check_width(args.width)
        check_attention_layers(args.attention_layers)


def parsed(words: Sequence[str], description: str | None = None) -> Args:
    """Return the arguments of a command line; what is not given is the scenario's own.

    Raises:
        UsageError: The words do not fit.
        SettingError: There is no such scenario.
    """
    first = parse(Args, words, description=description)
    task = base_task(first.scenario, first.task.settings, OWN)
    robots = {"robots": task.scenario.robots} if is_whole_scenario(first.task.settings) else {}
    named = dataclasses.replace(first, **robots)
    args = parsed_for(task, first, words, **robots, **rollout_that_fits(named))
    return settled_arguments(args)


def rollout_that_fits(args: Args) -> dict[str, int]:
    """Missions and steps of a rollout, by default: in a short run at most an eighth of it, if that can be.

    Both are halved in turn, down to 8 missions and 16 steps.
    """
    missions, steps = Args.missions, Args.rollout_steps
    while args.robots * missions * steps * _UPDATES > args.total_steps and (missions, steps) != _LEAST:
        missions, steps = (missions, steps // 2) if steps > missions else (missions // 2, steps)
    return {"missions": missions, "rollout_steps": steps}


def settled_arguments(args: Args) -> Args:
    """Return the same arguments wherever the run is continued."""
    files = absolute_files(args.validation_world)
    start = None if args.start is None else str(home_path(args.start).absolute())
    return dataclasses.replace(args, task=settled(args.task), validation_world=files, start=start)


def training_task(args: Args) -> TrainingTask:
    """Return what the policy learns in.

    Raises:
        SettingError: An option is not allowed.
        WorldError: A world file cannot be used.
    """
    named = base_task(args.scenario, args.task.settings, OWN).scenario
    scenario, surroundings = tasked(named, args.task, args.robots)
    reward: dict[str, Any] = {} if args.reward == "seconds" else {"kind": args.reward}
    if args.cost_per_s is not None:
        reward["cost_per_s"] = args.cost_per_s
    if args.over_candidates:
        form = candidate_form(args.candidates)
    else:
        form = panorama_form(args.actions, args.yaws, args.pitches)
        form["observation"] |= {"overview": args.overview, "patch": args.patch, "while_busy": False}
    scenario = with_settings(scenario, {"robots": args.robots, "reward": reward, **form})
    return TrainingTask(scenario, surroundings)
