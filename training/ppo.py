"""Train a policy with PPO (Stable-Baselines3); one network drives every robot.

    python -m training.ppo --scenario room --robots 3 --total-steps 2_500_000 --out runs/room-3
    python -m training.ppo --scenario office --world train/*.png --validation-world val/*.png --out runs/mine
    python -m training.evaluate --strategy runs/mine --world test/*.png

The folder gets `curve.csv` (a row for each validation), TensorBoard's files (`tensorboard --logdir runs`),
the checkpoints `step-N` (the latest, for `--resume`) and `best-N` (the best in validation), and a mission of
the best policy as a picture and an animation. Steps are counted per robot: a step of all missions is
missions × robots of them. `training/advantages.py` says what is learned while a robot drives.
"""

from __future__ import annotations

from training import extra  # noqa: F401 - before what is not there without it

# isort: split

import dataclasses
import shlex
import sys
import warnings
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Literal

import numpy as np
import torch
from gymnasium import spaces
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import Logger, TensorBoardOutputFormat

from baselines.cli.arguments import make_folder, parse, print_json, run_command
from baselines.cli.interruption import Interruption
from baselines.cli.task_options import (
    absolute_files,
    base_task,
    is_whole_scenario,
    parsed_for,
    settled,
    tasked,
)
from entropy_explore_env.command import INTERRUPTED, home_path
from entropy_explore_env.envs.privileged_vec_env import PrivilegedVecEnv
from entropy_explore_env.envs.rewards import StepFigures
from entropy_explore_env.envs.robot_vec_env import RobotVecEnv
from entropy_explore_env.errors import SettingError
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.validation import check_whole
from entropy_explore_env.writing import write_atomically
from training.advantages import DecisionBuffer, Normaliser
from training.candidate_network import (
    ATTENTION_LAYERS,
    WIDTH,
    actor_frozen,
    check_attention_layers,
    check_width,
)
from training.checkpoints import NotFiniteError, checkpoint_name, forget_later, save_checkpoint
from training.networks import policy_class
from training.policy import (
    candidate_form,
    keywords_of,
    normalise_observations,
    panorama_form,
    settings_of_policy,
)
from training.progress import MissionFigures, Progress, TrainingBar
from training.runs import (
    LearningOptions,
    TrainingState,
    check_finite,
    check_options,
    check_unused,
    checkpoint_to_resume,
    options_json,
    restore_state,
    resume_command,
    resumed_options,
    save_options,
    save_policy,
    save_state,
    start_from,
    told,
)
from training.validation import (
    OWN,
    TrainingTask,
    Validator,
    draw_best_mission,
    learning_seeds,
    validation_task,
)

_MODULE = "training.ppo"
_CHANGEABLE = frozenset(
    ("video", "threads", "json", "total_steps", "validate_every", "checkpoint_every", "start")
)
"""Options that may differ where a run is continued; where it began does not matter any more."""
_STOPPED = "a checkpoint is written when this rollout and its update, or this validation, are done"
_RETURNS_MEMORY = 2e5
"""Decisions, about, whose returns normalise: the latest ones, since returns grow as the policy learns."""
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
    """Return a rollout's default missions and steps: in a short run an eighth of it at most, if it can be.

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


def set_up(args: Args, task: TrainingTask) -> TrainingState:
    """Set up missions to learn from, and PPO with fresh weights."""
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
            policy_kwargs=keywords_of(settings),
            seed=args.seed,
            device="cpu",
        )
    return TrainingState(settings, model, envs, Normaliser(size), Progress(args.validate_every))


def less_the_seconds(figures: StepFigures) -> np.ndarray:
    """Return the reward of a step: less the seconds that it took, (E, A)."""
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
                if validate(args, state, validator, bar, interruption):
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


class DecisionPPO(PPO):
    """Stable-Baselines3's PPO over a RobotVecEnv, whose policy is asked only where robots decide.

    What a busy robot would choose is ignored and its value is never used: neither is computed, and no random
    number is drawn for it. The rollout holds action 0, value 0 and log-probability 0 in its place.
    """

    def start(self, total_steps: int, callback: BaseCallback) -> BaseCallback:
        """Prepare a loop of rollouts and updates up to this many steps, as `learn` does."""
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
        torch.set_num_threads(1)  # of a few robots at a time: more would only take time from the missions
        try:
            return self._collect(env, callback, rollout_buffer, n_rollout_steps)
        finally:
            torch.set_num_threads(threads)

    def _collect(
        self, env: RobotVecEnv, callback: BaseCallback, rollout_buffer: DecisionBuffer, steps: int
    ) -> bool:
        """Fill the buffer as `collect_rollouts` does."""
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
        """Return actions (N,) or (N, K), values and log-probabilities (N,); 0 where robots do not decide."""
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
        """Return (N,) values of the last observations of missions that were cut off, else 0."""
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
        """Return what `save` leaves out: the missions, and the buffer that refers to them."""
        return [*super()._excluded_save_params(), "rollout_buffer_class", "rollout_buffer_kwargs"]


def validate(
    args: Args, state: TrainingState, validator: Validator, bar: TrainingBar, interruption: Interruption
) -> bool:
    """Add a row to the curve, and keep the policy if it is the best so far; False if Ctrl-C cut it short."""
    model, progress, steps, out = state.model, state.progress, state.model.num_timesteps, args.out
    assert out is not None
    bar.say_validating(steps, args.validation_missions)
    with progress.timed("validating_s"):
        model.policy.set_training_mode(False)
        validation = validator.validate(model.policy, lambda: interruption.asked)
    if validation is None:
        return False
    is_best = progress.add_validation(steps, validation)
    write_atomically(out / "curve.csv", progress.curve_csv())
    for name, value in dataclasses.asdict(validation).items():
        if value is not None:
            model.logger.record(f"validation/{name}", value)
    bar.show_validation(steps, validation)
    if is_best:
        save_checkpoint(out / checkpoint_name("best", steps), save_policy(state))
    return True


def finished(args: Args, state: TrainingState) -> bool:
    """Return whether all steps are done, and the last validation, too."""
    steps = state.model.num_timesteps
    return steps >= args.total_steps and state.progress.validated(steps)


def say_stopped(out: Path, steps: int, as_json: bool) -> int:
    """Say where a run that was interrupted stands, and how to go on; its exit code."""
    command = resume_command(_MODULE, out)
    if as_json:
        print_json({"interrupted": True, "steps": steps, "resume": command})
    else:
        print(f"stopped after {steps:,} steps, with a checkpoint in {out}; go on with\n\n    {command}\n")
    return INTERRUPTED


if __name__ == "__main__":
    raise SystemExit(run_command(main))
