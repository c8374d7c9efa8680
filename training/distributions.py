"""The distribution of pairs of a move and a gaze whose scores add up: a product of two small distributions.

Action m·D + g is move m of M with gaze g of D. Its logit is the sum of their scores, a(m) + b(g), and so

    p(m, g) = softmax(a)(m) softmax(b)(g),    H = H(softmax(a)) + H(softmax(b)):

so M + D numbers are drawn from and learned instead of M·D.
"""

from __future__ import annotations

import torch
from stable_baselines3.common.distributions import CategoricalDistribution
from torch import nn
from torch.distributions import Categorical


class MoveAndGaze(CategoricalDistribution):
    """A move and a gaze, independent of each other, from their scores (N, M + D)."""

    def __init__(self, moves: int, gazes: int) -> None:
        """Take M, the number of moves, and D, that of gazes."""
        super().__init__(moves * gazes)
        self._sizes = (moves, gazes)

    def proba_distribution_net(self, latent_dim: int) -> nn.Module:
        """The identity: the scores need no further layer."""
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
        """Stable-Baselines3 sets None at first; there is nothing to set."""

    def log_prob(self, actions: torch.Tensor) -> torch.Tensor:
        """(N,) logarithms of the probabilities of actions (N,)."""
        chosen, gazes = actions.long()[:, None], self._sizes[1]
        parts = self._moves.gather(1, chosen // gazes) + self._gazes.gather(1, chosen % gazes)
        return parts[:, 0]

    def entropy(self) -> torch.Tensor:
        """(N,) entropies in nats."""
        moves, gazes = self._moves, self._gazes
        return -(moves.exp() * moves).sum(dim=1) - (gazes.exp() * gazes).sum(dim=1)

    def sample(self) -> torch.Tensor:
        """(N,) actions."""
        moves, gazes = (torch.multinomial(part.exp(), 1)[:, 0] for part in (self._moves, self._gazes))
        return moves * self._sizes[1] + gazes

    def mode(self) -> torch.Tensor:
        """(N,) likeliest actions."""
        return self._moves.argmax(dim=1) * self._sizes[1] + self._gazes.argmax(dim=1)
