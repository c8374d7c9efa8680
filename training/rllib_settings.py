"""A run with RLlib as RLlib's own settings: environment, module, learner, runners."""
# pyright: reportMissingImports=false

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from baselines.cli.task_options import base_task, tasked
from entropy_explore_env.scenario import with_settings
from training.advantages import Discounting
from training.checkpoints import PolicySettings
from training.ppo_options import OWN, panorama_form

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
    """The settings of the environment to learn in, RLlib's `env_config`.

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
    """The policy that learns, of which any trainer and strategy can be made."""
    return PolicySettings(env_settings["scenario"], args.features, tuple(args.hidden))


def configure(args: Args, env_settings: dict[str, Any], iterations: int = 0) -> Any:  # noqa: ANN401 - PPOConfig
    """RLlib's settings.

    Args:
        args: The command's.
        env_settings: The environment's.
        iterations: Done before; so the runners of a resumed run do not begin with its first missions
            again.
    """
    from ray.rllib.algorithms.ppo import PPOConfig
    from ray.rllib.core.rl_module.rl_module import RLModuleSpec

    from entropy_explore_env.envs.rllib_env import EntropyExploreMultiAgentEnv, runner_seed
    from training import rllib_learner, rllib_module

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
                module_class=rllib_module.SharedPolicyModule,
                model_config={rllib_module.SETTINGS: policy_of(args, env_settings)},
            )
        )
        .learners(learner_class=rllib_learner.DecisionLearner)
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
                rllib_learner.DISCOUNTING: Discounting(args.gamma, args.gae_lambda, args.discount),
                rllib_learner.LEARNING_RATE: args.learning_rate,
                rllib_learner.TOTAL_DECISIONS: args.total_steps,
            },
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
