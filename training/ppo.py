"""Train a policy with PPO (Stable-Baselines3); one network drives every robot.

    python -m training.ppo --scenario room --robots 3 --total-steps 2_500_000 --seed 0 --out runs/room-3

The folder gets `curve.csv` (a row for each validation), TensorBoard's files (`tensorboard --logdir runs`),
the checkpoints `step-N` (the latest, for `--resume`) and `best-N` (the best in validation), and a mission of
the best policy as a picture and an animation. `python -m training.evaluate --strategy runs/room-3` compares
the policy with the strategies.

Steps are counted per robot: a step of all missions is missions × robots of them. A robot that drives cannot
choose; `training/advantages.py` says what is learned of its steps.
"""

from __future__ import annotations

import dataclasses
import json
import shlex
import warnings
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import torch
from gymnasium import spaces
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import Logger, TensorBoardOutputFormat

from baselines.cli.arguments import make_folder, parse, print_json, run_command
from entropy_explore_env.envs.robot_vec_env import RobotVecEnv
from entropy_explore_env.errors import SettingError
from entropy_explore_env.scenario import Scenario, with_settings
from entropy_explore_env.scenarios import find_scenario
from entropy_explore_env.settings import Channel
from entropy_explore_env.validation import check_whole
from entropy_explore_env.writing import write_atomically
from training.advantages import DecisionBuffer, DiscountUnit
from training.best_mission import draw_best_mission
from training.checkpoints import PolicySettings, checkpoint_name, forget_later, save_checkpoint
from training.errors import NotFiniteError
from training.networks import policy_class, policy_settings
from training.normalisation import Normaliser
from training.options import check_options, check_share
from training.policy import normalise_observations, weights_of
from training.progress import MissionFigures, Progress
from training.resuming import TrainingState, checkpoint_to_resume, restore_state, save_policy, save_state
from training.seeds import learning_seeds
from training.terminal import TrainingBar
from training.validation import Validator

_CHANGEABLE = frozenset(("out", "video", "resume", "threads", "json", "total_steps"))
"""Options that a resumed run may change."""
_RETURNS_MEMORY = 2e5
"""Decisions, about, whose returns normalise: the latest ones, since returns grow as the policy learns."""


@dataclass
class Args:
    """Train a policy with PPO."""

    scenario: str = "room"
    """Named scenario: room, room-furnished, office, … (the README lists them)."""
    robots: int = 3
    """Robots in a team."""
    missions: int = 64
    """Missions simulated at a time."""
    total_steps: int = 2_500_000
    """Steps to train for, counted per robot."""
    seed: int = 0
    """Seed of weights, missions and all other draws."""
    out: Path = Path("runs/room-3")
    """Folder of the run."""
    resume: bool = False
    """Continue from the latest checkpoint in the folder; start a new run if it has none."""
    threads: int = 2
    """Threads for missions and for updates; choosing actions takes one."""
    json: bool = False
    """Print one JSON object and nothing else."""

    reward: Literal["individual", "team"] = "individual"
    """individual: bits that the robot's own scans take from its map; team: bits that the team's maps lose."""
    cost_per_s: float = 0.01
    """Cost of a second, as a share of all bits that the mission has to gain."""
    decision_period_s: float | None = None
    """Seconds between decisions; by default a robot decides as soon as it can."""
    time_limit_s: float = 2000.0
    """Simulated seconds after which a mission is cut off, in training and in validation."""
    channel: Channel = dataclasses.field(default_factory=Channel)

    features: Literal["gazes", "vector", "maps"] = "gazes"
    """vector: an MLP; gazes: also a small network for gazes, over the panorama; maps: also convolutions."""
    overview: bool = False
    """Observe the whole belief, pooled to a few cells; with vector features as plain numbers."""
    patch: bool = False
    """Observe the belief around the robot; needs `--features maps`."""
    hidden: tuple[int, ...] = (128, 128)
    """Units of the hidden layers of actor and critic."""
    actions: Literal["discrete", "continuous"] = "discrete"
    """discrete: 7 moves × yaws × pitches; continuous: any viewpoint within reach."""
    yaws: int = 16
    """Gazes, and rays of the panorama, around the horizon."""
    pitches: int = 7
    """Gazes, and rays of the panorama, from -45° to 45°."""

    rollout_steps: int = 128
    """Steps of each mission between two updates."""
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

    validate_every: int = 250_000
    """Steps between two validations."""
    validation_missions: int = 32
    """Missions in a validation."""
    video: bool = True
    """At the end, run a mission of the best policy and write it as a picture and an animation."""
    checkpoint_every: int = 500_000
    """Steps between two checkpoints; a run that is killed loses at most this many."""


def main(words: Sequence[str]) -> int:
    """Run the command."""
    args = parse(Args, words, description=__doc__)
    check(args)
    scenario = training_scenario(args)
    make_folder("out", args.out)
    options = {name: value for name, value in vars(args).items() if name != "channel"}  # of the scenario
    options = json.loads(json.dumps(options | {"out": str(args.out)}))
    checkpoint = checkpoint_to_resume(args.out, args.resume, options, _CHANGEABLE)
    torch.set_num_threads(args.threads)
    state = set_up(args, scenario)
    state.options, state.command = options, shlex.join(["python", "-m", "training.ppo", *words])
    if checkpoint is not None:
        restore_state(state, checkpoint)
        forget_later(args.out, "best", state.model.num_timesteps)
    with TrainingBar(args.total_steps, hidden=args.json) as bar:
        train(args, state, bar)
    files = draw_best_mission(args.out, scenario) if args.video else [args.out]
    summary, best = state.summary(), state.progress.best
    if args.json:
        print_json(summary | {"best": best, "files": [str(file) for file in files]})
    else:
        print(
            f"best policy, after {best['steps']:,} steps: missions take {best['mean_s']:.1f} s on average, "
            f"{best['finished']:.0%} finished\nwritten: {', '.join(map(str, files))}"
        )
    return 0


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


def training_scenario(args: Args) -> Scenario:
    """The scenario that the policy learns in."""
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


def set_up(args: Args, scenario: Scenario) -> TrainingState:
    """Missions to learn from, and PPO with fresh weights."""
    seeds = learning_seeds(args.seed, args.missions)
    envs = RobotVecEnv(scenario, args.missions, threads=args.threads, seeds=seeds)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="You have specified a mini-batch")  # ours are of even size
        model = DecisionPPO(
            policy_class(args.features),
            envs,
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
                "envs": envs,
                "discount": args.discount,
                "return_stats": Normaliser(memory=_RETURNS_MEMORY),
                "rng": np.random.default_rng(args.seed),
            },
            policy_kwargs=policy_settings(args.features, scenario, tuple(args.hidden)),
            seed=args.seed,
            device="cpu",
        )
    return TrainingState(
        PolicySettings(scenario, args.features, tuple(args.hidden)),
        model,
        envs,
        Normaliser(envs.vector_env.missions.layout.size),
        Progress(args.validate_every, args.checkpoint_every),
    )


def train(args: Args, state: TrainingState, bar: TrainingBar) -> None:
    """Learn until all steps are done: rollout, update, and at times validation and checkpoint.

    Raises:
        NotFiniteError: A reward, a loss or a weight is not finite.
    """
    model, envs, buffer, progress = state.model, state.envs, state.buffer, state.progress
    assert isinstance(model, DecisionPPO)
    model.set_logger(Logger(None, [TensorBoardOutputFormat(str(args.out))]))
    callback = model.start(args.total_steps, MissionFigures(args.robots))
    bar.show_steps(model.num_timesteps)
    scenario = state.settings.scenario
    with closing(envs), closing(Validator(scenario, args.validation_missions, args.threads)) as validator:
        while model.num_timesteps < args.total_steps:
            try:
                # The rollout; at its end the advantages of its decisions (training/advantages.py).
                with progress.timed("collecting_s"):
                    model.collect_rollouts(envs, callback, buffer, args.rollout_steps)
                observations = buffer.observations[buffer.complete]
                # Epochs of minibatches with PPO's clipped loss (stable_baselines3.PPO.train).
                with progress.timed("learning_s"):
                    model.update()
            except (ValueError, RuntimeError):  # PyTorch's, of a distribution that is not finite
                check_finite(model)
                raise
            check_finite(model)
            state.observation_stats.update(observations)
            normalise_observations(model.policy, state.observation_stats)

            steps = model.num_timesteps
            bar.show_steps(steps)
            last = steps >= args.total_steps
            if steps >= progress.next_validation or last:
                progress.next_validation = steps + args.validate_every
                validate(args, state, validator, bar)
            if steps >= progress.next_checkpoint or last:
                progress.next_checkpoint = steps + args.checkpoint_every
                save_checkpoint(args.out / checkpoint_name("step", steps), save_state(state))
            model.dump_logs()


def validate(args: Args, state: TrainingState, validator: Validator, bar: TrainingBar) -> None:
    """Add a row to the curve, and keep the policy if it is the best so far."""
    model, progress, steps = state.model, state.progress, state.model.num_timesteps
    with progress.timed("validating_s"):
        model.policy.set_training_mode(False)
        validation = validator.validate(model.policy)
    is_best = progress.add_validation(steps, validation)
    write_atomically(args.out / "curve.csv", progress.curve_csv())
    for name, value in dataclasses.asdict(validation).items():
        if value is not None:
            model.logger.record(f"validation/{name}", value)
    bar.show_validation(steps, validation)
    if is_best:
        save_checkpoint(args.out / checkpoint_name("best", steps), save_policy(state))


def check_finite(model: PPO) -> None:
    """Raise a NotFiniteError if the latest loss or any weight is not finite."""
    for name, value in model.logger.name_to_value.items():
        if name.startswith("train/") and name.endswith("loss") and not np.isfinite(value):
            raise NotFiniteError(name, value, model.num_timesteps)
    for name, weights in weights_of(model.policy).items():
        if not torch.isfinite(weights).all():
            value = float(weights[~torch.isfinite(weights)][0])
            raise NotFiniteError(name, value, model.num_timesteps)


class DecisionPPO(PPO):
    """Stable-Baselines3's PPO over a RobotVecEnv, whose policy is asked only where robots decide.

    What a busy robot would choose is ignored and its value is never used: neither is computed, and no random
    number is drawn for it. The rollout holds action 0, value 0 and log-probability 0 in its place.
    """

    def start(self, total_steps: int, callback: BaseCallback) -> BaseCallback:
        """Prepare a loop of rollouts and updates up to so many steps, as `learn` does."""
        _, callback = self._setup_learn(total_steps - self.num_timesteps, callback, reset_num_timesteps=False)
        return callback

    def collect_rollouts(
        self,
        env: Any,  # noqa: ANN401 - a RobotVecEnv; the base class has them wider
        callback: BaseCallback,
        rollout_buffer: Any,  # noqa: ANN401 - a DecisionBuffer
        n_rollout_steps: int,
    ) -> bool:
        """Fill the buffer and compute its advantages; False if the callback stopped it.

        Raises:
            NotFiniteError: A reward is not finite.
        """
        threads = torch.get_num_threads()
        torch.set_num_threads(
            1
        )  # a few robots at a time: more threads would only take time from the missions
        try:
            return self._collect(env, callback, rollout_buffer, n_rollout_steps)
        finally:
            torch.set_num_threads(threads)

    def _collect(
        self, env: RobotVecEnv, callback: BaseCallback, rollout_buffer: DecisionBuffer, steps: int
    ) -> bool:
        """As `collect_rollouts`."""
        self.policy.set_training_mode(False)
        rollout_buffer.reset()
        callback.on_rollout_start()
        for _ in range(steps):
            before: Any = self._last_obs
            actions, values, log_probs = self.choose(before, env.deciding)
            within = actions
            if isinstance(self.action_space, spaces.Box):
                within = np.clip(actions, self.action_space.low, self.action_space.high)
            observations: Any
            observations, rewards, dones, infos = env.step(within)
            self.num_timesteps += env.num_envs
            if not np.isfinite(env.rewards).all():
                value = env.rewards[~np.isfinite(env.rewards)][0]
                raise NotFiniteError("reward", value, self.num_timesteps)
            callback.update_locals(locals())
            if not callback.on_step():
                return False
            self._update_info_buffer(infos, dones)
            final_values = self._final_values(dones, infos)
            starts = self._last_episode_starts
            rollout_buffer.add_step(final_values, before, actions, rewards, starts, values, log_probs)
            self._last_obs, self._last_episode_starts = observations, dones
        with torch.no_grad():
            values = self.policy.predict_values(torch.as_tensor(observations))
        rollout_buffer.compute_returns_and_advantage(last_values=values, dones=dones)
        callback.update_locals(locals())
        callback.on_rollout_end()
        return True

    def choose(
        self, observations: np.ndarray, deciding: np.ndarray
    ) -> tuple[np.ndarray, torch.Tensor, torch.Tensor]:
        """Actions (N,) or (N, K), values (N,) and log-probabilities (N,); 0 where a robot does not decide."""
        shape: Any = self.action_space.shape
        rows = [np.zeros((len(deciding), *shape), self.action_space.dtype)]
        rows += [np.zeros(len(deciding), np.float32) for _ in range(2)]
        if deciding.any():
            with torch.no_grad():
                chosen = self.policy(torch.as_tensor(observations[deciding]))
            for all_rows, part in zip(rows, chosen, strict=True):
                all_rows[deciding] = part.numpy().reshape(-1, *all_rows.shape[1:])
        actions, values, log_probs = rows
        return actions, torch.as_tensor(values), torch.as_tensor(log_probs)

    def _final_values(self, dones: np.ndarray, infos: list[dict[str, Any]]) -> np.ndarray:
        """(N,) values of the last observations of missions that were cut off, else 0."""
        values = np.zeros(len(dones))
        cut_off = [row for row in np.flatnonzero(dones) if infos[row]["TimeLimit.truncated"]]
        if cut_off:
            last = np.stack([infos[row]["terminal_observation"] for row in cut_off])
            with torch.no_grad():
                values[cut_off] = self.policy.predict_values(torch.as_tensor(last))[:, 0].numpy()
        return values

    def update(self) -> None:
        """Learn from the rollout, at the learning rate of this moment."""
        self._update_current_progress_remaining(self.num_timesteps, self._total_timesteps)
        self.train()

    def _excluded_save_params(self) -> list[str]:
        """What `save` leaves out: the missions, and the buffer that refers to them."""
        return [*super()._excluded_save_params(), "rollout_buffer_class", "rollout_buffer_kwargs"]


if __name__ == "__main__":
    raise SystemExit(run_command(main))
