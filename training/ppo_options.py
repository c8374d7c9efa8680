"""What `training.ppo` can be told: its options, their checks, and the task that they describe."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np

from baselines.cli.arguments import INLINE, WholeNumber, parse
from baselines.cli.task_options import (
    TaskOptions,
    absolute_files,
    base_task,
    is_whole_scenario,
    parsed_for,
    settled,
    tasked,
)
from entropy_explore_env.command import home_path
from entropy_explore_env.errors import SettingError
from entropy_explore_env.scenario import with_settings
from entropy_explore_env.validation import check_whole
from training.advantages import DiscountUnit
from training.candidate_network import ATTENTION_LAYERS, WIDTH, check_attention_layers, check_width
from training.options import check_options, check_share
from training.training_task import TrainingTask

OWN = {"ending": {"time_limit_s": 2000.0}}
"""What training changes of named scenarios: longer missions would teach little and take all the time."""

_UPDATES, _LEAST = 8, (8, 16)
"""Of a short run by default: its updates, and the least missions and steps of a rollout."""


@dataclass
class Args:
    """Train a policy with PPO."""

    scenario: str = "room"
    """Named scenario: room, room-furnished, office, … (docs/environments.md lists them)."""
    robots: int = 3
    """Robots in a team."""
    missions: int = 64
    """Missions simulated at a time; fewer by default where --total-steps is small."""
    total_steps: WholeNumber = 2_500_000
    """Steps to train for, counted per robot."""
    seed: int = 0
    """Seed of weights, missions and all other draws."""
    out: Path | None = None
    """Folder of a new run; default: runs/SCENARIO-ROBOTS."""
    resume: Path | None = None
    """Folder of a run to continue from its latest checkpoint, with the settings that it was started with."""
    threads: int = 2
    """Threads for missions and for updates; choosing actions takes one."""
    json: bool = False
    """Print one JSON object and nothing else."""

    reward: Literal["individual", "team", "seconds"] = "individual"
    """individual: bits that the robot's own scans take from its map; team: bits that the team's maps lose;
    seconds: less the seconds that the mission takes, and nothing else."""
    cost_per_s: float | None = None
    """Cost of a second, as a share of all bits that the mission has to gain; default: the scenario's."""
    task: Annotated[TaskOptions, INLINE] = dataclasses.field(default_factory=TaskOptions)
    validation_world: tuple[str, ...] = ()
    """World files of validation, read as those of --world; default: the same as those learned in."""

    features: Literal["gazes", "vector", "maps"] = "gazes"
    """vector: an MLP; gazes: also a small network for gazes, over the panorama; maps: also convolutions."""
    overview: bool = False
    """Observe the whole belief, pooled to a few cells; with vector features as plain numbers."""
    patch: bool = False
    """Observe the belief around the robot; needs `--features maps`."""
    hidden: tuple[int, ...] = (128, 128)
    """Units of the hidden layers of actor and critic."""
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
    yaws: int = 16
    """Gazes, and rays of the panorama, around the horizon."""
    pitches: int = 7
    """Gazes, and rays of the panorama, from -45° to 45°."""

    rollout_steps: int = 128
    """Steps of each mission between two updates; fewer by default where --total-steps is small."""
    epochs: int = 4
    """Passes over a rollout's decisions in an update."""
    batch: int = 1024
    """Decisions in a minibatch."""
    learning_rate: float = 1e-3
    """Adam's learning rate at first; it falls linearly to a twentieth."""
    discount: DiscountUnit = "seconds"
    """What the discount is counted in: seconds or decisions."""
    gamma: float = 0.9
    """Discount factor per second, or per decision."""
    gae_lambda: float = 0.95
    """λ of generalised advantage estimation, per decision."""
    clip: float = 0.2
    """Clipping range of PPO's probability ratio."""
    entropy: float = 0.003
    """Weight of the entropy bonus."""
    target_kl: float | None = None
    """An update ends when the policy has moved about this far, in nats; default: after all of its epochs."""
    critic_first: int = 0
    """Updates at the beginning in which only the critic learns."""
    start: str | None = None
    """A run or a checkpoint whose weights to begin with; default: fresh ones."""

    validate_every: WholeNumber = 250_000
    """Steps between two validations."""
    validation_missions: int = 32
    """Missions in a validation."""
    video: bool = True
    """At the end, run a mission of the best policy and write it as a picture and an animation."""
    checkpoint_every: WholeNumber = 500_000
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
    for name in ("threads", "rollout_steps", "validate_every", "validation_missions"):
        check_whole(name, getattr(args, name), 1)
    check_share("gamma", args.gamma)
    if not 0.0 <= args.entropy < np.inf:
        raise SettingError("entropy", args.entropy, "a number ≥ 0")
    if args.patch and args.features != "maps":
        raise SettingError("patch", args.patch, "used with --features maps, whose networks read it")
    if args.target_kl is not None and not 0.0 < args.target_kl < np.inf:
        raise SettingError("target_kl", args.target_kl, "a number above 0")
    check_whole("critic_first", args.critic_first, 0)
    _check_candidates(args)
    _check_costs(args)


_WITHOUT_CANDIDATES = ("features", "overview", "patch", "hidden", "yaws", "pitches")
_WITH_CANDIDATES = ("critic", "critic_first", "width", "attention_layers", "candidates")


def _check_candidates(args: Args) -> None:
    """Raise a SettingError where options of actions and networks do not go together, or would be ignored."""
    ignored = _WITHOUT_CANDIDATES if args.over_candidates else _WITH_CANDIDATES
    word = "with" if args.over_candidates else "without"
    defaults = Args()
    for name in ignored:
        if getattr(args, name) != getattr(defaults, name):
            raise SettingError(name, getattr(args, name), f"left out {word} --actions candidates")
    if args.over_candidates:
        check_width(args.width)
        check_attention_layers(args.attention_layers)


def _check_costs(args: Args) -> None:
    """Raise a SettingError where a cost is given that the reward does not have."""
    if args.reward != "seconds":
        return
    own = base_task(args.scenario, args.task.settings, OWN).scenario.reward.cost_per_s  # as a run keeps it
    if args.cost_per_s not in (None, own):
        raise SettingError("cost_per_s", args.cost_per_s, "left out with --reward seconds")


def parsed(words: Sequence[str], description: str | None = None) -> Args:
    """The arguments of a command line; what is not given is the scenario's own.

    Args:
        words: Of the command line.
        description: The first line of the help.

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
    """The same arguments wherever the run is continued.

    Raises:
        SettingError: A file of JSON does not hold what it should.
    """
    files = absolute_files(args.validation_world)
    start = None if args.start is None else str(home_path(args.start).absolute())
    return dataclasses.replace(args, task=settled(args.task), validation_world=files, start=start)


def training_task(args: Args) -> TrainingTask:
    """What the policy learns in.

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


def panorama_form(kind: str, yaws: int, pitches: int) -> dict[str, dict[str, Any]]:
    """Actions and observation of a policy that looks at a panorama, with a ray for each gaze."""
    return {
        "action": {"kind": kind, "moves": "axes", "yaws": yaws, "pitches": pitches},
        "observation": {
            "panorama_yaws": yaws,
            "panorama_pitches": pitches,
            "panorama_utility": "log2",
            "flat": True,
        },
    }


def candidate_form(candidates: int) -> dict[str, Any]:
    """Actions and observation of a policy over candidates; nothing of it depends on the team or the world."""
    nothing_else = dict.fromkeys(("panorama", "self_state", "team"), False)
    seen = dict.fromkeys(("candidates", "overlaps", "action_mask", "flat"), True)
    return {
        "action": {"kind": "candidates", "candidates": candidates},
        "observation": {**nothing_else, **seen, "while_busy": False},
    }
