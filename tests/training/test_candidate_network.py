"""The network over candidates: it begins as the planner and never chooses what does not exist."""

from typing import NamedTuple

import numpy as np
import pytest
import torch
from gymnasium import spaces

from entropy_explore_env.missions.observation.layout import Part
from training.candidate_network import CandidateActor, CandidateParts, CandidatePolicy

K, F, C, P = 7, 5, 3, 4
SCORE, CHOSEN = 2, 4


def parts(overlap: bool = True, candidates: int = K) -> CandidateParts:
    """A layout in which the mask comes first, so that nothing depends on the order."""
    places, start = [], 0
    shapes = [(candidates,), (C,), (candidates, F), (candidates, candidates)]
    for shape in shapes if overlap else shapes[:3]:
        stop = start + int(np.prod(shape))
        places.append(Part(start, stop, shape, 0.0, np.ones(1)))
        start = stop
    mask, context, features = places[:3]
    return CandidateParts(features, context, mask, places[3] if overlap else None, SCORE, CHOSEN, start)


class Drawn(NamedTuple):
    """Random observations and what is in them."""

    observations: torch.Tensor
    exists: np.ndarray
    chosen: np.ndarray
    score: np.ndarray


def drawn(layout: CandidateParts, count: int = 50, privileged: int = 0, seed: int = 0) -> Drawn:
    """Each has at least one candidate, and one that is the planner's choice, whatever the scores."""
    rng = np.random.default_rng(seed)
    values = rng.normal(size=(count, layout.size + privileged)).astype(np.float32)
    candidates = layout.candidates.shape[0]
    exists = rng.uniform(size=(count, candidates)) < 0.6
    chosen = rng.integers(candidates, size=count)
    exists[np.arange(count), chosen] = True
    features = values[:, layout.candidates.start : layout.candidates.stop].reshape(count, candidates, F)
    features[:, :, CHOSEN] = np.arange(candidates) == chosen[:, None]
    score = rng.uniform(0.0, 1.0, (count, candidates))
    score[rng.uniform(size=score.shape) < 0.2] = 1.0
    features[:, :, SCORE] = np.where(features[:, :, CHOSEN] > 0.0, 1.0, score)
    values[:, layout.candidates.start : layout.candidates.stop] = features.reshape(count, -1)
    values[:, layout.mask.start : layout.mask.stop] = exists
    if layout.overlap is not None:
        shared = rng.uniform(size=(count, candidates * candidates))
        values[:, layout.overlap.start : layout.overlap.stop] = shared
    return Drawn(torch.as_tensor(values), exists, chosen, features[:, :, SCORE])


def learned(actor: CandidateActor, size: float = 1.0) -> CandidateActor:
    """The actor with a last layer that says something."""
    torch.manual_seed(1)
    torch.nn.init.normal_(actor.residual.weight, std=size)
    torch.nn.init.normal_(actor.layers[0].overlap, std=3.0)  # pyright: ignore[reportArgumentType]
    return actor


def policy(layout: CandidateParts, privileged: int = 0) -> CandidatePolicy:
    """As Stable-Baselines3 makes it, orthogonal weights included."""
    torch.manual_seed(0)
    space = spaces.Box(-np.inf, np.inf, (layout.size + privileged,), np.float32)
    actions = spaces.Discrete(layout.candidates.shape[0])
    return CandidatePolicy(space, actions, lambda _: 1e-3, parts=layout, privileged=privileged)


@pytest.mark.parametrize("overlap", [True, False])
def test_before_learning_the_likeliest_candidate_is_the_planners_choice(overlap):
    """Also where others are worth as much; and the others' odds are the eighth power of their worth."""
    layout = parts(overlap)
    seen = drawn(layout, 200)
    fresh = policy(layout)
    distribution = fresh.get_distribution(seen.observations).distribution
    assert (distribution.logits.argmax(dim=1).numpy() == seen.chosen).all()  # pyright: ignore
    probabilities = distribution.probs.detach().numpy()  # pyright: ignore[reportAttributeAccessIssue]
    expected = np.where(seen.exists, np.maximum(seen.score, 1e-3) ** 8.0, 0.0)
    expected[np.arange(200), seen.chosen] *= np.exp(0.1)
    assert np.allclose(probabilities, expected / expected.sum(axis=1, keepdims=True), atol=1e-5)


def test_candidates_that_do_not_exist_are_never_chosen_and_change_nothing():
    layout = parts()
    actor, seen = learned(CandidateActor(layout), 30.0), drawn(layout, 100)
    logits = actor(seen.observations)
    assert logits.softmax(dim=1).detach().numpy()[~seen.exists].max() == 0.0
    changed = seen.observations.clone()
    place = layout.candidates
    features = changed[:, place.start : place.stop].reshape(-1, K, F)
    features[torch.as_tensor(~seen.exists)] = 9.0
    features[:, :, CHOSEN] = seen.observations[:, place.start : place.stop].reshape(-1, K, F)[:, :, CHOSEN]
    changed[:, place.start : place.stop] = features.reshape(100, -1)
    assert torch.allclose(actor(changed), logits, atol=1e-4)


def test_scores_go_with_the_candidates_in_whatever_order_they_come():
    layout = parts()
    actor, seen = learned(CandidateActor(layout)), drawn(layout, 20)
    order = torch.as_tensor(np.random.default_rng(3).permutation(K))
    turned = seen.observations.clone()
    for place in (layout.candidates, layout.mask):
        part = seen.observations[:, place.start : place.stop].reshape(20, K, -1)
        turned[:, place.start : place.stop] = part[:, order].reshape(20, -1)
    assert layout.overlap is not None
    where = slice(layout.overlap.start, layout.overlap.stop)
    shared = seen.observations[:, where].reshape(20, K, K)
    turned[:, where] = shared[:, order][:, :, order].reshape(20, -1)
    assert torch.allclose(actor(turned), actor(seen.observations)[:, order], atol=1e-4)
    turned[:, where] = shared.reshape(20, -1)
    assert not torch.allclose(actor(turned), actor(seen.observations)[:, order], atol=1e-2)


def test_only_the_critic_reads_what_only_training_knows():
    layout = parts()
    trained, seen = policy(layout, P), drawn(layout, 20, P)
    learned(trained.actor)
    told = seen.observations.clone()
    told[:, layout.size :] += 1.0
    logits = trained.get_distribution(seen.observations).distribution.logits  # pyright: ignore
    assert torch.equal(trained.get_distribution(told).distribution.logits, logits)  # pyright: ignore
    acting = trained.get_distribution(seen.observations[:, : layout.size]).distribution
    assert torch.equal(acting.logits, logits)  # pyright: ignore[reportAttributeAccessIssue]
    assert not torch.allclose(trained.predict_values(told), trained.predict_values(seen.observations))


def test_robots_without_candidates_get_finite_numbers():
    """Busy robots observe zeros; the value of the latest observation is asked of them, too."""
    layout = parts()
    trained, nothing = policy(layout), torch.zeros(3, layout.size)
    actions, values, log_probs = trained(nothing)
    assert torch.isfinite(values).all() and torch.isfinite(log_probs).all() and (actions < K).all()
