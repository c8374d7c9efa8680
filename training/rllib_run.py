"""A run with RLlib: its settings as RLlib takes them, its validations, and the start of Ray."""
# pyright: reportMissingImports=false

from __future__ import annotations

import csv
import dataclasses
import importlib.util
import logging
import math
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from baselines.cli.task_options import base_task, tasked
from baselines.experiments import ray_cluster
from baselines.experiments.tables import csv_table
from entropy_explore_env.errors import MissingExtraError
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.writing import write_atomically
from training.advantages import Discounting
from training.checkpoints import PolicySettings, checkpoint_name, forget_later, save_checkpoint
from training.policy import load_policy, panorama_form
from training.validation import OWN, Validation, Validator

if TYPE_CHECKING:
    from training.rllib_ppo import Args

POLICY = "shared"
FIGURES = ("t_mission_s", "finished", "bits_gained_per_bit_sent")
"""Of each mission; the progress has their means."""
SAMPLE_TIMEOUT_S = 300.0
"""On the clock: an iteration goes on without runners that have not reported by then."""
_VALUE_LOSS = 0.5
"""Weight of the critic's loss, as Stable-Baselines3 has it."""


def environment_settings(args: Args) -> dict[str, Any]:
    """Return the settings of the environment to learn in, RLlib's `env_config`.

    Raises:
        SettingError: There is no such scenario, or it does not allow the settings.
        WorldError: A world file cannot be used.
    """
    named = base_task(args.scenario, args.task.settings, OWN).scenario
    scenario, surroundings = tasked(named, args.task, args.robots)
    reward = {} if args.cost_per_s is None else {"cost_per_s": args.cost_per_s}
    form = panorama_form("discrete", args.yaws, args.pitches)
    return {"scenario": with_settings(scenario, {"reward": reward, **form}), **surroundings.settings()}


def policy_of(args: Args, env_settings: dict[str, Any]) -> PolicySettings:
    """Return the policy that learns, of which any trainer and strategy can be made."""
    return PolicySettings(env_settings["scenario"], args.features, tuple(args.hidden))


def configure(args: Args, env_settings: dict[str, Any], iterations: int = 0) -> Any:  # noqa: ANN401 - PPOConfig
    """Return RLlib's settings.

    Args:
        args: The command's.
        env_settings: The environment's.
        iterations: Done before; so the runners of a resumed run do not begin with its first missions
            again.
    """
    from ray.rllib.algorithms.ppo import PPOConfig
    from ray.rllib.core.rl_module.rl_module import RLModuleSpec

    from entropy_explore_env.envs.rllib_env import EntropyExploreMultiAgentEnv, runner_seed
    from training import rllib_model

    return (
        PPOConfig()
        .environment(
            EntropyExploreMultiAgentEnv,
            env_config={**env_settings, "seed": runner_seed(args.seed, 0, 0, iterations)},
        )
        .env_runners(
            num_env_runners=args.runners,
            num_envs_per_env_runner=args.missions,
            sample_timeout_s=SAMPLE_TIMEOUT_S,
        )
        .fault_tolerance(restart_failed_env_runners=True)
        .multi_agent(policies={POLICY}, policy_mapping_fn=_policy_of, count_steps_by="agent_steps")
        .rl_module(
            rl_module_spec=RLModuleSpec(
                module_class=rllib_model.SharedPolicyModule,
                model_config={rllib_model.SETTINGS: policy_of(args, env_settings)},
            )
        )
        .learners(learner_class=rllib_model.DecisionLearner)
        .training(
            lr=args.learning_rate,
            gamma=args.gamma,
            lambda_=args.gae_lambda,
            clip_param=args.clip,
            entropy_coeff=args.entropy,
            use_kl_loss=False,
            vf_loss_coeff=_VALUE_LOSS,
            vf_clip_param=math.inf,
            grad_clip=0.5,
            train_batch_size_per_learner=args.batch,
            minibatch_size=args.minibatch,
            num_epochs=args.epochs,
            learner_config_dict={
                rllib_model.DISCOUNTING: Discounting(args.gamma, args.gae_lambda, args.discount),
                rllib_model.LEARNING_RATE: args.learning_rate,
                rllib_model.TOTAL_DECISIONS: args.total_steps,
            },
        )
        .callbacks(on_episode_end=_log_figures)
        .debugging(seed=args.seed, log_level="ERROR")
    )


def _policy_of(agent: Any, episode: Any, **others: Any) -> str:  # noqa: ANN401 - RLlib's signature
    """Return the one policy that all robots share."""
    del agent, episode, others
    return POLICY


def _log_figures(episode: Any, metrics_logger: Any, **others: Any) -> None:  # noqa: ANN401 - RLlib's signature
    """Log the figures of a mission."""
    del others
    figures = next(info["figures"] for info in episode.get_infos(-1).values() if "figures" in info)
    for name in FIGURES:
        if figures[name] is not None:
            metrics_logger.log_value(name, float(figures[name]), window=100)


CURVE = "curve.csv"


class RunValidation:
    """The validations of one run, which is continued where its folder says.

    Attributes:
        curve: A row for each validation: decisions, robot_steps, seconds, and what it found.
        next_at: Decisions after which the next one is due.
    """

    def __init__(self, out: Path, settings: PolicySettings, validator: Validator, every: int) -> None:
        """Read what the folder says.

        Args:
            out: The run's folder.
            settings: Of the policy.
            validator: Runs the missions.
            every: Decisions between two validations.
        """
        self._out, self._settings, self._every = out, settings, every
        self._validator = validator
        self.curve, self.next_at = read_rows(out / CURVE), every

    def resume(self, decisions: int) -> None:
        """Forget what came after the checkpoint that the run goes on from."""
        self.curve = [row for row in self.curve if row["decisions"] <= decisions]
        self.next_at = (decisions // self._every + 1) * self._every
        forget_later(self._out, "best", decisions)

    def validate(self, reached: dict[str, float], weights: dict[str, np.ndarray]) -> Validation:
        """Run the missions, add a row to the curve, and keep the policy if it is the best so far.

        Args:
            reached: How far the run is: decisions, robot_steps, seconds.
            weights: State of the module that is learned.
        """
        from training.rllib_model import policy_in  # which needs Ray

        checkpoint = policy_in(weights, self._settings, {**reached, "steps": int(reached["decisions"])})
        found = self._validator.validate(load_policy(checkpoint))
        assert found is not None
        best = min((row["mean_s"] for row in self.curve), default=np.inf)
        self.curve.append({**reached, **_numbers(found)})
        self.next_at += self._every
        columns = {name: [row[name] for row in self.curve] for name in self.curve[0]}
        write_atomically(self._out / CURVE, csv_table(columns))
        if found.mean_s < best:
            checkpoint.progress["validation"] = self.curve[-1]
            save_checkpoint(self._out / checkpoint_name("best", int(reached["decisions"])), checkpoint)
        return found

    def close(self) -> None:
        """End the missions."""
        self._validator.close()


def _numbers(found: Validation) -> dict[str, Any]:
    return dataclasses.asdict(found)


def read_rows(path: Path) -> list[dict[str, Any]]:
    """Return the rows of a table of numbers, none where there is no file; empty cells are None."""
    if not path.exists():
        return []
    with path.open(encoding="utf-8", newline="") as file:
        return [
            {name: float(cell) if cell else None for name, cell in row.items()}
            for row in csv.DictReader(file)
        ]


def check_address(address: str | None) -> None:
    """Raise a SettingError unless it is HOST:PORT, `auto` or None."""
    ray_cluster.check_address("address", address, ray_cluster.AUTO)


def start_ray(address: str | None, runners: int) -> Any:  # noqa: ANN401 - a module that may not be there
    """Start Ray on this machine, or join it at an address; return the module.

    Args:
        address: HOST:PORT of a cluster, `auto` for the one that this machine belongs to, or None for this
            machine alone.
        runners: Processes that will collect experience.

    Raises:
        MissingExtraError: It is not installed.
        SettingError: No cluster answers at the address.
        EntropyExploreError: It does not start.
    """
    # Else Ray says of each runner that it could not be restarted without this process: ray-project/ray#53727
    os.environ.setdefault("RAY_BACKEND_LOG_LEVEL", "fatal")
    ray = ray_cluster.ray_of("rllib")
    if importlib.util.find_spec("tree") is None:
        raise MissingExtraError("ray[rllib]", "rllib")  # Ray is there, RLlib is not
    logging.getLogger("ray.rllib").setLevel(logging.ERROR)
    if address is None:  # with fewer cores than this the runners would wait for ever
        ray_cluster.start_here(ray, max(runners + 1, os.cpu_count() or 1))
    else:
        ray_cluster.join(ray, "address", address)
    return ray
