"""A move and a gaze drawn separately, against PyTorch's one distribution over all actions."""

from __future__ import annotations

import numpy as np
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch.distributions import Categorical

from training.distributions import MoveAndGaze
from training.networks import Tanh


def both(moves: int, gazes: int, rows: int, seed: int) -> tuple[torch.Tensor, MoveAndGaze, Categorical]:
    """Scores that learn, the distribution of them, and the slow one of their sums."""
    drawn = 3.0 * torch.randn(rows, moves + gazes, generator=torch.Generator().manual_seed(seed))
    scores = drawn.double().requires_grad_()
    sums = torch.stack([scores[:, m] + scores[:, moves + g] for m in range(moves) for g in range(gazes)], 1)
    return scores, MoveAndGaze(moves, gazes).proba_distribution(scores), Categorical(logits=sums)


@settings(deadline=None, max_examples=25)
@given(st.integers(1, 7), st.integers(1, 9), st.integers(0, 1000))
def test_it_is_the_distribution_of_the_sums(moves: int, gazes: int, seed: int) -> None:
    scores, ours, slow = both(moves, gazes, moves * gazes, seed)
    chosen = torch.arange(moves * gazes)  # each action in a row of its own
    assert torch.allclose(ours.log_prob(chosen), slow.log_prob(chosen))
    slopes = [
        torch.autograd.grad(each.log_prob(chosen).sum(), scores, retain_graph=True)[0]
        for each in (ours, slow)
    ]
    assert torch.allclose(*slopes, atol=1e-9)
    assert torch.allclose(ours.entropy(), slow.entropy())
    slopes = [
        torch.autograd.grad(each.entropy().sum(), scores, retain_graph=True)[0] for each in (ours, slow)
    ]
    assert torch.allclose(*slopes, atol=1e-9)
    assert torch.equal(ours.mode(), slow.logits.argmax(dim=1))
    assert torch.allclose(ours.distribution.probs, slow.probs)


def test_actions_are_drawn_as_often_as_they_are_likely() -> None:
    moves, gazes, draws = 3, 4, 200_000
    scores, _, slow = both(moves, gazes, 1, 5)
    torch.manual_seed(0)
    drawn = MoveAndGaze(moves, gazes).proba_distribution(scores.detach().expand(draws, -1)).sample()
    shares = np.bincount(drawn.numpy(), minlength=moves * gazes) / draws
    likely = slow.probs[0].detach().numpy()
    assert (np.abs(shares - likely) < 5.0 * np.sqrt(likely * (1 - likely) / draws)).all()


def test_tanh_is_that_of_pytorch_and_so_is_its_slope() -> None:
    x = torch.cat([torch.linspace(-12.0, 12.0, 4001), torch.tensor([-1e4, -200.0, 0.0, 200.0, 1e4])])
    ours, theirs = x.clone().requires_grad_(), x.clone().requires_grad_()
    fast, slow = Tanh()(ours), torch.tanh(theirs)
    assert (fast - slow).abs().max() < 3e-7 and fast.abs().max() <= 1.0
    (fast.sum() + slow.sum()).backward()
    assert ours.grad is not None and theirs.grad is not None
    assert (ours.grad - theirs.grad).abs().max() < 1e-6
