"""RLlib's PPO learner for robots that decide at times of their own: what `training.ppo` learns by.

Advantages are those of decisions (training/advantages.py), discounted by seconds or by decisions; values are
normalised returns; observations are normalised by what was learned from; the learning rate falls linearly to
a twentieth, by decisions.
"""
# pyright: reportMissingImports=false

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
import torch
from ray.rllib.algorithms.ppo.torch.ppo_torch_learner import PPOTorchLearner
from ray.rllib.connectors.connector_v2 import ConnectorV2
from ray.rllib.connectors.learner import GeneralAdvantageEstimation
from ray.rllib.core.columns import Columns
from ray.rllib.evaluation.postprocessing import Postprocessing

from training.advantages import Discounting, Steps, decision_advantages
from training.rllib_module import RETURNS_MEMORY, SharedPolicyModule

DISCOUNTING = "discounting"
"""Keys of the learner's settings in `learner_config_dict`: a Discounting, …"""
LEARNING_RATE = "learning_rate"
"""… Adam's learning rate at first …"""
TOTAL_DECISIONS = "total_decisions"
"""… and after how many decisions it is at its lowest."""
LOWEST_SHARE = 0.05
"""Of the learning rate at first."""
_ADAM_EPS = 1e-5
_MIN_SPREAD = 1e-4
"""Advantages that differ less are not stretched."""


class Chunks(NamedTuple):
    """What runners collected, chunk after chunk; every array is (N,).

    A chunk is a robot's decisions in one mission. After the last one there is a row for the value of what it
    observed then.

    Attributes:
        values: V of each row's observation.
        rewards: What each decision earned until the robot decided again.
        terminated: Whether the mission was mapped after it, so that there was nothing more to earn.
        decided: False in the additional rows.
    """

    values: np.ndarray
    rewards: np.ndarray
    terminated: np.ndarray
    decided: np.ndarray

    def advantages(self, elapsed_s: np.ndarray, discounting: Discounting) -> np.ndarray:
        """(K,) advantages of the decisions, whose rewards count at their ends.

        Args:
            elapsed_s: (K,) seconds until the robot decided again.
            discounting: γ, λ and what γ discounts.
        """
        rows = np.flatnonzero(self.decided)
        last = ~np.append(self.decided, False)[rows + 1]  # of its chunk
        after = np.append(self.values, 0.0)[rows + 1]
        bootstrapped = np.where(last & ~self.terminated[rows], after, 0.0)
        columns = (np.ones(len(rows), bool), last, elapsed_s, self.rewards[rows], bootstrapped)
        steps = Steps(*(column[:, None] for column in columns))
        values, none = self.values[rows][:, None], np.zeros(1)
        return decision_advantages(steps, values, none, np.zeros(1, bool), discounting)[0][:, 0]


class DecisionAdvantages(ConnectorV2):
    """Puts advantages and normalised returns into the batch, in place of RLlib's piece, which counts steps.

    Attributes:
        learned: (K, F) the latest observations that are learned from.
    """

    def __init__(self, discounting: Discounting) -> None:
        """Take γ, λ and what γ discounts."""
        super().__init__(None, None)
        self._discounting = discounting
        self.learned = np.zeros((0, 0), np.float32)

    def __call__(
        self,
        *,
        rl_module: Any,  # noqa: ANN401 - RLlib's MultiRLModule
        episodes: list[Any],
        batch: dict[str, Any],
        **kwargs: Any,  # noqa: ANN401 - RLlib's
    ) -> dict[str, Any]:
        """The decisions in an order of chance, with standardised advantages and normalised returns.

        RLlib's minibatches of a first epoch would be decisions of the same few missions.
        """
        del kwargs
        (name,) = batch
        module, rows = rl_module[name].unwrapped(), batch[name]
        assert isinstance(module, SharedPolicyModule)
        stats = module.return_stats.normaliser(RETURNS_MEMORY)
        with torch.no_grad():
            values = stats.denormalise(module.compute_values(rows).numpy().astype(np.float64))
        decided = rows[Columns.LOSS_MASK].numpy().astype(bool)
        rewards = rows[Columns.REWARDS].numpy().astype(np.float64)
        chunks = Chunks(values, rewards, rows[Columns.TERMINATEDS].numpy().astype(bool), decided)
        single = self.single_agent_episode_iterator(episodes, agents_that_stepped_only=False)
        elapsed_s = np.concatenate([seconds_between(each) for each in single])
        advantages = np.zeros(len(values))
        advantages[decided] = chunks.advantages(elapsed_s, self._discounting)
        returns = advantages + values
        stats.update(returns[decided])
        module.return_stats.take(stats)
        spread = max(_MIN_SPREAD, float(advantages[decided].std()))
        standard = (advantages - advantages[decided].mean()) / spread
        rows[Postprocessing.ADVANTAGES] = torch.as_tensor(standard.astype(np.float32))
        rows[Postprocessing.VALUE_TARGETS] = torch.as_tensor(stats.normalise(returns).astype(np.float32))
        self.learned = rows[Columns.OBS].numpy()[decided]
        shuffled = torch.as_tensor(np.flatnonzero(decided))[torch.randperm(int(decided.sum()))]
        return {name: {column: cells[shuffled] for column, cells in rows.items()}}


def seconds_between(chunk: Any) -> np.ndarray:  # noqa: ANN401 - RLlib's SingleAgentEpisode
    """(L,) simulated seconds from each of a chunk's decisions to the next one; without the additional row."""
    times_s = [info["time_s"] for info in chunk.get_infos(slice(0, len(chunk)))]
    return np.diff(np.array(times_s, np.float64))


class DecisionLearner(PPOTorchLearner):
    """PPO's loss is RLlib's."""

    def configure_optimizers_for_module(self, module_id: str, config: Any = None) -> None:  # noqa: ANN401
        """Adam as Stable-Baselines3 has it."""
        module = self.module[module_id]
        parameters: Any = self.get_parameters(module)
        self.register_optimizer(
            module_id=module_id,
            optimizer=torch.optim.Adam(parameters, eps=_ADAM_EPS),
            params=parameters,
            lr_or_lr_schedule=config.lr,
        )

    def build(self) -> None:
        """Put the advantages of decisions in the place of RLlib's."""
        super().build()
        pipeline, settings = self._learner_connector, self.config.learner_config_dict
        assert pipeline is not None
        pipeline.remove(GeneralAdvantageEstimation)
        self._advantages = DecisionAdvantages(settings[DISCOUNTING])
        pipeline.append(self._advantages)

    def before_gradient_based_update(self, *, timesteps: dict[str, Any]) -> None:
        """Set the learning rate of this moment."""
        super().before_gradient_based_update(timesteps=timesteps)
        settings = self.config.learner_config_dict
        for name, module in self._modules():
            remaining = 1.0 - float(module.decisions) / settings[TOTAL_DECISIONS]
            rate = settings[LEARNING_RATE] * max(remaining, LOWEST_SHARE)
            for _, optimiser in self.get_optimizers_for_module(name):
                self._set_optimizer_lr(optimiser, rate)

    def after_gradient_based_update(self, *, timesteps: dict[str, Any]) -> None:
        """Take what was learned from into the normalisation of observations."""
        super().after_gradient_based_update(timesteps=timesteps)
        for _, module in self._modules():
            module.learn_stats(self._advantages.learned)

    def _modules(self) -> Iterator[tuple[str, SharedPolicyModule]]:
        for name in self.module.keys():
            module = self.module[name].unwrapped()
            assert isinstance(module, SharedPolicyModule)
            yield name, module
