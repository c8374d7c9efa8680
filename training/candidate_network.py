"""A network that chooses among a planner's candidate viewpoints, and that begins as the planner itself.

The logit of candidate k of K is what the planner says of it, a weighted sum of its features f, and a residual
r,

    l_k = β ln s_k + m [k = c] + w · f_k + r_k,        β, m > 0, w and r learned,

where c is its own choice and s_k ≤ 1 what it holds k to be worth, as a share of c. The weights w and the last
layer of r begin at zero: until something is learned the likeliest candidate is the planner's choice, and
others are the likelier the nearer their scores come to its own (residual learning: Johannink et al. 2019).
r comes from an MLP that all candidates share, and from layers of attention among them (Vaswani et al. 2017)
in which the overlap of what two candidates see is an additive bias.

The critic is a network of its own. In training it also reads P numbers that only training may know
(asymmetric actor and critic: Pinto et al. 2018); whoever acts leaves them out.

Letters: N observations, K candidates, F features of each, C numbers of the context, D units.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

import torch
from stable_baselines3.common.distributions import CategoricalDistribution
from stable_baselines3.common.policies import ActorCriticPolicy
from torch import nn
from torch.nn import functional

from entropy_explore_env.errors import SettingError
from entropy_explore_env.missions.observation.layout import ObservationLayout, Part
from entropy_explore_env.planner.candidate_features import COLUMNS
from entropy_explore_env.settings.validation import is_whole

WIDTH = 64
"""D, units of each candidate."""
ATTENTION_LAYERS = 2
HEADS = 4
"""Of each layer of attention; the width is a multiple of them."""
_MOST_LAYERS = 16
_BETA = 8.0
"""β before learning: a score that is a tenth smaller halves the odds."""
_MARGIN = 0.1
"""m before learning, so that the planner's choice also leads where others have its score."""
_LEAST_SCORE = 1e-3
"""Smaller scores count as this one."""
_NEVER = -1e8
"""Logit of a candidate that does not exist: its probability is exactly 0 in float32."""


def check_width(width: int) -> None:
    """Raise a SettingError unless networks may be so wide."""
    if not is_whole(width, HEADS, 1024) or width % HEADS:
        raise SettingError("width", width, f"a multiple of {HEADS}, at most 1024")


def check_attention_layers(layers: int) -> None:
    """Raise a SettingError unless networks may have this many layers of attention."""
    if not is_whole(layers, 0, _MOST_LAYERS):
        raise SettingError("attention_layers", layers, f"a whole number from 0 to {_MOST_LAYERS}")


class CandidateParts(NamedTuple):
    """Where a flat observation holds what the network reads.

    Attributes:
        candidates: (K, F) features.
        context: (C,) numbers of the robot, its mission and its team.
        mask: (K,) 1 for each candidate that exists.
        overlap: (K, K) what candidates k and l see in common, as a share of what the one that sees fewer
            sees; None = it is left out.
        score, chosen: Numbers of two features: what the planner holds a candidate to be worth, as a share of
            its own choice, and 1 for that.
        size: Numbers of an observation, without those that only training may know.
    """

    candidates: Part
    context: Part
    mask: Part
    overlap: Part | None
    score: int
    chosen: int
    size: int


class Seen(NamedTuple):
    """What of observations is for the network."""

    candidates: torch.Tensor
    """(N, K, F)."""
    context: torch.Tensor
    """(N, C)."""
    exists: torch.Tensor
    """(N, K) bool; all of them where a robot does not decide and has none: nothing is divided by 0."""
    overlap: torch.Tensor | None
    """(N, K, K)."""


def seen_by_network(parts: CandidateParts, observations: torch.Tensor) -> Seen:
    """Take observations (N, at least `parts.size`) apart."""

    def part(place: Part) -> torch.Tensor:
        return observations[:, place.start : place.stop].reshape(-1, *place.shape)

    exists = part(parts.mask) > 0.5
    exists = exists | ~exists.any(dim=1, keepdim=True)
    overlap = None if parts.overlap is None else part(parts.overlap)
    return Seen(part(parts.candidates), part(parts.context), exists, overlap)


class _Attention(nn.Module):
    """A layer in which candidates look at each other; normalised before, added to what was there."""

    def __init__(self, width: int, heads: int) -> None:
        super().__init__()
        self.heads = heads
        self.before, self.between = nn.LayerNorm(width), nn.LayerNorm(width)
        self.asked = nn.Linear(width, 3 * width)
        self.answered = nn.Linear(width, width)
        self.units = nn.Sequential(nn.Linear(width, width), nn.ReLU(), nn.Linear(width, width))
        self.overlap = nn.Parameter(torch.zeros(heads))

    def forward(
        self, tokens: torch.Tensor, exists: torch.Tensor, overlap: torch.Tensor | None
    ) -> torch.Tensor:
        """Return (N, K, D) from (N, K, D)."""
        count, candidates, width = tokens.shape
        shape = (count, candidates, self.heads, width // self.heads)
        query, key, value = (
            each.reshape(shape).transpose(1, 2) for each in self.asked(self.before(tokens)).chunk(3, dim=2)
        )
        bias = torch.where(exists, 0.0, _NEVER)[:, None, None, :]
        if overlap is not None:
            bias = bias + self.overlap[None, :, None, None] * overlap[:, None]
        looked = functional.scaled_dot_product_attention(query, key, value, attn_mask=bias)
        tokens = tokens + self.answered(looked.transpose(1, 2).reshape(count, candidates, width))
        return tokens + self.units(self.between(tokens))


class CandidateActor(nn.Module):
    """Logits of candidates; see the head of this file."""

    def __init__(
        self, parts: CandidateParts, width: int = WIDTH, attention_layers: int = ATTENTION_LAYERS
    ) -> None:
        """Make the network.

        Args:
            parts: What observations hold.
            width: D.
            attention_layers: Number of layers of attention; without any, each candidate is judged alone.
        """
        super().__init__()
        self.parts = parts
        read = parts.candidates.shape[1] + parts.context.shape[0]
        self.each = nn.Sequential(nn.Linear(read, width), nn.ReLU(), nn.Linear(width, width))
        self.layers = nn.ModuleList(_Attention(width, HEADS) for _ in range(attention_layers))
        self.after = nn.LayerNorm(width)
        self.residual = nn.Linear(width, 1)
        self.weights = nn.Parameter(torch.zeros(parts.candidates.shape[1]))
        self.log_beta = nn.Parameter(torch.tensor(math.log(_BETA)))
        self.log_margin = nn.Parameter(torch.tensor(math.log(_MARGIN)))
        self.begin_as_planner()

    def begin_as_planner(self) -> None:
        """Set the weights of features, and the last layer of the residual, to zero."""
        nn.init.zeros_(self.weights)
        nn.init.zeros_(self.residual.weight)
        nn.init.zeros_(self.residual.bias)

    def forward(self, observations: torch.Tensor) -> torch.Tensor:
        """Return the logits (N, K) of observations (N, at least `parts.size`)."""
        seen = seen_by_network(self.parts, observations)
        logits = self._planner(seen) + seen.candidates @ self.weights
        logits = logits + self.residual(self._tokens(seen))[:, :, 0]
        return torch.where(seen.exists, logits, _NEVER)

    def _planner(self, seen: Seen) -> torch.Tensor:
        """Return (N, K) what the planner says of the candidates."""
        score, chosen = (seen.candidates[:, :, each] for each in (self.parts.score, self.parts.chosen))
        behind = score.clamp(_LEAST_SCORE, 1.0).log()
        return self.log_beta.exp() * behind + self.log_margin.exp() * chosen

    def _tokens(self, seen: Seen) -> torch.Tensor:
        """Return (N, K, D) what is known of the candidates, each in the light of the others."""
        context = seen.context[:, None, :].expand(-1, seen.candidates.shape[1], -1)
        tokens = self.each(torch.cat([seen.candidates, context], dim=2))
        for layer in self.layers:
            tokens = layer(tokens, seen.exists, seen.overlap)
        return self.after(tokens)


class CandidateCritic(nn.Module):
    """Units from which a state's value is read: candidates pooled, the context, and what training knows."""

    def __init__(self, parts: CandidateParts, privileged: int = 0, width: int = WIDTH) -> None:
        """Make the network.

        Args:
            parts: What observations hold.
            privileged: P, numbers that follow an observation in training.
            width: D.
        """
        super().__init__()
        self.parts, self.privileged = parts, privileged
        features, context = parts.candidates.shape[1], parts.context.shape[0]
        self.each = nn.Sequential(nn.Linear(features, width), nn.ReLU(), nn.Linear(width, width), nn.ReLU())
        self.state = nn.Sequential(
            nn.Linear(2 * width + context + privileged, width), nn.LayerNorm(width), nn.ReLU(),
            nn.Linear(width, width), nn.LayerNorm(width), nn.ReLU(),
        )  # fmt: skip

    def forward(self, observations: torch.Tensor) -> torch.Tensor:
        """Return the units (N, D) of observations (N, `parts.size` + P)."""
        seen = seen_by_network(self.parts, observations)
        tokens = self.each(seen.candidates) * seen.exists[:, :, None]
        mean = tokens.sum(dim=1) / seen.exists.sum(dim=1, keepdim=True)
        known = observations[:, self.parts.size : self.parts.size + self.privileged]
        return self.state(torch.cat([mean, tokens.amax(dim=1), seen.context, known], dim=1))


class CandidateHeads(nn.Module):
    """Actor and critic, as Stable-Baselines3's policies hold them."""

    def __init__(self, parts: CandidateParts, privileged: int, width: int, attention_layers: int) -> None:
        """Make both; see CandidateActor and CandidateCritic."""
        super().__init__()
        self.latent_dim_pi, self.latent_dim_vf = parts.candidates.shape[0], width
        self.actor = CandidateActor(parts, width, attention_layers)
        self.critic = CandidateCritic(parts, privileged, width)

    def forward(self, features: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Return the logits (N, K) and the critic's units (N, D)."""
        return self.actor(features), self.critic(features)

    def forward_actor(self, features: torch.Tensor) -> torch.Tensor:
        """Return the logits (N, K)."""
        return self.actor(features)

    def forward_critic(self, features: torch.Tensor) -> torch.Tensor:
        """Return the critic's units (N, D)."""
        return self.critic(features)


class _Logits(CategoricalDistribution):
    """A distribution whose logits come from the actor as they are."""

    def proba_distribution_net(self, latent_dim: int) -> nn.Module:
        """Return the identity: the logits need no further layer."""
        del latent_dim
        return nn.Identity()


class CandidatePolicy(ActorCriticPolicy):
    """A policy over candidates, as Stable-Baselines3 trains it."""

    def __init__(
        self,
        *args: Any,  # noqa: ANN401 - as ActorCriticPolicy has them
        parts: CandidateParts,
        privileged: int = 0,
        width: int = WIDTH,
        attention_layers: int = ATTENTION_LAYERS,
        **kwargs: Any,  # noqa: ANN401
    ) -> None:
        """Make the networks.

        Args:
            *args: Of ActorCriticPolicy.
            parts: Where the network finds what it reads.
            privileged: P, numbers that follow an observation in training.
            width: D, units of each candidate.
            attention_layers: Of the actor.
            **kwargs: Of ActorCriticPolicy.
        """
        self._heads = (parts, privileged, width, attention_layers)
        super().__init__(*args, **kwargs)

    @property
    def actor(self) -> CandidateActor:
        """The network that acts."""
        assert isinstance(self.mlp_extractor, CandidateHeads)
        return self.mlp_extractor.actor

    def _build_mlp_extractor(self) -> None:
        self.mlp_extractor = CandidateHeads(*self._heads)  # pyright: ignore

    def _build(self, lr_schedule: Callable[[float], float]) -> None:
        self.action_dist = _Logits(self._heads[0].candidates.shape[0])
        super()._build(lr_schedule)
        self.actor.begin_as_planner()

    def _get_constructor_parameters(self) -> dict[str, Any]:
        """Return the arguments that `save` stores, to make the policy again."""
        parts, privileged, width, attention_layers = self._heads
        return super()._get_constructor_parameters() | {
            "parts": parts,
            "privileged": privileged,
            "width": width,
            "attention_layers": attention_layers,
        }


@contextmanager
def actor_frozen(policy: ActorCriticPolicy, frozen: bool) -> Iterator[None]:
    """Let only the critic of a policy over candidates learn inside, if `frozen`; others learn as ever."""
    if not frozen or not isinstance(policy, CandidatePolicy):
        yield
        return
    policy.actor.requires_grad_(False)
    try:
        yield
    finally:
        policy.actor.requires_grad_(True)


def candidate_parts(layout: ObservationLayout) -> CandidateParts:
    """Return what the network reads of a scenario's observations.

    Raises:
        SettingError: Features of candidates, or the mask, are not observed.
    """
    parts = layout.parts
    for name in ("candidates", "context", "action_mask"):
        if name not in parts:
            raise SettingError(
                f"observation {name}", None, "a part of the observation, for networks over candidates"
            )
    return CandidateParts(
        parts["candidates"],
        parts["context"],
        parts["action_mask"],
        parts.get("overlaps"),
        COLUMNS["score"],
        COLUMNS["chosen"],
        layout.size,
    )
