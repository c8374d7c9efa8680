"""The policy of `training.ppo` as RLlib's RLModule: the same networks, weights and distribution of actions.

Beside the policy it holds what normalises observations and returns, so that all of it reaches the runners and
RLlib's checkpoints with the weights.
"""
# pyright: reportMissingImports=false

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import torch
from ray.rllib.core.columns import Columns
from ray.rllib.core.distribution.distribution import Distribution
from ray.rllib.core.distribution.torch.torch_distribution import TorchDeterministic
from ray.rllib.core.rl_module.apis.value_function_api import ValueFunctionAPI
from ray.rllib.core.rl_module.torch import TorchRLModule
from stable_baselines3.common.distributions import CategoricalDistribution
from stable_baselines3.common.policies import ActorCriticPolicy
from torch import nn

from entropy_explore_env.missions.observation.layout import ObservationLayout
from training.checkpoints import Checkpoint, PolicySettings
from training.normalisation import Normaliser
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
        """The Normaliser with these numbers; see there for `memory`."""
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
        """(N,) normalised values of the observations of a batch."""
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
        """The distribution of these scores."""
        del kwargs
        return cls(logits)

    @property
    def _drawn(self) -> CategoricalDistribution:
        return self.shared.proba_distribution(action_logits=self._scores)

    def sample(self, **kwargs: Any) -> torch.Tensor:  # noqa: ANN401 - RLlib's
        """(N,) actions."""
        del kwargs
        return self._drawn.sample()

    def rsample(self, **kwargs: Any) -> torch.Tensor:  # noqa: ANN401 - RLlib's
        """Discrete actions have no gradient."""
        raise NotImplementedError

    def logp(self, value: torch.Tensor, **kwargs: Any) -> torch.Tensor:  # noqa: ANN401 - RLlib's
        """(N,) logarithms of the probabilities of actions (N,)."""
        del kwargs
        return self._drawn.log_prob(value)

    def entropy(self, **kwargs: Any) -> torch.Tensor:  # noqa: ANN401 - RLlib's
        """(N,) entropies in nats."""
        del kwargs
        entropy = self._drawn.entropy()
        assert entropy is not None
        return entropy

    def kl(self, other: Distribution, **kwargs: Any) -> torch.Tensor:  # noqa: ANN401 - RLlib's
        """Not used: PPO clips."""
        raise NotImplementedError

    @staticmethod
    def required_input_dim(space: gymnasium.Space, **kwargs: Any) -> int:  # noqa: ANN401 - RLlib's
        """The policy knows how many scores it gives."""
        raise NotImplementedError

    def to_deterministic(self) -> TorchDeterministic:
        """The likeliest actions."""
        return TorchDeterministic(self._drawn.mode())


def policy_in(
    weights: dict[str, np.ndarray], settings: PolicySettings, progress: dict[str, Any]
) -> Checkpoint:
    """The policy as `training.checkpoints` keeps it, from a module's state.

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
