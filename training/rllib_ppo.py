"""Train a policy with RLlib's PPO, for many cores or machines; one policy drives every robot.

    python -m training.rllib_ppo --scenario room --robots 3 --runners 2 --out runs/rllib-room

Runs on this machine, or with `--address HOST:PORT` on a Ray cluster (`ray start --head`). Only steps in which
a robot chose are learned from: `envs.rllib_env` says how. The folder gets `settings.json`, `progress.csv` (a
row for each iteration) and RLlib's checkpoints, of which `--resume` takes the latest. They are pickles: load
only your own.
"""
# pyright: reportMissingImports=false

from __future__ import annotations

import contextlib
import csv
import json
import math
import shutil
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from baselines.cli.arguments import make_folder, parse, run_command
from entropy_explore_env.errors import SettingError
from entropy_explore_env.scenario import with_settings
from entropy_explore_env.scenarios import find_scenario
from entropy_explore_env.settings_json import settings_of
from entropy_explore_env.validation import check_whole
from entropy_explore_env.writing import write_atomically
from training.errors import NotFiniteError
from training.options import check_new_or_resumed, check_options, check_share
from training.ray_cluster import check_address, start_ray

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
    total_steps: int = 1_000_000
    """Robots' decisions to train for."""
    seed: int = 0
    """Seed of weights, missions and all other draws."""
    out: Path = Path("runs/rllib")
    """Folder of the run."""
    resume: bool = False
    """Continue from the latest checkpoint in the folder."""
    address: str | None = None
    """HOST:PORT of a Ray cluster, or auto for that of this machine; by default this machine alone."""
    runners: int = 2
    """Processes that collect experience; 0: the trainer itself does."""
    missions: int = 8
    """Missions in each runner."""
    cost_per_s: float = 0.01
    """Cost of a second, as a share of all bits that the mission has to gain."""
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
    """Iterations between two checkpoints; there is one at the end, too."""


def main(words: Sequence[str]) -> int:
    """Run the command."""
    args = parse(Args, words, description=__doc__)
    check(args)
    env_settings = prepare_folder(args)
    ray = start_ray(args.address, args.runners)
    try:
        train(args, env_settings)
    finally:
        ray.shutdown()
    return 0


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


def prepare_folder(args: Args) -> dict[str, Any]:
    """Make the run's folder with its settings.json, or check that it is that of the run to resume.

    Returns:
        The settings of the environment to learn in, RLlib's `env_config`.

    Raises:
        SettingError: There is no such scenario; the folder cannot be used; or the run in it was started in
            another scenario.
    """
    settings: dict[str, Any] = {
        "robots": args.robots,
        "split": "train",
        "decision_period_s": None,
        "action": {"kind": "discrete", "moves": "axes"},
        "observation": {"flat": True, "panorama_utility": "log2"},  # what a small network learns best from
        "reward": {"cost_per_s": args.cost_per_s},
    }
    scenario = settings_of(with_settings(find_scenario(args.scenario), settings))
    checkpoint = last_checkpoint(args.out)
    if args.resume and checkpoint is None:
        raise SettingError("resume", str(args.out), "a folder with a checkpoint")
    check_new_or_resumed(args.out, checkpoint is not None, args.resume)
    make_folder("out", args.out)
    if checkpoint is not None and _scenario_in(args.out / "settings.json") != scenario:
        raise SettingError(
            "scenario", args.scenario, "the settings that the run in the folder was started with"
        )
    options = {name: str(value) if isinstance(value, Path) else value for name, value in vars(args).items()}
    text = json.dumps({"args": options, "scenario": scenario}, indent=2) + "\n"
    try:
        write_atomically(args.out / "settings.json", text)
    except OSError as error:
        raise SettingError("out", str(args.out), f"a folder that can be written ({error.strerror})") from None
    return {"scenario": args.scenario, **settings}


def _scenario_in(file: Path) -> Any:  # noqa: ANN401 - JSON
    """The scenario in a settings.json; None where there is none."""
    try:
        return json.loads(file.read_text("utf-8"))["scenario"]
    except (OSError, ValueError, LookupError, TypeError):
        return None


def train(args: Args, env_settings: dict[str, Any]) -> None:
    """Train, and write progress and checkpoints.

    Raises:
        NotFiniteError: A loss is not finite; the last checkpoint stays.
    """
    from entropy_explore_env.envs.rllib_env import EntropyExploreMultiAgentEnv

    checkpoint = last_checkpoint(args.out) if args.resume else None
    iterations = 0 if checkpoint is None else int(checkpoint.name.rpartition("-")[2])
    warm_up = EntropyExploreMultiAgentEnv(env_settings)  # compiles the kernels, which every runner would
    observations, _ = warm_up.reset(seed=0)
    warm_up.step({agent: warm_up.action_spaces[agent].sample() for agent in observations})
    algorithm = configure(args, env_settings, iterations).build_algo()
    try:
        if checkpoint is not None:
            algorithm.restore_from_path(str(checkpoint.resolve()))
        iterate(args, algorithm, iterations)
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


def _policy_of(agent: str, episode: Any, **others: Any) -> str:  # noqa: ANN401 - RLlib's signature
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


def iterate(args: Args, algorithm: Any, iteration: int) -> None:  # noqa: ANN401 - RLlib's Algorithm
    """Repeat rollout and update until all steps are done; `iteration` is how many are done already.

    Raises:
        NotFiniteError: A loss is not finite.
    """
    steps, started = 0, time.perf_counter()
    while steps < args.total_steps:
        iteration += 1
        row = progress_row(algorithm.train(), iteration, args.robots)
        steps = int(row["decisions"])
        row["seconds"] = round(time.perf_counter() - started, 1)
        append_row(args.out / "progress.csv", row)
        print(progress_line(row), file=sys.stderr)
        for name in LOSSES:
            if not math.isfinite(row[name]):
                raise NotFiniteError(name, row[name], steps)
        if iteration % args.checkpoint_every == 0 or steps >= args.total_steps:
            save_checkpoint(algorithm, args.out, iteration)


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
