"""The networks of policies: an MLP over vectors, convolutions over maps, one small network for all gazes.

Observations are flat vectors; an ObservationLayout says where each part lies.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import torch
from gymnasium import spaces
from stable_baselines3.common.distributions import CategoricalDistribution
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from torch import nn
from torch.distributions import Categorical

from entropy_explore_env.errors import SettingError
from entropy_explore_env.missions.action import action_space
from entropy_explore_env.missions.observation.layout import ObservationLayout, Part
from entropy_explore_env.settings.scenario import Scenario
from training.candidate_network import ATTENTION_LAYERS, CandidatePolicy, candidate_parts


class MoveAndGaze(CategoricalDistribution):
    """A move and a gaze, independent of each other, from their scores (N, M + D)."""

    def __init__(self, moves: int, gazes: int) -> None:
        """Take M, the number of moves, and D, that of gazes."""
        super().__init__(moves * gazes)
        self._sizes = (moves, gazes)

    def proba_distribution_net(self, latent_dim: int) -> nn.Module:
        """Return the identity: the scores need no further layer."""
        del latent_dim
        return nn.Identity()

    def proba_distribution(self, action_logits: torch.Tensor) -> MoveAndGaze:
        """Take the scores of moves, then of gazes, (N, M + D)."""
        moves, gazes = action_logits.split(self._sizes, dim=1)
        self._moves, self._gazes = moves.log_softmax(dim=1), gazes.log_softmax(dim=1)
        return self

    @property
    def distribution(self) -> Categorical:
        """The same as one distribution over all M·D actions."""
        return Categorical(logits=(self._moves[:, :, None] + self._gazes[:, None, :]).flatten(1))

    @distribution.setter
    def distribution(self, value: None) -> None:
        """Ignore the None that Stable-Baselines3 assigns first: the distribution follows from the scores."""

    def log_prob(self, actions: torch.Tensor) -> torch.Tensor:
        """Return (N,) logarithms of the probabilities of actions (N,)."""
        chosen, gazes = actions.long()[:, None], self._sizes[1]
        parts = self._moves.gather(1, chosen // gazes) + self._gazes.gather(1, chosen % gazes)
        return parts[:, 0]

    def entropy(self) -> torch.Tensor:
        """Return (N,) entropies in nats."""
        moves, gazes = self._moves, self._gazes
        return -(moves.exp() * moves).sum(dim=1) - (gazes.exp() * gazes).sum(dim=1)

    def sample(self) -> torch.Tensor:
        """Return (N,) actions."""
        moves, gazes = (torch.multinomial(part.exp(), 1)[:, 0] for part in (self._moves, self._gazes))
        return moves * self._sizes[1] + gazes

    def mode(self) -> torch.Tensor:
        """Return (N,) likeliest actions."""
        return self._moves.argmax(dim=1) * self._sizes[1] + self._gazes.argmax(dim=1)


_MAPS = ("patch", "overview", "prediction")
_HIDDEN = ("action_mask",)
"""Parts that networks do not read."""
_CLIP = 10.0
"""Normalised numbers are clipped to ±this, so that what training never saw does not drown the rest."""


class VectorFeatures(BaseFeaturesExtractor):
    """All parts but maps, normalised: input of an MLP."""

    places: torch.Tensor
    mean: torch.Tensor
    std: torch.Tensor

    def __init__(self, space: spaces.Box, layout: ObservationLayout) -> None:
        """Read all parts but maps.

        Args:
            space: Of flat observations.
            layout: Where their parts lie.
        """
        vectors = [part for name, part in layout.parts.items() if name not in (*_MAPS, *_HIDDEN)]
        places = np.concatenate([np.arange(part.start, part.stop) for part in vectors])
        super().__init__(space, len(places))
        self.register_buffer("places", torch.as_tensor(places), persistent=False)
        self.register_buffer("mean", torch.zeros(layout.size))
        self.register_buffer("std", torch.ones(layout.size))

    def normalise_by(self, mean: np.ndarray, std: np.ndarray) -> None:
        """Normalise by these means and standard deviations (F,) of flat observations."""
        self.mean.copy_(torch.as_tensor(mean))
        self.std.copy_(torch.as_tensor(std))

    def forward(self, observations: torch.Tensor) -> torch.Tensor:
        """Return the features (N, K) of observations (N, F)."""
        normalised = (observations - self.mean) / self.std
        return normalised.index_select(1, self.places).clamp(-_CLIP, _CLIP)


class MapFeatures(VectorFeatures):
    """The vector, and features of maps from small convolutions: patch, overview and prediction.

    Maps one voxel high get two-dimensional convolutions, others three-dimensional ones. Maps hold numbers
    from 0 to 1 and are not normalised.
    """

    def __init__(
        self, space: spaces.Box, layout: ObservationLayout, channels: int = 16, features: int = 64
    ) -> None:
        """Read all parts.

        Args:
            space: Of flat observations.
            layout: Where their parts lie.
            channels: Of the first convolution; the second has twice as many.
            features: Of each map.
        """
        super().__init__(space, layout)
        self._maps: dict[str, Part] = {name: layout.parts[name] for name in _MAPS if name in layout.parts}
        self.convolutions = nn.ModuleDict(
            {name: _convolution(part.shape, channels, features) for name, part in self._maps.items()}
        )
        self._features_dim += features * len(self._maps)

    def forward(self, observations: torch.Tensor) -> torch.Tensor:
        """Return the features (N, K) of observations (N, F)."""
        seen = [super().forward(observations)]
        for name, part in self._maps.items():
            shape = part.shape[:3] if _is_flat(part.shape) else part.shape
            cells = observations[:, part.start : part.stop].reshape(-1, *shape)
            seen.append(self.convolutions[name](cells))
        return torch.cat(seen, dim=1)


def _is_flat(shape: tuple[int, ...]) -> bool:
    """Return whether a map (C, x, y[, z]) is one cell high."""
    return len(shape) == 3 or shape[3] == 1


def _convolution(shape: tuple[int, ...], channels: int, features: int) -> nn.Module:
    """Return a network from maps (N, C, x, y[, z]) to (N, features)."""
    flat = _is_flat(shape)
    convolution = nn.Conv2d if flat else nn.Conv3d
    layers = nn.Sequential(
        convolution(shape[0], channels, 3, padding=1),
        nn.ReLU(),
        convolution(channels, 2 * channels, 3, stride=2, padding=1),
        nn.ReLU(),
        nn.Flatten(),
    )
    with torch.no_grad():
        size = layers(torch.zeros(1, *(shape[:3] if flat else shape))).shape[1]
    return nn.Sequential(layers, nn.Linear(size, features), nn.ReLU())


_AROUND = tuple(itertools.product((-1, 0, 1), (-1, 0, 1)))
"""Steps in yaw and pitch from a direction to its neighbours, itself included."""


def _places_around(yaws: int, pitches: int) -> np.ndarray:
    """Return (D·18,) indices into a panorama (2, D): both channels of the nine directions around each gaze.

    Yaws wrap around; at the highest and lowest pitch, the direction itself stands for what lies beyond. (A
    gather and a product are three times as fast as a convolution of so few channels.)
    """
    directions = yaws * pitches
    places = [
        part * directions + (yaw + right) % yaws * pitches + min(max(pitch + up, 0), pitches - 1)
        for yaw in range(yaws)
        for pitch in range(pitches)
        for part in range(2)
        for right, up in _AROUND
    ]
    return np.array(places)


class _Logistic(torch.autograd.Function):
    """tanh x = 2 / (1 + e^(-2x)) - 1, exact to about 1e-7, in less than half the time of PyTorch's tanh."""

    @staticmethod
    def forward(ctx: Any, x: torch.Tensor) -> torch.Tensor:  # noqa: ANN401 - PyTorch has no type for it
        y = (2.0 * x).sigmoid_().mul_(2.0).sub_(1.0)
        ctx.save_for_backward(y)
        return y

    @staticmethod
    def backward(ctx: Any, slope: torch.Tensor) -> torch.Tensor:  # noqa: ANN401
        (y,) = ctx.saved_tensors
        return torch.ops.aten.tanh_backward(slope, y)


class Tanh(nn.Module):
    """The hyperbolic tangent, fast on CPUs."""

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        """Return the hyperbolic tangent of values of any shape."""
        return _Logistic.apply(x)  # pyright: ignore[reportReturnType]


class GazeHeads(nn.Module):
    """Scores of moves and of gazes, and the units of the critic.

    An MLP scores the moves. One small network with the same weights for every gaze scores the gazes: it reads
    the panorama's rays around that direction and the MLP's units. So a promising direction is learned once,
    not once for every yaw and pitch.
    """

    places: torch.Tensor

    def __init__(
        self, features: int, panorama: tuple[int, int], moves: int, hidden: Sequence[int], channels: int = 16
    ) -> None:
        """Make the networks.

        Args:
            features: Size of the input, whose first 2·D numbers are the panorama's.
            panorama: Numbers of yaws and pitches, of gazes and of the panorama's D rays alike.
            moves: Number of moves.
            hidden: Units of the hidden layers of actor and critic.
            channels: Units of the network that scores a gaze.
        """
        super().__init__()
        self.latent_dim_pi, self.latent_dim_vf = moves + panorama[0] * panorama[1], hidden[-1]
        self.actor, self.critic = _perceptron(features, hidden), _perceptron(features, hidden)
        self.moves = nn.Linear(hidden[-1], moves)
        self.around = nn.Linear(2 * len(_AROUND), channels)
        self.said = nn.Linear(hidden[-1], channels)
        self.gazes, self.tanh = nn.Linear(channels, 1), Tanh()
        self.register_buffer("places", torch.as_tensor(_places_around(*panorama)), persistent=False)

    def forward(self, features: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Return the scores (N, moves + D) and the critic's units (N, hidden) of features (N, K)."""
        return self.forward_actor(features), self.forward_critic(features)

    def forward_actor(self, features: torch.Tensor) -> torch.Tensor:
        """Return the scores of moves, then of gazes, (N, moves + D)."""
        rays = features.index_select(1, self.places).reshape(len(features), -1, 2 * len(_AROUND))
        units = self.actor(features)
        looked = self.tanh(self.around(rays) + self.said(units)[:, None])
        return torch.cat([self.moves(units), self.gazes(looked)[:, :, 0]], dim=1)

    def forward_critic(self, features: torch.Tensor) -> torch.Tensor:
        """Return the critic's units."""
        return self.critic(features)


class GazePolicy(ActorCriticPolicy):
    """A policy of discrete actions that scores moves and gazes separately: see `GazeHeads`."""

    def __init__(
        self,
        *args: Any,  # noqa: ANN401 - as ActorCriticPolicy has them
        panorama: tuple[int, int],
        moves: int,
        hidden: tuple[int, ...],
        **kwargs: Any,  # noqa: ANN401
    ) -> None:
        """Make the networks; see `GazeHeads` for the arguments."""
        self._heads = (panorama, moves, hidden)
        super().__init__(*args, **kwargs)

    def _build_mlp_extractor(self) -> None:
        self.mlp_extractor = GazeHeads(self.features_dim, *self._heads)  # pyright: ignore

    def _build(self, lr_schedule: Callable[[float], float]) -> None:
        (yaws, pitches), moves, _ = self._heads
        self.action_dist = MoveAndGaze(moves, yaws * pitches)
        super()._build(lr_schedule)
        assert isinstance(self.mlp_extractor, GazeHeads)
        for last in (self.mlp_extractor.moves, self.mlp_extractor.gazes):  # nearly uniform at first
            nn.init.orthogonal_(last.weight, gain=0.01)

    def _get_constructor_parameters(self) -> dict[str, Any]:
        """Return the arguments that `save` stores, to make the policy again."""
        panorama, moves, hidden = self._heads
        return super()._get_constructor_parameters() | {
            "panorama": panorama,
            "moves": moves,
            "hidden": hidden,
        }


def _perceptron(features: int, hidden: Sequence[int]) -> nn.Sequential:
    sizes = [features, *hidden]
    layers = [(nn.Linear(a, b), Tanh()) for a, b in itertools.pairwise(sizes)]
    return nn.Sequential(*itertools.chain.from_iterable(layers))


FEATURES: Mapping[str, type[VectorFeatures]] = {
    "gazes": VectorFeatures,
    "vector": VectorFeatures,
    "maps": MapFeatures,
}
"""Networks that read observations, by the name of the option `--features`."""


NETWORKS = (*FEATURES, "candidates")
"""Names of networks; those over candidates, in `candidate_network`, read observations as they are."""


def policy_class(features: str) -> type[ActorCriticPolicy]:
    """Return the policy that goes with a name of NETWORKS."""
    return {"gazes": GazePolicy, "candidates": CandidatePolicy}.get(features, ActorCriticPolicy)


def policy_keywords(
    features: str,
    scenario: Scenario,
    hidden: tuple[int, ...],
    privileged: int = 0,
    attention_layers: int = ATTENTION_LAYERS,
) -> dict[str, Any]:
    """Return a Stable-Baselines3 policy's `policy_kwargs`: orthogonal weights, tanh, actor and critic apart.

    Args:
        features: A name of NETWORKS.
        scenario: Whose observations and actions.
        hidden: Units of the hidden layers; over candidates one number, the units of each.
        privileged: Numbers that follow an observation in training, for the critic over candidates.
        attention_layers: Of the actor over candidates.

    Raises:
        SettingError: The networks cannot have the scenario's actions or observations.
    """
    layout = ObservationLayout(scenario)
    if features == "candidates":
        return {
            "parts": candidate_parts(layout),
            "privileged": privileged,
            "width": hidden[0],
            "attention_layers": attention_layers,
            "ortho_init": False,
        }
    settings: dict[str, Any] = {
        "features_extractor_class": FEATURES[features],
        "features_extractor_kwargs": {"layout": layout},
        "net_arch": list(hidden),
        "activation_fn": nn.Tanh,
        "ortho_init": True,
    }
    if features == "gazes":
        rays, panorama = layout.parts.get("panorama"), gazes_of(scenario)
        if scenario.action.kind != "discrete" or rays is None or rays.shape[1] != panorama[0] * panorama[1]:
            allowed = "discrete actions, and a panorama with a ray for each gaze, for features gazes"
            raise SettingError("actions", scenario.action.kind, allowed)
        moves = action_count(scenario) // rays.shape[1]
        settings |= {"panorama": panorama, "moves": moves, "hidden": hidden}
    return settings


def gazes_of(scenario: Scenario) -> tuple[int, int]:
    """Return yaws and pitches of a scenario's discrete gazes."""
    return scenario.action.yaws, 1 if scenario.planar else scenario.action.pitches


def action_count(scenario: Scenario) -> int:
    """Return how many discrete actions a robot of a scenario has."""
    space = action_space(scenario)
    assert isinstance(space, spaces.Discrete)
    return int(space.n)
