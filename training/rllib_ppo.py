"""PPO with RLlib, for teams on many cores or machines: one policy, shared by all robots.

    python -m training.rllib_ppo --scenario room --robots 3 --runners 2 --out runs/rllib-room

Runs on this machine, or with `--address HOST:PORT` on a Ray cluster (`ray start --head`). Only what a robot
chose is learned from: `envs.rllib_env` says how. In `--out`: `settings.json`, `progress.csv` (a row an
iteration) and RLlib's own checkpoints, of which `--resume` takes the last. They are pickles: load only yours.
"""
# pyright: reportMissingImports=false

from __future__ import annotations

import contextlib
import csv
import json
import logging
import math
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from baselines.cli.arguments import make_folder, parse, run_command
from entropy_explore_env.errors import EntropyExploreError, MissingExtraError, SettingError
from entropy_explore_env.scenario import with_settings
from entropy_explore_env.scenarios import find_scenario
from entropy_explore_env.settings_json import settings_of
from entropy_explore_env.validation import check_whole
from entropy_explore_env.writing import write_atomically
from training.errors import NotFiniteError

POLICY = "shared"
LOSSES = ("total_loss", "policy_loss", "vf_loss", "entropy")
FIGURES = ("t_mission_s", "finished", "bits_gained_per_bit_sent")
"""Of each mission, averaged in the progress."""
REACHED_WITHIN_S = 20.0
"""A cluster that does not answer within this time is not there."""
STARTS = 3
"""Ray gives up a start when a part of it needs more than 15 s (ray-project/ray#65983): machines are busy."""


@dataclass
class Args:
    """Train a policy with RLlib's PPO."""

    scenario: str = "room"
    """A named scenario: room, office, cave, … (the README lists them)."""
    robots: int = 3
    """Team size."""
    total_steps: int = 1_000_000
    """Decisions of robots to train on."""
    seed: int = 0
    """Of the worlds, the starts, the network and every other draw."""
    out: Path = Path("runs/rllib")
    """Folder for settings, progress and checkpoints."""
    resume: bool = False
    """Go on from the last checkpoint in the folder."""
    address: str | None = None
    """HOST:PORT of a Ray cluster, or auto for the one that this machine belongs to; default: none, this
    machine alone."""
    runners: int = 2
    """Processes that explore; 0: the trainer itself."""
    missions: int = 8
    """Missions that a runner explores by turns."""
    cost_per_s: float = 0.01
    """Reward that a second costs; all the bits of the map are worth 1."""
    hidden: list[int] = field(default_factory=lambda: [128, 128])
    """Units of the hidden layers, of policy and value each."""
    learning_rate: float = 3e-4
    """Of Adam, falling to 0 at the last step."""
    discount: float = 0.99
    """Of what the next decision brings."""
    gae_lambda: float = 0.95
    """Of generalised advantage estimation."""
    clip: float = 0.2
    """How far a probability may move in an iteration, as a ratio."""
    entropy_bonus: float = 0.01
    """What a nat of the policy's entropy is worth."""
    batch: int = 4096
    """Decisions of an iteration."""
    minibatch: int = 512
    """Decisions of a gradient step."""
    epochs: int = 6
    """How often an iteration's decisions are learned from."""
    checkpoint_every: int = 10
    """Iterations between checkpoints; there is one at the end."""


def main(words: Sequence[str]) -> int:
    """Run the command."""
    args = parse(Args, words, description=__doc__)
    env_settings = check(args)
    ray = start_ray(args)
    try:
        train(args, env_settings)
    finally:
        ray.shutdown()
    return 0


def check(args: Args) -> dict[str, Any]:
    """The environment's settings, once everything that can be wrong in the arguments was looked at.

    Raises:
        SettingError: What is asked for is not there or out of its range.
    """
    for name in ("total_steps", "missions", "batch", "minibatch", "epochs", "checkpoint_every"):
        check_whole(name, getattr(args, name), 1)
    for name in ("seed", "runners"):
        check_whole(name, getattr(args, name), 0)
    if args.minibatch > args.batch:
        raise SettingError("minibatch", args.minibatch, f"at most the batch, {args.batch}")
    if not args.learning_rate > 0.0:
        raise SettingError("learning_rate", args.learning_rate, "a number > 0")
    if args.address is not None and args.address != "auto" and not args.address.rpartition(":")[2].isdigit():
        raise SettingError("address", args.address, "HOST:PORT of a Ray cluster, or auto")
    settings: dict[str, Any] = {
        "robots": args.robots,
        "split": "train",
        "decision_period_s": None,
        "action": {"kind": "discrete", "moves": "axes"},
        "observation": {"flat": True, "panorama_utility": "log2"},  # what a small network takes best
        "reward": {"cost_per_s": args.cost_per_s},
    }
    scenario = with_settings(find_scenario(args.scenario), settings)
    found = last_checkpoint(args.out)
    if args.resume and found is None:
        raise SettingError("resume", str(args.out), "a folder with a checkpoint")
    if found is not None and not args.resume:
        raise SettingError("out", str(args.out), "a new folder, or --resume to go on with the run in it")
    make_folder("out", args.out)
    shown = {name: str(value) if isinstance(value, Path) else value for name, value in vars(args).items()}
    described = settings_of(scenario)
    if found is not None and _scenario_in(args.out / "settings.json") != described:
        raise SettingError(
            "scenario", args.scenario, "the settings that the run in the folder was begun with"
        )
    text = json.dumps({"args": shown, "scenario": described}, indent=2) + "\n"
    try:
        write_atomically(args.out / "settings.json", text)
    except OSError as error:
        raise SettingError("out", str(args.out), f"a folder that can be written ({error.strerror})") from None
    return {"scenario": args.scenario, **settings}


def _scenario_in(file: Path) -> Any:  # noqa: ANN401 - JSON
    """The scenario that a settings.json tells; None where there is none."""
    try:
        return json.loads(file.read_text("utf-8"))["scenario"]
    except (OSError, ValueError, LookupError, TypeError):
        return None


def start_ray(args: Args) -> Any:  # noqa: ANN401 - a module that may not be there
    """Ray, started on this machine or joined at an address.

    Raises:
        MissingExtraError: It is not installed.
        SettingError: Nothing answers at the address.
        EntropyExploreError: It does not start.
    """
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")  # it would report to its makers
    os.environ.setdefault("PYTHONWARNINGS", "ignore::DeprecationWarning")  # RLlib's, in every process
    try:
        import ray
        import torch  # noqa: F401 - RLlib would fail late, and at length
    except ImportError as error:
        raise MissingExtraError("torch" if error.name == "torch" else "ray[rllib]", "rllib") from None
    for name in ("ray", "ray.rllib"):
        logging.getLogger(name).setLevel(logging.ERROR)
    quiet = {"logging_level": "ERROR", "log_to_driver": False}
    if args.address is None:
        cores = max(args.runners + 1, os.cpu_count() or 1)  # fewer would let the runners wait for ever
        for _ in range(STARTS):
            with contextlib.suppress(Exception):  # it raises no other when its daemon is late
                ray.init(address="local", num_cpus=cores, include_dashboard=False, **quiet)
                return ray
            ray.shutdown()
        raise EntropyExploreError(f"Ray did not start in {STARTS} attempts: is this machine overloaded?")
    nobody = SettingError("address", args.address, "that of a Ray cluster that answers")
    if args.address != "auto":  # `ray.init` would try for many minutes
        ask = [sys.executable, "-m", "ray.scripts.scripts", "health-check", "--address", args.address]
        try:
            subprocess.run(ask, capture_output=True, timeout=REACHED_WITHIN_S, check=True)
        except subprocess.SubprocessError:
            raise nobody from None
    try:
        ray.init(address=args.address, **quiet)
    except (ConnectionError, RuntimeError, ValueError):
        raise nobody from None
    return ray


def train(args: Args, env_settings: dict[str, Any]) -> None:
    """Train, and keep the progress and checkpoints.

    Raises:
        NotFiniteError: A loss is not finite; the last checkpoint stays.
    """
    from entropy_explore_env.envs.rllib_env import EntropyExploreMultiAgentEnv

    checkpoint = last_checkpoint(args.out) if args.resume else None
    begun = 0 if checkpoint is None else int(checkpoint.name.rpartition("-")[2])
    warm_up = EntropyExploreMultiAgentEnv(env_settings)  # else every runner would compile the kernels
    observations, _ = warm_up.reset(seed=0)
    warm_up.step({agent: warm_up.action_spaces[agent].sample() for agent in observations})
    algorithm = configure(args, env_settings, begun).build_algo()
    try:
        if checkpoint is not None:
            algorithm.restore_from_path(str(checkpoint.resolve()))
        loop(args, algorithm, begun)
    finally:
        algorithm.stop()
        with contextlib.suppress(OSError):
            Path(algorithm.logdir).rmdir()  # RLlib makes one in the home folder and leaves it empty


def configure(args: Args, env_settings: dict[str, Any], begun: int = 0) -> Any:  # noqa: ANN401 - PPOConfig
    """RLlib's settings.

    Args:
        args: The command's.
        env_settings: The environment's.
        begun: Iterations done before; runners of a training that goes on do not begin with its first
            missions again.
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
            env_config={**env_settings, "seed": runner_seed(args.seed, 0, 0, begun)},
        )
        .env_runners(num_env_runners=args.runners, num_envs_per_env_runner=args.missions)
        .fault_tolerance(restart_failed_env_runners=args.address is not None)
        .multi_agent(policies={POLICY}, policy_mapping_fn=_shared, count_steps_by="agent_steps")
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
        .callbacks(on_episode_end=_note_figures)
        .debugging(seed=args.seed, log_level="ERROR")
    )


def _shared(agent: str, episode: Any, **others: Any) -> str:  # noqa: ANN401 - RLlib's signature
    """Every robot's policy is the same."""
    del agent, episode, others
    return POLICY


def _note_figures(episode: Any, metrics_logger: Any, **others: Any) -> None:  # noqa: ANN401 - RLlib's signature
    """Keep what a mission came to."""
    del others
    figures = next(info["figures"] for info in episode.get_infos(-1).values() if "figures" in info)
    for name in FIGURES:
        if figures[name] is not None:
            metrics_logger.log_value(name, float(figures[name]), window=100)


def loop(args: Args, algorithm: Any, begun: int) -> None:  # noqa: ANN401 - RLlib's Algorithm
    """Iterate until the steps are done.

    Raises:
        NotFiniteError: A loss is not finite.
    """
    iteration, steps, started = begun, 0, time.perf_counter()
    while steps < args.total_steps:
        row = progress_of(algorithm.train(), iteration := iteration + 1, args.robots)
        steps = int(row["decisions"])
        row["seconds"] = round(time.perf_counter() - started, 1)
        note_progress(args.out / "progress.csv", row)
        print(line_of(row), file=sys.stderr)
        for name in LOSSES:
            if not math.isfinite(row[name]):
                raise NotFiniteError(name, row[name], steps)
        if iteration % args.checkpoint_every == 0 or steps >= args.total_steps:
            save(algorithm, args.out, iteration)


def progress_of(result: dict[str, Any], iteration: int, robots: int) -> dict[str, float]:
    """A row of the progress from RLlib's result; NaN before the first mission ended."""
    runners, learner = result["env_runners"], result["learners"][POLICY]
    row: dict[str, float] = {
        "iteration": iteration,
        "decisions": sum(runners["num_agent_steps_sampled_lifetime"].values()),
    }
    row["return"] = float(runners.get("episode_return_mean", math.nan)) / robots
    row.update({name: float(runners.get(name, math.nan)) for name in FIGURES})
    row.update({name: float(learner[name]) for name in LOSSES})
    return row


def line_of(row: dict[str, float]) -> str:
    """What a person sees of an iteration."""
    begin = f"{row['decisions']:>11,.0f} decisions"
    if math.isnan(row["t_mission_s"]):
        return f"{begin}  no mission has ended yet"
    ended = f"missions of {row['t_mission_s']:,.0f} s, {row['finished']:.0%} finished"
    return f"{begin}  return {row['return']:>7.3f}  {ended}"


def note_progress(path: Path, row: dict[str, float]) -> None:
    """Add a row to a CSV file."""
    new = not path.exists()
    with path.open("a", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, row)
        if new:
            writer.writeheader()
        writer.writerow(row)


def last_checkpoint(folder: Path) -> Path | None:
    """The latest checkpoint that is there whole."""
    return max(folder.glob("checkpoint-[0-9]*[0-9]"), default=None)


def save(algorithm: Any, folder: Path, iteration: int) -> None:  # noqa: ANN401 - RLlib's Algorithm
    """Keep a checkpoint: there under its name whole or not at all; the one before goes then."""
    before = last_checkpoint(folder)
    unfinished = folder / "unfinished-checkpoint"
    shutil.rmtree(unfinished, ignore_errors=True)
    algorithm.save_to_path(str(unfinished.resolve()))
    unfinished.replace(folder / f"checkpoint-{iteration:06}")
    if before is not None:
        shutil.rmtree(before)


if __name__ == "__main__":
    sys.exit(run_command(main))
