"""Train a policy with PPO (Stable-Baselines3); one network drives every robot.

    python -m training.ppo --scenario room --robots 3 --total-steps 2_500_000 --seed 0 --out runs/room-3

The folder gets `curve.csv` (a row for each validation), TensorBoard's files (`tensorboard --logdir runs`),
the checkpoints `step-N` (the latest, for `--resume`) and `best-N` (the best in validation), and a mission of
the best policy as a picture and an animation. `python -m training.evaluate --strategy runs/room-3` compares
the policy with the strategies. Plans of one's own are learned in and tested in as lists of files:

    python -m training.ppo --scenario office --world train/*.png --validation-world val/*.png --out runs/mine
    python -m training.evaluate --strategy runs/mine --world test/*.png

Steps are counted per robot: a step of all missions is missions × robots of them. A robot that drives cannot
choose; `training/advantages.py` says what is learned of its steps.
"""

from __future__ import annotations

import dataclasses
import shlex
import sys
import warnings
from collections.abc import Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import Logger, TensorBoardOutputFormat

from baselines.cli.arguments import make_folder, print_json, run_command
from baselines.cli.task_options import base_task
from entropy_explore_env.command import INTERRUPTED
from entropy_explore_env.envs.privileged_vec_env import PrivilegedVecEnv
from entropy_explore_env.envs.rewards import StepFigures
from entropy_explore_env.envs.robot_vec_env import RobotVecEnv
from entropy_explore_env.writing import write_atomically
from training import extra  # noqa: F401 - before what is not there without it
from training.advantages import DecisionBuffer
from training.best_mission import draw_best_mission
from training.candidate_network import actor_frozen
from training.checkpoints import checkpoint_name, forget_later, save_checkpoint
from training.decision_ppo import DecisionPPO
from training.errors import NotFiniteError
from training.interruption import Interruption
from training.networks import policy_class, policy_keywords
from training.normalisation import Normaliser
from training.policy import normalise_observations, settings_of_policy, weights_of
from training.ppo_options import OWN, Args, check, parsed, settled_arguments, training_task
from training.progress import MissionFigures, Progress
from training.resuming import (
    TrainingState,
    check_unused,
    checkpoint_to_resume,
    restore_state,
    save_policy,
    save_state,
    start_from,
)
from training.run_folder import options_json, resume_command, resumed_options, save_options
from training.seeds import learning_seeds
from training.terminal import TrainingBar
from training.training_task import TrainingTask, validation_task
from training.validation import Validator

_MODULE = "training.ppo"
_CHANGEABLE = frozenset(
    ("video", "threads", "json", "total_steps", "validate_every", "checkpoint_every", "start")
)
"""Options that may differ where a run is continued; where it began does not matter any more."""
_STOPPED = "a checkpoint is written when this rollout and its update, or this validation, are done"
_RETURNS_MEMORY = 2e5
"""Decisions, about, whose returns normalise: the latest ones, since returns grow as the policy learns."""


def main(words: Sequence[str]) -> int:
    """Run the command."""
    args, changed = parsed(words, __doc__), {}
    if args.resume is not None:
        args, changed = resumed_options(Args, args.resume, words, _CHANGEABLE, __doc__, settled_arguments)
    named = base_task(args.scenario, args.task.settings, OWN).scenario
    out = args.out = args.out or Path("runs") / f"{named.name}-{args.robots}"
    if args.cost_per_s is None:
        args.cost_per_s = named.reward.cost_per_s
    check(args)
    task = training_task(args)
    checkpoint = None
    if args.resume is None:
        check_unused(out)
        make_folder("out", out)
    else:
        checkpoint = checkpoint_to_resume(out)
        if checkpoint is None and not args.json:
            print(f"no checkpoint in {out}: from the beginning{told(changed)}", file=sys.stderr, flush=True)
    torch.set_num_threads(args.threads)
    state = set_up(args, task)
    if args.start is not None and checkpoint is None:
        start_from(state, Path(args.start))
    if args.resume is None:
        save_options(out, args, _MODULE, words)
    state.options, state.command = options_json(args), shlex.join(["python", "-m", _MODULE, *words])
    with (
        TrainingBar(args.total_steps, hidden=args.json) as bar,
        Interruption(_STOPPED) as interruption,
    ):
        if checkpoint is not None:
            restore_state(state, checkpoint)
            forget_later(out, "best", state.model.num_timesteps)
            bar.say(f"{out} goes on after {state.model.num_timesteps:,} steps{told(changed)}")
        train(args, state, bar, interruption)
    if not finished(args, state):
        return say_stopped(out, state.model.num_timesteps, args.json)
    validated = validation_task(args.task, args.validation_world, state.settings.scenario, task)
    files = draw_best_mission(out, *validated) if args.video else [out]
    summary, best = state.summary(), state.progress.best
    if args.json:
        print_json(summary | {"best": best, "files": [str(file) for file in files]})
    else:
        print(
            f"best policy, after {best['steps']:,} steps: missions take {best['mean_s']:.1f} s on average, "
            f"{best['finished']:.0%} finished\nwritten: {', '.join(map(str, files))}"
        )
    return 0


def finished(args: Args, state: TrainingState) -> bool:
    """Whether all steps are done, and the last validation, too."""
    steps = state.model.num_timesteps
    return steps >= args.total_steps and state.progress.validated(steps)


def told(changed: Mapping[str, object]) -> str:
    """What is said of options that differ from those that a run was started with."""
    return "".join(f"; {name} was {value}" for name, value in changed.items())


def say_stopped(out: Path, steps: int, as_json: bool) -> int:
    """Say where a run that was interrupted stands, and how to go on; its exit code."""
    command = resume_command(_MODULE, out)
    if as_json:
        print_json({"interrupted": True, "steps": steps, "resume": command})
    else:
        print(f"stopped after {steps:,} steps, with a checkpoint in {out}; go on with\n\n    {command}\n")
    return INTERRUPTED


def set_up(args: Args, task: TrainingTask) -> TrainingState:
    """Missions to learn from, and PPO with fresh weights."""
    around = task.surroundings.settings()
    if args.reward == "seconds":
        around["reward_function"] = less_the_seconds
    rows_of = PrivilegedVecEnv if args.critic == "privileged" else RobotVecEnv
    seeds = learning_seeds(args.seed, args.missions)
    envs = rows_of(task.scenario, args.missions, threads=args.threads, seeds=seeds, **around)
    layout = envs.vector_env.missions.layout
    size = int(np.prod(envs.observation_space.shape or ()))
    settings = settings_of_policy(
        envs.scenario, args.networks, args.layers, size - layout.size, args.attention_layers
    )
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="You have specified a mini-batch")  # ours are of even size
        model = DecisionPPO(
            policy_class(settings.features),
            envs,
            learning_rate=lambda remaining: args.learning_rate * max(remaining, 0.05),
            n_steps=args.rollout_steps,
            batch_size=args.batch,
            n_epochs=args.epochs,
            gamma=args.gamma,
            gae_lambda=args.gae_lambda,
            clip_range=args.clip,
            ent_coef=args.entropy,
            target_kl=args.target_kl,
            rollout_buffer_class=DecisionBuffer,
            rollout_buffer_kwargs={
                "envs": envs,
                "discount": args.discount,
                "return_stats": Normaliser(memory=_RETURNS_MEMORY),
                "rng": np.random.default_rng(args.seed),
            },
            policy_kwargs=policy_keywords(
                settings.features,
                settings.scenario,
                settings.hidden,
                settings.privileged,
                settings.attention_layers,
            ),
            seed=args.seed,
            device="cpu",
        )
    return TrainingState(settings, model, envs, Normaliser(size), Progress(args.validate_every))


def less_the_seconds(figures: StepFigures) -> np.ndarray:
    """The reward of a step: less the seconds that it took, (E, A)."""
    return -figures.elapsed_s


def train(args: Args, state: TrainingState, bar: TrainingBar, interruption: Interruption) -> None:
    """Learn until all steps are done or Ctrl-C: rollout, update, and at times validation and checkpoint.

    Raises:
        NotFiniteError: A reward, a loss or a weight is not finite.
    """
    model, envs, progress, out = state.model, state.envs, state.progress, args.out
    assert isinstance(model, DecisionPPO) and out is not None
    model.set_logger(Logger(None, [TensorBoardOutputFormat(str(out))]))
    callback = model.start(args.total_steps, MissionFigures(args.robots))
    bar.show_steps(model.num_timesteps)
    task = validation_task(args.task, args.validation_world, state.settings.scenario, training_task(args))
    with closing(envs), closing(Validator(*task, args.validation_missions, args.threads)) as validator:
        while True:
            steps = model.num_timesteps
            last = steps >= args.total_steps
            # What Ctrl-C cut short is made up for here when the run goes on.
            if steps >= progress.next_validation or (last and not finished(args, state)):
                if validate(args, state, Validating(validator, bar, interruption)):
                    progress.next_validation = steps + args.validate_every
            stop = last or interruption.asked
            if steps and (steps >= progress.next_checkpoint or stop):
                progress.next_checkpoint = steps + args.checkpoint_every
                save_checkpoint(out / checkpoint_name("step", steps), save_state(state))
            model.dump_logs()
            if stop:
                return
            rollout_and_update(args, state, callback)
            bar.show_steps(model.num_timesteps)


def rollout_and_update(args: Args, state: TrainingState, callback: BaseCallback) -> None:
    """Collect a rollout and learn from it.

    Raises:
        NotFiniteError: A reward, a loss or a weight is not finite.
    """
    model, buffer, progress = state.model, state.buffer, state.progress
    assert isinstance(model, DecisionPPO)
    try:
        # The rollout; at its end the advantages of its decisions (training/advantages.py).
        with progress.timed("collecting_s"):
            model.collect_rollouts(state.envs, callback, buffer, args.rollout_steps)
        observations = buffer.observations[buffer.complete]
        # Epochs of minibatches with PPO's clipped loss (stable_baselines3.PPO.train).
        warming = model.num_timesteps <= args.critic_first * args.rollout_steps * state.envs.num_envs
        with progress.timed("learning_s"), actor_frozen(model.policy, warming):
            model.update()
    except (ValueError, RuntimeError):  # PyTorch's, of a distribution that is not finite
        check_finite(model)
        raise
    check_finite(model)
    state.observation_stats.update(observations)
    normalise_observations(model.policy, state.observation_stats)


class Validating(NamedTuple):
    """What a validation needs: its missions, where it is shown, and what stops it."""

    validator: Validator
    bar: TrainingBar
    interruption: Interruption


def validate(args: Args, state: TrainingState, needs: Validating) -> bool:
    """Add a row to the curve, and keep the policy if it is the best so far; False if Ctrl-C cut it short."""
    model, progress, steps, out = state.model, state.progress, state.model.num_timesteps, args.out
    assert out is not None
    needs.bar.say_validating(steps, args.validation_missions)
    with progress.timed("validating_s"):
        model.policy.set_training_mode(False)
        validation = needs.validator.validate(model.policy, lambda: needs.interruption.asked)
    if validation is None:
        return False
    is_best = progress.add_validation(steps, validation)
    write_atomically(out / "curve.csv", progress.curve_csv())
    for name, value in dataclasses.asdict(validation).items():
        if value is not None:
            model.logger.record(f"validation/{name}", value)
    needs.bar.show_validation(steps, validation)
    if is_best:
        save_checkpoint(out / checkpoint_name("best", steps), save_policy(state))
    return True


def check_finite(model: PPO) -> None:
    """Raise a NotFiniteError if the latest loss or any weight is not finite."""
    for name, value in model.logger.name_to_value.items():
        if name.startswith("train/") and name.endswith("loss") and not np.isfinite(value):
            raise NotFiniteError(name, value, model.num_timesteps)
    for name, weights in weights_of(model.policy).items():
        if not torch.isfinite(weights).all():
            value = float(weights[~torch.isfinite(weights)][0])
            raise NotFiniteError(name, value, model.num_timesteps)


if __name__ == "__main__":
    raise SystemExit(run_command(main))
