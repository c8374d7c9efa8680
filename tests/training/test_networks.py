"""What networks see of observations, that gazes are scored alike, and the distribution of moves and gazes."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch.distributions import Categorical

from entropy_explore_env.errors import SettingError
from entropy_explore_env.missions.observation.layout import ObservationLayout
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.settings.scenarios import find_scenario
from training.advantages import Normaliser
from training.checkpoints import PolicySettings
from training.networks import GazeHeads, MapFeatures, MoveAndGaze, Tanh, VectorFeatures, policy_keywords
from training.policy import choose_actions, make_policy, normalise_observations, weights_of

YAWS, PITCHES = 6, 3


def scenario(name: str = "box-7x11x5", **observation: Any) -> Scenario:
    form = {"flat": True, "panorama_yaws": YAWS, "panorama_pitches": PITCHES, **observation}
    action = {"kind": "discrete", "moves": "axes", "yaws": YAWS, "pitches": PITCHES}
    return with_settings(find_scenario(name), {"robots": 2, "observation": form, "action": action})


def observations(there: Scenario, count: int = 5) -> torch.Tensor:
    size = ObservationLayout(there).size
    return torch.as_tensor(np.random.default_rng(0).uniform(0, 1, (count, size)).astype(np.float32))


def test_vectors_are_the_parts_that_are_no_maps_scaled_and_clipped() -> None:
    maps = {"patch": True, "patch_shape": (3, 5, 3), "overview": True, "prediction": True}
    there = scenario(**maps, action_mask=True)
    layout, seen = ObservationLayout(there), observations(there)
    features = VectorFeatures(layout.flat_space(), layout)
    names = ("panorama", "self", "team")
    parts = torch.cat([seen[:, layout.parts[name].start : layout.parts[name].stop] for name in names], dim=1)
    assert torch.equal(features(seen), parts)
    features.normalise_by(np.full(layout.size, 0.5), np.full(layout.size, 0.01))
    assert torch.allclose(features(seen), ((parts - 0.5) / 0.01).clamp(-10, 10))
    assert set(features.state_dict()) == {"mean", "std"}


@pytest.mark.parametrize(
    ("name", "parts"),
    [("box-7x11x5", ("patch", "overview")), ("office", ("overview", "prediction")), ("office", ("patch",))],
)
def test_maps_are_looked_at_whether_flat_or_not(name: str, parts: tuple[str, ...]) -> None:
    """A change of any cell of a map changes the features; without maps none would."""
    there = scenario(name, **{part: True for part in parts}, patch_shape=(5, 7, 1 if name == "office" else 3))
    layout = ObservationLayout(there)
    torch.manual_seed(0)
    features = MapFeatures(layout.flat_space(), layout, channels=3, features=4)
    seen = observations(there, 1).requires_grad_()
    values = features(seen)
    assert values.shape == (1, features.features_dim)
    values.abs().sum().backward()
    assert seen.grad is not None
    for part in parts:
        place = layout.parts[part]
        assert seen.grad[0, place.start : place.stop].count_nonzero() > 0.5 * (place.stop - place.start)


def test_a_gaze_is_scored_by_what_is_around_it_wherever_that_is() -> None:
    """Turning the panorama turns the scores of gazes with it, where the MLP says the same."""
    torch.manual_seed(0)
    heads = GazeHeads(2 * YAWS * PITCHES + 4, (YAWS, PITCHES), 7, (5, 5))
    for layer in (heads.actor[0],):  # the MLP sees nothing of the panorama
        layer.weight.data[:, : 2 * YAWS * PITCHES] = 0.0  # pyright: ignore
    seen = torch.rand(3, 2 * YAWS * PITCHES + 4)
    rays = seen[:, : 2 * YAWS * PITCHES].reshape(3, 2, YAWS, PITCHES)
    turned = seen.clone()
    turned[:, : 2 * YAWS * PITCHES] = rays.roll(2, dims=2).reshape(3, -1)
    ours, theirs = heads.forward_actor(seen), heads.forward_actor(turned)
    assert torch.allclose(ours[:, :7], theirs[:, :7])
    gazes = ours[:, 7:].reshape(3, YAWS, PITCHES)
    assert torch.allclose(gazes.roll(2, dims=1), theirs[:, 7:].reshape(3, YAWS, PITCHES), atol=1e-6)
    assert not torch.allclose(gazes, theirs[:, 7:].reshape(3, YAWS, PITCHES), atol=1e-3)


def test_logits_are_the_sums_of_moves_and_gazes_in_the_order_of_actions() -> None:
    torch.manual_seed(1)
    there = scenario()
    policy = make_policy(PolicySettings(there, "gazes", (8,)))
    seen = observations(there)
    scores = policy.mlp_extractor.forward_actor(policy.extract_features(seen))  # pyright: ignore
    logits = policy.get_distribution(seen).distribution.logits  # pyright: ignore
    moves, gazes = 7, YAWS * PITCHES
    for move in range(moves):
        for gaze in range(gazes):
            difference = scores[:, move] + scores[:, moves + gaze] - scores[:, 0] - scores[:, moves]
            assert torch.allclose(logits[:, move * gazes + gaze] - logits[:, 0], difference, atol=1e-5)
    near = policy.get_distribution(seen).distribution.probs  # pyright: ignore
    assert (near * moves * gazes - 1).abs().max() < 0.2  # at first all actions are about alike


@pytest.mark.parametrize("features", ["gazes", "vector", "maps"])
def test_each_weight_is_there_once_and_all_learn(features: str) -> None:
    there = scenario(overview=features == "maps")
    policy = make_policy(PolicySettings(there, features, (6,)))
    known = {id(each) for each in policy.parameters()}
    learning = {id(each) for group in policy.optimizer.param_groups for each in group["params"]}
    assert known == learning
    pointers = [each.data_ptr() for each in weights_of(policy).values()]
    assert len(set(pointers)) == len(pointers) == len(known)


def test_choosing_leaves_the_trainer_s_chance_alone_and_is_repeatable() -> None:
    there = scenario()
    policy, seen = make_policy(PolicySettings(there, "gazes", (8,))), observations(there, 50)
    normalise_observations(policy, Normaliser(seen.shape[1]))
    state = torch.get_rng_state()
    first = choose_actions(policy, seen.numpy(), torch.Generator().manual_seed(3))
    again = choose_actions(policy, seen.numpy(), torch.Generator().manual_seed(3))
    other = choose_actions(policy, seen.numpy(), torch.Generator().manual_seed(4))
    assert (first == again).all() and (first != other).any() and torch.equal(state, torch.get_rng_state())
    likeliest = policy.get_distribution(seen).distribution.logits.argmax(dim=1)  # pyright: ignore
    assert (choose_actions(policy, seen.numpy(), None) == likeliest.numpy()).all()


def test_continuous_actions_stay_in_their_box() -> None:
    there = with_settings(scenario(), {"action": {"kind": "continuous"}})
    policy, seen = make_policy(PolicySettings(there, "vector", (8,))), observations(there, 50)
    chosen = choose_actions(policy, seen.numpy(), torch.Generator().manual_seed(0))
    assert chosen.shape == (50, 5) and np.abs(chosen).max() <= 1.0 and chosen.std() > 0.3
    mean = choose_actions(policy, seen.numpy(), None)
    assert np.abs(mean).max() < 0.2


@pytest.mark.parametrize(
    "change", [{"action": {"kind": "continuous"}}, {"observation": {"panorama_yaws": 4}}]
)
def test_gazes_want_a_ray_for_each_gaze(change: dict[str, Any]) -> None:
    there = with_settings(scenario(), change)
    with pytest.raises(SettingError, match="a ray for each gaze"):
        policy_keywords("gazes", there, (8,))


@pytest.mark.parametrize("features", ["gazes", "vector"])
def test_normalisation_lies_beside_the_weights_and_stable_baselines3_saves_both(
    tmp_path: Path, features: str
) -> None:
    torch.manual_seed(0)
    policy = make_policy(PolicySettings(scenario(), features, (8, 8)))
    assert not any(name.endswith((".mean", ".std")) for name in weights_of(policy))
    size = ObservationLayout(scenario()).size
    stats = Normaliser(size)
    stats.update(np.random.default_rng(1).normal(3.0, 2.0, (50, size)))
    normalise_observations(policy, stats)
    policy.save(str(tmp_path / "policy.zip"))
    again = type(policy).load(str(tmp_path / "policy.zip"), device="cpu")
    seen = observations(scenario(), 40).numpy()
    before, _ = policy.predict(seen, deterministic=True)
    assert len(set(before.tolist())) > 1
    assert np.array_equal(before, again.predict(seen, deterministic=True)[0])


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
