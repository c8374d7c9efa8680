"""The shared policy as RLlib's module, and RLlib's learner, which learns from decisions alone."""
# pyright: reportMissingImports=false

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import gymnasium
import numpy as np
import torch
from ray.rllib.algorithms.ppo.torch.ppo_torch_learner import PPOTorchLearner
from ray.rllib.connectors.connector_v2 import ConnectorV2
from ray.rllib.connectors.learner import GeneralAdvantageEstimation
from ray.rllib.core.columns import Columns
from ray.rllib.core.distribution.distribution import Distribution
from ray.rllib.core.distribution.torch.torch_distribution import TorchDeterministic
from ray.rllib.core.rl_module.apis.value_function_api import ValueFunctionAPI
from ray.rllib.core.rl_module.torch import TorchRLModule
from ray.rllib.evaluation.postprocessing import Postprocessing
from stable_baselines3.common.distributions import CategoricalDistribution
from stable_baselines3.common.policies import ActorCriticPolicy
from torch import nn

from entropy_explore_env.missions.observation.layout import ObservationLayout
from training.advantages import Discounting, Normaliser, Steps, decision_advantages
from training.checkpoints import Checkpoint, PolicySettings
from training.policy import make_policy, normalise_observations, weights_of

SETTINGS = "policy"
"""Key of the PolicySettings in the module's `model_config`."""
RETURNS_MEMORY = 2e5
"""Decisions, about, whose returns normalise: the latest ones, since returns grow as the policy learns."""


class RunningStats(nn.Module):
    """A Normaliser's numbers as buffers, which travel with weights."""

    count: torch.Tensor
    mean: torch.Tensor
    variance: torch.Tensor

    def __init__(self, size: int) -> None:
        """Begin with none of F = size components seen."""
        super().__init__()
        self.register_buffer("count", torch.zeros((), dtype=torch.float64))
        self.register_buffer("mean", torch.zeros(size, dtype=torch.float64))
        self.register_buffer("variance", torch.ones(size, dtype=torch.float64))

    def normaliser(self, memory: float = np.inf) -> Normaliser:
        """Return the Normaliser with these numbers; see there for `memory`."""
        stats = Normaliser(len(self.mean), memory)
        stats.count = float(self.count)
        stats.mean, stats.var = self.mean.numpy().copy(), self.variance.numpy().copy()
        return stats

    def take(self, stats: Normaliser) -> None:
        """Take over a Normaliser's numbers."""
        self.count.fill_(float(stats.count))
        self.mean.copy_(torch.as_tensor(stats.mean))
        self.variance.copy_(torch.as_tensor(stats.var))


class SharedPolicyModule(TorchRLModule, ValueFunctionAPI):
    """One policy of Stable-Baselines3 for every robot; its values are normalised returns.

    Attributes:
        policy: The networks.
        observation_stats: Of the observations that were learned from.
        return_stats: Of their returns.
        decisions: How many robots' decisions were learned from so far.
    """

    policy: ActorCriticPolicy
    decisions: torch.Tensor

    def setup(self) -> None:
        """Make the networks with fresh weights."""
        settings: PolicySettings = self.model_config[SETTINGS]
        self.policy = make_policy(settings)
        self.observation_stats = RunningStats(ObservationLayout(settings.scenario).size)
        self.return_stats = RunningStats(1)
        self.register_buffer("decisions", torch.zeros((), dtype=torch.float64))
        shared = self.policy.action_dist
        assert isinstance(shared, CategoricalDistribution)
        self.action_dist_cls = type("RobotActions", (_Actions,), {"shared": shared})

    def _forward(self, batch: dict[str, Any], **kwargs: Any) -> dict[str, Any]:  # noqa: ANN401 - RLlib's
        del kwargs
        features = self.policy.extract_features(batch[Columns.OBS], self.policy.features_extractor)
        assert isinstance(features, torch.Tensor)
        scores = self.policy.action_net(self.policy.mlp_extractor.forward_actor(features))
        return {Columns.ACTION_DIST_INPUTS: scores}

    def _forward_train(self, batch: dict[str, Any], **kwargs: Any) -> dict[str, Any]:  # noqa: ANN401 - RLlib's
        return self._forward(batch, **kwargs)

    def compute_values(self, batch: dict[str, Any], embeddings: Any = None) -> torch.Tensor:  # noqa: ANN401
        """Return (N,) normalised values of the observations of a batch."""
        del embeddings
        return self.policy.predict_values(batch[Columns.OBS])[:, 0]

    def learn_stats(self, observations: np.ndarray) -> None:
        """Take observations (K, F) that were learned from into the normalisation."""
        stats = self.observation_stats.normaliser()
        stats.update(observations)
        self.observation_stats.take(stats)
        normalise_observations(self.policy, stats)
        self.decisions.add_(len(observations))


class _Actions(Distribution):
    """Actions drawn from scores by the policy's own distribution."""

    shared: CategoricalDistribution
    """Of the policy; it holds sizes only, its scores are set anew."""

    def __init__(self, scores: torch.Tensor) -> None:
        """Take the scores (N, K) of a batch."""
        super().__init__()
        self._scores = scores

    @classmethod
    def from_logits(cls, logits: torch.Tensor, **kwargs: Any) -> _Actions:  # noqa: ANN401 - RLlib's
        """Return the distribution of these scores."""
        del kwargs
        return cls(logits)

    @property
    def _drawn(self) -> CategoricalDistribution:
        return self.shared.proba_distribution(action_logits=self._scores)

    def sample(self, **kwargs: Any) -> torch.Tensor:  # noqa: ANN401 - RLlib's
        """Return (N,) actions."""
        del kwargs
        return self._drawn.sample()

    def rsample(self, **kwargs: Any) -> torch.Tensor:  # noqa: ANN401 - RLlib's
        """Refuse: discrete actions have no gradient."""
        raise NotImplementedError

    def logp(self, value: torch.Tensor, **kwargs: Any) -> torch.Tensor:  # noqa: ANN401 - RLlib's
        """Return (N,) logarithms of the probabilities of actions (N,)."""
        del kwargs
        return self._drawn.log_prob(value)

    def entropy(self, **kwargs: Any) -> torch.Tensor:  # noqa: ANN401 - RLlib's
        """Return (N,) entropies in nats."""
        del kwargs
        entropy = self._drawn.entropy()
        assert entropy is not None
        return entropy

    def kl(self, other: Distribution, **kwargs: Any) -> torch.Tensor:  # noqa: ANN401 - RLlib's
        """Refuse: PPO clips."""
        raise NotImplementedError

    @staticmethod
    def required_input_dim(space: gymnasium.Space, **kwargs: Any) -> int:  # noqa: ANN401 - RLlib's
        """Refuse: the policy itself knows how many scores it gives."""
        raise NotImplementedError

    def to_deterministic(self) -> TorchDeterministic:
        """Return the likeliest actions."""
        return TorchDeterministic(self._drawn.mode())


def policy_in(
    weights: dict[str, np.ndarray], settings: PolicySettings, progress: dict[str, Any]
) -> Checkpoint:
    """Return the policy as `training.checkpoints` keeps it, from a module's state.

    Args:
        weights: State of a SharedPolicyModule.
        settings: Of its policy.
        progress: How far training was.
    """
    module = torch.nn.Module()
    module.policy = make_policy(settings)
    sizes = {"observation_stats": ObservationLayout(settings.scenario).size, "return_stats": 1}
    for name, size in sizes.items():
        setattr(module, name, RunningStats(size))
    module.load_state_dict(
        {name: torch.as_tensor(np.array(each)) for name, each in weights.items()}, strict=False
    )
    arrays = module.observation_stats.normaliser().arrays("observations")  # pyright: ignore
    arrays |= module.return_stats.normaliser().arrays("returns")  # pyright: ignore
    kept = {name: each.clone() for name, each in weights_of(module.policy).items()}  # pyright: ignore
    return Checkpoint(settings, progress, kept, arrays)


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
        """Return (K,) advantages of the decisions, whose rewards count at their ends.

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
        """Return the decisions in random order, with standardised advantages and normalised returns.

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
    """Return (L,) simulated seconds from each of a chunk's decisions to the next; without the added row."""
    times_s = [info["time_s"] for info in chunk.get_infos(slice(0, len(chunk)))]
    return np.diff(np.array(times_s, np.float64))


class DecisionLearner(PPOTorchLearner):
    """PPO's loss is RLlib's."""

    def configure_optimizers_for_module(self, module_id: str, config: Any = None) -> None:  # noqa: ANN401
        """Register Adam with the settings that Stable-Baselines3 gives it."""
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
        """Update the normalisation of observations with those that were learned from."""
        super().after_gradient_based_update(timesteps=timesteps)
        for _, module in self._modules():
            module.learn_stats(self._advantages.learned)

    def _modules(self) -> Iterator[tuple[str, SharedPolicyModule]]:
        for name in self.module.keys():
            module = self.module[name].unwrapped()
            assert isinstance(module, SharedPolicyModule)
            yield name, module
