"""Learn a policy with PPO (Stable-Baselines3): one network drives every robot of every mission.

    python -m training.ppo --scenario room --robots 3 --total-steps 2_500_000 --seed 0 --out runs/room-3

The folder gets `curve.csv` (validation as it went), TensorBoard's files (`tensorboard --logdir runs`), the
checkpoints `step-N` (the latest, to go on from with `--resume`) and `best-N` (by validation), and the best
policy's mission as a picture and an animation. `python -m training.evaluate --strategy runs/room-3` puts the
policy beside the strategies.

A step is one of the environment's for each robot of each mission. Robots that drive cannot choose; see
`training.decisions` for what is learned of them.
"""

from __future__ import annotations

import dataclasses
import json
import shlex
import time
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import torch
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import Logger, TensorBoardOutputFormat

from baselines.cli.arguments import make_folder, parse, print_json, run_command
from baselines.experiments.cells import csv_table
from entropy_explore_env.envs.robot_vec_env import RobotVecEnv
from entropy_explore_env.errors import SettingError
from entropy_explore_env.scenario import Scenario, with_settings
from entropy_explore_env.scenarios import find_scenario
from entropy_explore_env.settings import Channel
from entropy_explore_env.validation import check_whole, is_whole
from entropy_explore_env.writing import write_atomically
from training.checkpoints import (
    Checkpoint,
    PolicySettings,
    checkpoint_name,
    forget_later,
    latest_checkpoint,
    load_checkpoint,
    save_checkpoint,
)
from training.collecting import DecisionPPO
from training.decisions import DecisionBuffer, Discount
from training.errors import CheckpointError, NotFiniteError
from training.film import film_best
from training.networks import policy_class, policy_settings
from training.policy import (
    rescale_observations,
    scale_arrays,
    scale_of,
    take_weights,
    weights_of,
)
from training.resuming import keep_training, take_up_training
from training.scales import RunningScale
from training.seeds import learning_seeds
from training.terminal import TrainingBar
from training.validation import Validator


@dataclass
class Args:
    """Learn a policy with PPO."""

    scenario: str = "room"
    """A named scenario: room, room-furnished, office, … (the README lists them)."""
    robots: int = 3
    """Team size."""
    missions: int = 64
    """Missions that are under way at once."""
    total_steps: int = 2_500_000
    """Steps of robots, all missions together."""
    seed: int = 0
    """Of the weights, the missions and every other draw."""
    out: Path = Path("runs/room-3")
    """Folder of the run."""
    resume: bool = False
    """Go on from the latest checkpoint in the folder; from the beginning if there is none."""
    threads: int = 2
    """For the missions and for learning; the policy chooses on one."""
    json: bool = False
    """Print one JSON object and nothing else."""

    reward: Literal["individual", "team"] = "individual"
    """What a robot is rewarded for: bits that it takes from its own map, or that the team's maps lose."""
    cost_per_s: float = 0.01
    """Taken from the reward for each second, in shares of the bits that the mission asks for."""
    decision_period_s: float | None = None
    """Robots decide at these moments only; by default as soon as they can."""
    time_limit_s: float = 2000.0
    """Missions are cut off then, in learning and in validation."""
    channel: Channel = dataclasses.field(default_factory=Channel)

    features: Literal["gazes", "vector", "maps"] = "gazes"
    """What looks at observations. vector: an MLP at panorama, self and team; gazes: beside it one small
    network for every gaze, at the panorama around it; maps: beside the MLP convolutions at maps."""
    overview: bool = False
    """Observe the whole belief, pooled; with vector features as plain numbers."""
    patch: bool = False
    """Observe the belief around the robot; wants `--features maps`."""
    hidden: tuple[int, ...] = (128, 128)
    """Units of the hidden layers of actor and critic."""
    actions: Literal["discrete", "continuous"] = "discrete"
    """7 moves × yaws × pitches, or any viewpoint within reach."""
    yaws: int = 16
    """Gazes, and rays of the panorama, around the horizon."""
    pitches: int = 7
    """Gazes, and rays of the panorama, from -45° to 45°."""

    rollout_steps: int = 128
    """Steps of a mission between two updates."""
    epochs: int = 4
    """How often each decision is learned from."""
    batch: int = 1024
    """Decisions of a gradient step."""
    learning_rate: float = 1e-3
    """At first; it falls linearly to a twentieth."""
    discount: Discount = "seconds"
    """What gamma shrinks the future by: every second that passes, or every decision."""
    gamma: float = 0.9
    """The share that is left of what lies one second, or one decision, ahead."""
    gae_lambda: float = 0.95
    """Of generalised advantage estimation, per decision."""
    clip: float = 0.2
    """Of PPO's ratio."""
    entropy: float = 0.003
    """Weight of the policy's entropy."""

    validate_every: int = 250_000
    """Steps between two validations."""
    validation_missions: int = 32
    """Missions of each."""
    video: bool = True
    """At the end, run the best policy once and write its mission as a picture and an animation."""
    checkpoint_every: int = 500_000
    """Steps between two checkpoints; a run that is resumed loses at most so many."""


_COUNTS = ("missions", "total_steps", "threads", "rollout_steps", "epochs", "batch")
_COUNTS += ("validate_every", "validation_missions", "checkpoint_every")
_COUNTED = ("best", "curve", "next_validation", "next_checkpoint")
_PARTS = ("collecting_s", "learning_s", "validating_s", "processor_s")
_FREE = ("out", "video", "resume", "threads", "json", "total_steps")
"""Options that a resumed run may change."""


def main(words: Sequence[str]) -> int:
    """Run the command."""
    args = parse(Args, words, description=__doc__)
    _check(args)
    scenario = training_scenario(args)
    make_folder("out", args.out)
    found = _found_checkpoint(args)
    torch.set_num_threads(args.threads)
    with TrainingBar(args.total_steps, hidden=args.json) as bar:
        run = Run(args, scenario, bar)
        if found is not None:
            run.resume(found)
        run.learn(shlex.join(["python", "-m", "training.ppo", *words]))
    files = film_best(args.out, scenario) if args.video else [args.out]
    summary = run.progress() | {"best": run.best, "files": [str(file) for file in files]}
    if args.json:
        print_json(summary)
    else:
        best = run.best
        print(
            f"best policy, after {best['steps']:,} steps: missions take {best['mean_s']:.1f} s on average, "
            f"{best['finished']:.0%} finished\nseen in {', '.join(summary['files'])}"
        )
    return 0


def _check(args: Args) -> None:
    """Raise a SettingError where a number is out of its range."""
    for name in _COUNTS:
        check_whole(name, getattr(args, name), 1)
    check_whole("seed", args.seed, 0)
    for name in ("gamma", "gae_lambda"):
        if not 0.0 < getattr(args, name) <= 1.0:
            raise SettingError(name, getattr(args, name), "a number above 0, at most 1")
    for name in ("learning_rate", "clip"):
        if not 0.0 < getattr(args, name) < np.inf:
            raise SettingError(name, getattr(args, name), "a number above 0")
    if not 0.0 <= args.entropy < np.inf:
        raise SettingError("entropy", args.entropy, "a number ≥ 0")
    if not args.hidden or not all(is_whole(units, 1) for units in args.hidden):
        raise SettingError("hidden", args.hidden, "whole numbers ≥ 1")
    if args.patch and args.features != "maps":
        raise SettingError("patch", args.patch, "--features maps with it, which is what looks at it")


def training_scenario(args: Args) -> Scenario:
    """What the policy learns in."""
    return with_settings(
        find_scenario(args.scenario),
        {
            "robots": args.robots,
            "split": "train",
            "channel": args.channel,
            "decision_period_s": args.decision_period_s,
            "time_limit_s": args.time_limit_s,
            "reward": {"kind": args.reward, "cost_per_s": args.cost_per_s},
            "action": {"kind": args.actions, "moves": "axes", "yaws": args.yaws, "pitches": args.pitches},
            "observation": {
                "panorama_yaws": args.yaws,
                "panorama_pitches": args.pitches,
                "panorama_utility": "log2",
                "overview": args.overview,
                "patch": args.patch,
                "flat": True,
                "while_busy": False,
            },
        },
    )


def _found_checkpoint(args: Args) -> Checkpoint | None:
    """What to go on from; None to begin.

    Raises:
        CheckpointError: There is something, but not to go on from.
    """
    used = [path for mark in ("step-*", "best-*", "curve.csv") for path in args.out.glob(mark)]
    if used and not args.resume:
        raise SettingError("out", str(args.out), "a new folder, or --resume to go on with the run in it")
    try:
        folder = latest_checkpoint(args.out, "step")
    except CheckpointError:
        forget_later(args.out, "best", 0)
        return None
    found = load_checkpoint(folder, training=True)
    then, now = found.progress.get("args"), _described(args)
    for name, value in now.items():
        if name not in _FREE and (not isinstance(then, dict) or then.get(name) != value):
            was = then.get(name) if isinstance(then, dict) else None
            raise CheckpointError(name, value, f"{was}, as in the run that {folder} is of")
    return found


def _described(args: Args) -> dict[str, Any]:
    """The options as JSON holds them; those of the channel are part of the scenario."""
    options = {name: value for name, value in vars(args).items() if name != "channel"}
    return json.loads(json.dumps(options | {"out": str(args.out)}))


class Run:
    """A policy, the missions that it learns from, and how far it has come."""

    def __init__(self, args: Args, scenario: Scenario, bar: TrainingBar) -> None:
        """Make the missions and a policy with fresh weights."""
        self.args, self.scenario, self.bar = args, scenario, bar
        self.settings = PolicySettings(scenario, args.features, tuple(args.hidden))
        seeds = learning_seeds(args.seed, args.missions)
        self.rows = RobotVecEnv(scenario, args.missions, threads=args.threads, seeds=seeds)
        self.layout = self.rows.vector_env.missions.layout
        self.validator = Validator(scenario, args.validation_missions, args.threads)
        self.observed, self.returns = RunningScale(self.layout.size), RunningScale(1, memory=2e5)
        self.chance = np.random.default_rng(args.seed)
        self.model = self._model()
        assert isinstance(self.model.rollout_buffer, DecisionBuffer)
        self.buffer: DecisionBuffer = self.model.rollout_buffer
        self.seen = np.zeros((0, self.layout.size), np.float32)
        self.best: dict[str, Any] = {}
        self.curve: list[dict[str, float | None]] = []
        self.spent: dict[str, float] = {part: 0.0 for part in _PARTS}
        self.next_validation, self.next_checkpoint = args.validate_every, args.checkpoint_every

    def _model(self) -> DecisionPPO:
        """PPO with fresh weights, learning from decisions."""
        args = self.args
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", message="You have specified a mini-batch")  # batches are even
            return DecisionPPO(
                policy_class(args.features),
                self.rows,
                learning_rate=lambda remaining: args.learning_rate * max(remaining, 0.05),
                n_steps=args.rollout_steps,
                batch_size=args.batch,
                n_epochs=args.epochs,
                gamma=args.gamma,
                gae_lambda=args.gae_lambda,
                clip_range=args.clip,
                ent_coef=args.entropy,
                rollout_buffer_class=DecisionBuffer,
                rollout_buffer_kwargs={
                    "rows": self.rows,
                    "discount": args.discount,
                    "scale": self.returns,
                    "chance": self.chance,
                },
                policy_kwargs=policy_settings(args.features, self.scenario, tuple(args.hidden)),
                seed=args.seed,
                device="cpu",
            )

    def learn(self, command: str) -> None:
        """Learn until all steps are done.

        Raises:
            NotFiniteError: A reward, a loss or a weight is not finite.
        """
        self.command = command
        self.model.set_logger(Logger(None, [TensorBoardOutputFormat(str(self.args.out))]))
        left = self.args.total_steps - self.model.num_timesteps
        if left > 0:
            try:
                self.model.learn(left, callback=_Rollouts(self), reset_num_timesteps=False)
            except NotFiniteError as error:
                steps = self.model.num_timesteps if error.steps is None else error.steps
                raise NotFiniteError(error.tensor, error.value, steps) from None
            except (ValueError, RuntimeError) as error:  # of distributions that are not finite
                self.check_finite()
                raise error
        self.validator.close()
        self.rows.close()

    def check_finite(self) -> None:
        """Raise a NotFiniteError if the latest loss or any weight is not finite."""
        steps = self.model.num_timesteps
        for name, value in self.model.logger.name_to_value.items():
            if name.startswith("train/") and name.endswith("loss") and not np.isfinite(value):
                raise NotFiniteError(name, value, steps)
        for name, weights in weights_of(self.model.policy).items():
            if not torch.isfinite(weights).all():
                raise NotFiniteError(name, float(weights[~torch.isfinite(weights)][0]), steps)

    def update_done(self) -> None:
        """After an update: rescale observations by those seen, validate and save where it is time."""
        self.check_finite()
        steps = self.model.num_timesteps
        self.observed.update(self.seen)
        rescale_observations(self.model.policy, self.observed)
        last = steps >= self.args.total_steps
        if steps >= self.next_validation or last:
            self.next_validation = steps + self.args.validate_every
            self._validate()
        if steps >= self.next_checkpoint or last:
            self.next_checkpoint = steps + self.args.checkpoint_every
            save_checkpoint(self.args.out / checkpoint_name("step", steps), self._whole())

    def _validate(self) -> None:
        """Validate, note it in the curve, and keep the policy if it is the best one so far."""
        began = time.perf_counter()
        self.model.policy.set_training_mode(False)
        found = self.validator.validate(self.model.policy)
        self.spent["validating_s"] += time.perf_counter() - began
        steps = self.model.num_timesteps
        self.curve.append({"steps": steps, **self.spent, **dataclasses.asdict(found)})
        columns = {name: [row[name] for row in self.curve] for name in self.curve[0]}
        write_atomically(self.args.out / "curve.csv", csv_table(columns))
        for name, value in dataclasses.asdict(found).items():
            if value is not None:
                self.model.logger.record(f"validation/{name}", value)
        self.bar.validated(steps, found)
        if not self.best or found.mean_s < self.best["mean_s"]:
            self.best = {"steps": steps, **dataclasses.asdict(found)}
            save_checkpoint(self.args.out / checkpoint_name("best", steps), self._policy())

    def progress(self) -> dict[str, Any]:
        """How far training has come, and how one gets there."""
        return {
            "command": self.command,
            "args": _described(self.args),
            "steps": self.model.num_timesteps,
            **self.spent,
            "validation": self.curve[-1] if self.curve else None,
        }

    def _policy(self) -> Checkpoint:
        """The policy alone."""
        scales = scale_arrays("observations", self.observed) | scale_arrays("returns", self.returns)
        return Checkpoint(self.settings, self.progress(), weights_of(self.model.policy), scales)

    def _whole(self) -> Checkpoint:
        """The policy, and all that going on takes."""
        numbers = {name: getattr(self, name) for name in _COUNTED}
        checkpoint = self._policy()
        keep_training(
            checkpoint, self.model, self.rows, numbers | {"chance": self.chance.bit_generator.state}
        )
        return checkpoint

    def resume(self, found: Checkpoint) -> None:
        """Be where a checkpoint was.

        Raises:
            CheckpointError: It does not fit this run.
        """
        if found.settings != self.settings:
            name = self.scenario.name
            raise CheckpointError("scenario", name, "the settings that the run was started with")
        take_weights(self.model.policy, found)
        try:
            take_up_training(found, self.model, self.rows)
            self.observed = scale_of(found.scales, "observations", self.layout.size)
            self.returns.follow(scale_of(found.scales, "returns", 1))
            self.spent = {part: found.progress[part] for part in _PARTS}
            for name in _COUNTED:
                setattr(self, name, found.numbers[name])
            self.chance.bit_generator.state = found.numbers["chance"]
        except (LookupError, TypeError, ValueError) as error:
            raise CheckpointError("checkpoint", repr(error), "one of this version of training.ppo") from None
        forget_later(self.args.out, "best", self.model.num_timesteps)


class _Rollouts(BaseCallback):
    """Follows rollouts and updates, counts what missions came to, and tells the run."""

    def __init__(self, run: Run) -> None:
        super().__init__()
        self._run, self._figures = run, []
        self._marked_s, self._processor_s = time.perf_counter(), time.process_time()
        self._updated = False

    def _on_step(self) -> bool:
        robots = self._run.args.robots
        for row in np.flatnonzero(self._run.rows.ended)[::robots]:
            self._figures.append(self.locals["infos"][row]["figures"])
        return True

    def _on_rollout_start(self) -> None:
        if self._updated:
            self._spend("learning_s")
            self._run.update_done()
            self._spend(None)
        self._updated = True

    def _on_rollout_end(self) -> None:
        self._spend("collecting_s")
        buffer = self._run.buffer
        self._run.seen = buffer.observations[buffer.complete]
        self._log_missions()
        self._run.bar.moved(self.num_timesteps)

    def _on_training_end(self) -> None:
        self._spend("learning_s")
        self._run.update_done()
        self.logger.dump(self.num_timesteps)

    def _spend(self, part: str | None) -> None:
        """Count the time since the last mark."""
        now_s, processor_s = time.perf_counter(), time.process_time()
        if part is not None:
            self._run.spent[part] += now_s - self._marked_s
        self._run.spent["processor_s"] += processor_s - self._processor_s
        self._marked_s, self._processor_s = now_s, processor_s

    def _log_missions(self) -> None:
        decided = self._run.buffer.decided
        self.logger.record("missions/busy_share", 1.0 - float(decided.mean()))
        if self._figures:
            for name in ("t_mission_s", "finished", "bits_gained_per_bit_sent", "overlap", "scans"):
                told = [each[name] for each in self._figures if each[name] is not None]
                if told:
                    self.logger.record(f"missions/{name}", float(np.mean(told)))
            self._figures.clear()


if __name__ == "__main__":
    raise SystemExit(run_command(main))
