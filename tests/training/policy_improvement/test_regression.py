"""The regression finds what saves time, keeps the planner where nothing does, and says when it diverges."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from tests.training.test_candidate_network import C, F, K, P, drawn, parts, policy
from training.errors import DivergedError
from training.policy_improvement import regression
from training.policy_improvement.regression import RegressionSettings, as_json, regress, savings_of
from training.policy_improvement.shards import Labels
from training.policy_improvement.time_to_go import TimeToGo, learn_time_to_go

torch.set_num_threads(1)
B, D = 5, 4
del C, F


def labels(saved_by_feature: float, noise_s: float = 0.2, states: int = 400, seed: int = 0) -> Labels:
    """A candidate saves so many seconds by its first feature, whatever the planner says."""
    layout = parts()
    seen = drawn(layout, states, P, seed)
    rng = np.random.default_rng(seed + 1)
    features = seen.observations[:, layout.candidates.start : layout.candidates.stop].numpy()
    first = features.reshape(states, K, -1)[:, :, 0]
    tried = np.full((states, B), -1, np.int64)
    seconds = np.full((states, B, D), np.nan, np.float32)
    for state in range(states):
        others = np.flatnonzero(seen.exists[state] & (np.arange(K) != seen.chosen[state]))
        own = np.concatenate([[seen.chosen[state]], rng.permutation(others)])[:B]
        tried[state, : len(own)] = own
        luck = rng.normal(size=D)  # of the draw, shared by the branches
        spread = noise_s * rng.normal(size=(len(own), D))
        seconds[state, : len(own)] = 50.0 - saved_by_feature * first[state, own][:, None] + luck + spread
    to_go_s = (50.0 + 10.0 * seen.observations[:, layout.size]).numpy().astype(np.float32)
    moments = rng.uniform(size=(300, P)).astype(np.float32)
    return Labels(
        seen.observations.numpy(),
        tried,
        seconds,
        np.ones(seconds.shape, bool),
        np.zeros((*seconds.shape, P), np.float32),
        to_go_s,
        np.arange(states, dtype=np.int64) // 4,
        moments,
        100.0 * moments[:, 0],
        np.arange(300, dtype=np.int64) // 10,
    )


QUICK = RegressionSettings(epochs=40, batch=64, learning_rate=3e-3)


def test_a_policy_learns_to_choose_what_saves_time():
    told, learned = labels(2.0), policy(parts(), P)
    result, returns = regress(learned, told, QUICK)
    assert result.states == 400 and result.held_out == 80 and result.epoch > 0
    assert result.loss_after < 0.8 * result.loss_before
    assert result.saved_low_s > 0.0 and result.saved_s > 0.6 * result.best_s
    assert result.noise_s == pytest.approx(0.2 * np.sqrt(2.0 / D), rel=0.3)
    assert returns.mean[0] == pytest.approx(-told.to_go_s.mean(), rel=0.05)
    fresh = drawn(parts(), 300, seed=9)
    features = fresh.observations[:, parts().candidates.start : parts().candidates.stop].reshape(300, K, -1)
    best = np.where(fresh.exists, features[:, :, 0].numpy(), -np.inf).argmax(axis=1)
    logits = learned.actor(fresh.observations).detach().numpy()
    assert (logits.argmax(axis=1) == best).mean() > 0.45
    values = returns.denormalise(learned.predict_values(torch.as_tensor(told.observations)).detach().numpy())
    assert np.corrcoef(values[:, 0], -told.to_go_s)[0, 1] > 0.8


def test_where_there_is_nothing_to_learn_the_policy_stays_close_to_the_planner():
    """Labels are luck alone: choices on missions that were held out save nothing."""
    learned, seen = policy(parts(), P), labels(0.0, noise_s=1.0)
    result, _ = regress(learned, seen, QUICK)
    assert result.saved_low_s <= 0.0 <= result.saved_high_s + 0.2
    assert abs(result.best_s) < 0.3
    assert result.loss_after <= result.loss_before


def test_a_diverging_regression_is_named():
    with pytest.raises(DivergedError, match="learning-rate"):
        regress(policy(parts(), P), labels(2.0), RegressionSettings(epochs=5, learning_rate=300.0))
    broken = labels(2.0)
    broken.observations[3] = np.nan
    with pytest.raises(DivergedError, match="nan"):
        regress(policy(parts(), P), broken, RegressionSettings(epochs=2))


def test_savings_by_hand():
    told = labels(0.0, states=2)
    told.candidates[0] = [3, 1, -1, -1, -1]
    told.seconds[0] = np.nan
    told.seconds[0, 0], told.seconds[0, 1] = [10, 12, 14, 16], [9, 12, 11, 16]
    told.ended[0, 1] = [True, True, False, True]
    told.at_end[0, 1, 2] = 1.0

    class Fixed(TimeToGo):
        def seconds(self, numbers):
            return 2.5 * numbers[..., 0]

    flat = Fixed(torch.nn.Sequential(), torch.zeros(P), torch.ones(P), 1.0)
    savings = savings_of(told, flat)
    assert np.allclose(savings.draws_s[0, 1], [1.0, 0.0, 0.5, 0.0])
    assert savings.mean_s[0, 1] == pytest.approx(0.375) and savings.mean_s[0, 0] == 0.0
    expected = np.std([1.0, 0.0, 0.5, 0.0], ddof=1) / 2.0
    assert savings.error_s[0, 1] == pytest.approx(expected) and np.isnan(savings.mean_s[0, 2])
    assert np.allclose(savings_of(told, None).draws_s[0, 1], [1.0, 0.0, 3.0, 0.0])


def test_the_time_to_go_is_learned_and_never_negative():
    rng = np.random.default_rng(0)
    numbers = rng.uniform(size=(2000, P))
    to_go_s = 80.0 * numbers[:, 0] ** 2
    learned = learn_time_to_go(numbers, to_go_s)
    fresh = rng.uniform(size=(500, P))
    error_s = np.abs(learned.seconds(fresh) - 80.0 * fresh[:, 0] ** 2)
    assert np.median(error_s) < 2.0 and learned.seconds(fresh - 5.0).min() >= 0.0
    assert np.array_equal(learned.seconds(fresh), learn_time_to_go(numbers, to_go_s).seconds(fresh))


def test_results_are_json_without_what_could_not_be_measured():
    told = labels(1.0, states=40)._replace(moments_mission=np.zeros(300, np.int64))
    result, _ = regress(policy(parts(), P), told, RegressionSettings(epochs=1))
    assert as_json(result)["to_go_error_s"] is None and as_json(result)["states"] == 40
    assert "40 states" in result.line()
    assert regression._HELD_OUT == 5
