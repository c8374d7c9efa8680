"""Train a policy with RLlib's PPO, for many cores or machines; one policy drives every robot.

    python -m training.rllib_ppo --scenario room --robots 3 --runners 2 --out runs/rllib-room

Runs on this machine, or with `--address HOST:PORT` on a Ray cluster (`ray start --head`). Only steps in which
a robot chose are learned from: `envs.rllib_env` says how. The folder gets `run.json` (the options),
`progress.csv` (a row for each iteration) and RLlib's checkpoints, of which `--resume FOLDER` takes the
latest, with the run's options. They are pickles: load only your own.
"""
# pyright: reportMissingImports=false

from __future__ import annotations

import contextlib
import csv
import math
import shutil
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any

from baselines.cli.arguments import INLINE, WholeNumber, make_folder, run_command
from baselines.cli.task_options import (
    TaskOptions,
    base_task,
    first_parsed,
    is_whole_scenario,
    parsed_for,
    settled,
    tasked,
)
from entropy_explore_env.command import INTERRUPTED
from entropy_explore_env.errors import SettingError
from entropy_explore_env.scenario import with_settings
from entropy_explore_env.validation import check_whole
from training.errors import NotFiniteError
from training.interruption import Interruption
from training.options import check_new, check_options, check_share
from training.ray_cluster import check_address, start_ray
from training.run_folder import FILE, resume_command, resumed_options, save_options

_MODULE = "training.rllib_ppo"
_CHANGEABLE = frozenset(("total_steps", "address", "runners", "checkpoint_every"))
"""Options that may differ where a run is continued."""
_STOPPED = "a checkpoint is written when this iteration is done"
POLICY = "shared"
LOSSES = ("total_loss", "policy_loss", "vf_loss", "entropy")
FIGURES = ("t_mission_s", "finished", "bits_gained_per_bit_sent")
"""Of each mission; the progress has their means."""


@dataclass
class Args:
    """Train a policy with RLlib's PPO."""

    scenario: str = "room"
    """Named scenario: room, room-furnished, office, … (the README lists them)."""
    robots: int = 3
    """Robots in a team."""
    total_steps: WholeNumber = 1_000_000
    """Robots' decisions to train for."""
    seed: int = 0
    """Seed of weights, missions and all other draws."""
    out: Path | None = None
    """Folder of a new run; default: runs/rllib-SCENARIO-ROBOTS."""
    resume: Path | None = None
    """Folder of a run to continue from its latest checkpoint, with the settings that it was started with."""
    address: str | None = None
    """HOST:PORT of a Ray cluster, or auto for that of this machine; by default this machine alone."""
    runners: int = 2
    """Processes that collect experience; 0: the trainer itself does."""
    missions: int = 8
    """Missions in each runner."""
    task: Annotated[TaskOptions, INLINE] = field(default_factory=TaskOptions)
    cost_per_s: float | None = None
    """Cost of a second, as a share of all bits that the mission has to gain; default: the scenario's."""
    hidden: list[int] = field(default_factory=lambda: [128, 128])
    """Units of the hidden layers of actor and critic."""
    learning_rate: float = 3e-4
    """Adam's learning rate at first; it falls linearly to 0."""
    discount: float = 0.99
    """Discount factor per decision."""
    gae_lambda: float = 0.95
    """λ of generalised advantage estimation, per decision."""
    clip: float = 0.2
    """Clipping range of PPO's probability ratio."""
    entropy_bonus: float = 0.01
    """Weight of the entropy bonus."""
    batch: int = 4096
    """Decisions in an iteration."""
    minibatch: int = 512
    """Decisions in a minibatch."""
    epochs: int = 6
    """Passes over an iteration's decisions."""
    checkpoint_every: int = 10
    """Iterations between two checkpoints; there is one after the first, and one at the end or at Ctrl-C."""


def main(words: Sequence[str]) -> int:
    """Run the command."""
    args = parsed(words)
    if (resume := args.resume) is not None:
        args, changed = resumed_options(Args, resume, words, _CHANGEABLE, __doc__, settled_arguments)
        said = "".join(f"; {name} was {value}" for name, value in changed.items())
        print(f"{resume}: {_where(resume)}{said}", file=sys.stderr)
    named = base_task(args.scenario, args.task.settings).scenario
    args.out = args.out or Path("runs") / f"rllib-{named.name}-{args.robots}"
    if args.cost_per_s is None:
        args.cost_per_s = named.reward.cost_per_s
    check(args)
    env_settings = environment_settings(args)
    if args.resume is None:
        check_new(args.out, (args.out / FILE).exists() or last_checkpoint(args.out) is not None)
        make_folder("out", args.out)
    ray = start_ray(args.address, args.runners)
    try:
        if args.resume is None:
            save_options(args.out, args, _MODULE, words)
        with Interruption(_STOPPED) as interruption:
            done = train(args, env_settings, interruption)
    finally:
        ray.shutdown()
    if not done:
        command = resume_command(_MODULE, args.out)
        print(f"stopped, with a checkpoint in {args.out}; go on with\n\n    {command}\n")
        return INTERRUPTED
    return 0


def _where(folder: Path) -> str:
    """From where a run goes on."""
    checkpoint = last_checkpoint(folder)
    if checkpoint is None:
        return "no checkpoint: from the beginning"
    return f"goes on after {iterations_of(checkpoint)} iterations"


def check(args: Args) -> None:
    """Raise a SettingError where an option is out of its range."""
    check_options(args)
    check_whole("runners", args.runners, 0)
    check_whole("minibatch", args.minibatch, 1)
    if args.minibatch > args.batch:
        raise SettingError("minibatch", args.minibatch, f"at most the batch, {args.batch}")
    check_share("discount", args.discount)
    if not 0.0 <= args.entropy_bonus < math.inf:
        raise SettingError("entropy_bonus", args.entropy_bonus, "a number ≥ 0")
    check_address(args.address)


def parsed(words: Sequence[str]) -> Args:
    """The arguments of a command line; what is not given is the scenario's own.

    Raises:
        UsageError: The words do not fit.
        SettingError: There is no such scenario.
    """
    first = first_parsed(Args, words, __doc__)
    task = base_task(first.scenario, first.task.settings)
    robots = {"robots": task.scenario.robots} if is_whole_scenario(first.task.settings) else {}
    return settled_arguments(parsed_for(task, first, words, __doc__, **robots))


def settled_arguments(args: Args) -> Args:
    """The same arguments wherever the run is continued.

    Raises:
        SettingError: A file of JSON does not hold what it should.
    """
    return replace(args, task=settled(args.task))


def environment_settings(args: Args) -> dict[str, Any]:
    """The settings of the environment to learn in, RLlib's `env_config`.

    Raises:
        SettingError: There is no such scenario, or it does not allow the settings.
        WorldError: A world file cannot be used.
    """
    named = base_task(args.scenario, args.task.settings).scenario
    scenario, surroundings = tasked(named, args.task, args.robots)
    settings: dict[str, Any] = {
        "action": {"kind": "discrete", "moves": "axes"},
        "observation": {"flat": True, "panorama_utility": "log2"},  # what a small network learns best from
        "reward": {} if args.cost_per_s is None else {"cost_per_s": args.cost_per_s},
    }
    return {"scenario": with_settings(scenario, settings), **surroundings.settings()}


def train(args: Args, env_settings: dict[str, Any], interruption: Interruption) -> bool:
    """Train, and write progress and checkpoints; False if Ctrl-C ended it early.

    Raises:
        NotFiniteError: A loss is not finite; the last checkpoint stays.
    """
    from entropy_explore_env.envs.rllib_env import EntropyExploreMultiAgentEnv

    assert args.out is not None
    checkpoint = last_checkpoint(args.out)
    iterations = 0 if checkpoint is None else iterations_of(checkpoint)
    warm_up = EntropyExploreMultiAgentEnv(env_settings)  # compiles the kernels, which every runner would
    observations, _ = warm_up.reset(seed=0)
    warm_up.step({agent: warm_up.action_spaces[agent].sample() for agent in observations})
    algorithm = configure(args, env_settings, iterations).build_algo()
    try:
        if checkpoint is not None:
            algorithm.restore_from_path(str(checkpoint.resolve()))
        return iterate(args, algorithm, iterations, interruption)
    finally:
        algorithm.stop()
        with contextlib.suppress(OSError):
            Path(algorithm.logdir).rmdir()  # RLlib makes a folder in the home folder and leaves it empty


def configure(args: Args, env_settings: dict[str, Any], iterations: int = 0) -> Any:  # noqa: ANN401 - PPOConfig
    """RLlib's settings.

    Args:
        args: The command's.
        env_settings: The environment's.
        iterations: Done before; so the runners of a resumed run do not begin with its first missions
            again.
    """
    from ray.rllib.algorithms.ppo import PPOConfig
    from ray.rllib.core.rl_module.default_model_config import DefaultModelConfig
    from ray.rllib.core.rl_module.rl_module import RLModuleSpec

    from entropy_explore_env.envs.rllib_env import EntropyExploreMultiAgentEnv, runner_seed

    network = DefaultModelConfig(
        fcnet_hiddens=args.hidden,
        fcnet_activation="tanh",
        fcnet_kernel_initializer="orthogonal_",
        vf_share_layers=False,
    )
    return (
        PPOConfig()
        .environment(
            EntropyExploreMultiAgentEnv,
            env_config={**env_settings, "seed": runner_seed(args.seed, 0, 0, iterations)},
        )
        .env_runners(num_env_runners=args.runners, num_envs_per_env_runner=args.missions)
        .fault_tolerance(restart_failed_env_runners=args.address is not None)
        .multi_agent(policies={POLICY}, policy_mapping_fn=_policy_of, count_steps_by="agent_steps")
        .rl_module(rl_module_spec=RLModuleSpec(model_config=network))
        .training(
            lr=[[0, args.learning_rate], [args.total_steps, 0.0]],
            gamma=args.discount,
            lambda_=args.gae_lambda,
            clip_param=args.clip,
            entropy_coeff=args.entropy_bonus,
            use_kl_loss=False,
            grad_clip=0.5,
            train_batch_size_per_learner=args.batch,
            minibatch_size=args.minibatch,
            num_epochs=args.epochs,
        )
        .callbacks(on_episode_end=_log_figures)
        .debugging(seed=args.seed, log_level="ERROR")
    )


def _policy_of(agent: Any, episode: Any, **others: Any) -> str:  # noqa: ANN401 - RLlib's signature
    """All robots share one policy."""
    del agent, episode, others
    return POLICY


def _log_figures(episode: Any, metrics_logger: Any, **others: Any) -> None:  # noqa: ANN401 - RLlib's signature
    """Log the figures of a mission."""
    del others
    figures = next(info["figures"] for info in episode.get_infos(-1).values() if "figures" in info)
    for name in FIGURES:
        if figures[name] is not None:
            metrics_logger.log_value(name, float(figures[name]), window=100)


def iterate(args: Args, algorithm: Any, iteration: int, interruption: Interruption) -> bool:  # noqa: ANN401
    """Repeat rollout and update until all steps are done, or until Ctrl-C, which returns False.

    Args:
        args: The command's.
        algorithm: RLlib's Algorithm.
        iteration: How many are done already.
        interruption: Says whether to stop.

    Raises:
        NotFiniteError: A loss is not finite.
    """
    assert args.out is not None
    begun, steps, started = iteration, 0, time.perf_counter()
    while steps < args.total_steps:
        iteration += 1
        row = progress_row(algorithm.train(), iteration, args.robots)
        steps = int(row["decisions"])
        row["seconds"] = round(time.perf_counter() - started, 1)
        append_row(args.out / "progress.csv", row)
        print(progress_line(row), file=sys.stderr, flush=True)
        for name in LOSSES:
            if not math.isfinite(row[name]):
                raise NotFiniteError(name, row[name], steps)
        due = iteration % args.checkpoint_every == 0 or iteration == begun + 1
        if due or steps >= args.total_steps or interruption.asked:
            save_checkpoint(algorithm, args.out, iteration)
        if interruption.asked and steps < args.total_steps:
            return False
    return True


def progress_row(result: dict[str, Any], iteration: int, robots: int) -> dict[str, float]:
    """A row of progress.csv from RLlib's result; figures of missions are NaN until one has ended."""
    runners, learner = result["env_runners"], result["learners"][POLICY]
    row: dict[str, float] = {
        "iteration": iteration,
        "decisions": sum(runners["num_agent_steps_sampled_lifetime"].values()),
    }
    row["return"] = float(runners.get("episode_return_mean", math.nan)) / robots
    row.update({name: float(runners.get(name, math.nan)) for name in FIGURES})
    row.update({name: float(learner[name]) for name in LOSSES})
    return row


def progress_line(row: dict[str, float]) -> str:
    """An iteration as the terminal shows it."""
    begin = f"{row['decisions']:>11,.0f} decisions"
    if math.isnan(row["t_mission_s"]):
        return f"{begin}  no mission has ended yet"
    ended = f"missions of {row['t_mission_s']:,.0f} s, {row['finished']:.0%} finished"
    return f"{begin}  return {row['return']:>7.3f}  {ended}"


def append_row(path: Path, row: dict[str, float]) -> None:
    """Add a row to a CSV file."""
    new = not path.exists()
    with path.open("a", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, row)
        if new:
            writer.writeheader()
        writer.writerow(row)


def last_checkpoint(folder: Path) -> Path | None:
    """The latest whole checkpoint; None where there is none."""
    return max(folder.glob("checkpoint-[0-9]*[0-9]"), default=None)


def iterations_of(checkpoint: Path) -> int:
    """After how many iterations a checkpoint was written."""
    return int(checkpoint.name.rpartition("-")[2])


def save_checkpoint(algorithm: Any, folder: Path, iteration: int) -> None:  # noqa: ANN401 - RLlib's Algorithm
    """Write a checkpoint, whole or not at all, and then remove the one before it."""
    before = last_checkpoint(folder)
    unfinished = folder / "unfinished-checkpoint"
    shutil.rmtree(unfinished, ignore_errors=True)
    algorithm.save_to_path(str(unfinished.resolve()))
    unfinished.replace(folder / f"checkpoint-{iteration:06}")
    if before is not None:
        shutil.rmtree(before)


if __name__ == "__main__":
    sys.exit(run_command(main))
