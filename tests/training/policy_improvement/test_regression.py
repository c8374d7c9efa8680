"""The regression finds what saves time, keeps the planner where nothing does, and says when it diverges."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from tests.training.test_candidate_network import K, P, drawn, parts, policy
from training.errors import DivergedError, LabelsError
from training.policy_improvement.regression import (
    RegressionSettings,
    as_json,
    held_out_states,
    regress,
    saved_interval,
    savings_of,
)
from training.policy_improvement.shards import Labels
from training.policy_improvement.time_to_go import TimeToGo, learn_time_to_go

torch.set_num_threads(1)
B, D = 5, 4


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
        np.zeros(states, np.int64),
        moments,
        100.0 * moments[:, 0],
        np.arange(300, dtype=np.int64) // 10,
        np.zeros(300, np.int64),
    )


def of_two_tasks(one: Labels, other: Labels) -> Labels:
    """The other's missions are numbered after the one's."""
    after = 1 + max(one.mission.max(), one.moments_mission.max())
    numbered = other._replace(
        mission=other.mission + after,
        moments_mission=other.moments_mission + after,
        task=other.task + 1,
        moments_task=other.moments_task + 1,
    )
    return Labels.joined([one, numbered])


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
            return (2.5 if self.scale_s == 1.0 else 5.0) * numbers[..., 0]

    flat = Fixed(torch.nn.Sequential(), torch.zeros(P), torch.ones(P), 1.0)
    savings = savings_of(told, {0: flat})
    assert np.allclose(savings.draws_s[0, 1], [1.0, 0.0, 0.5, 0.0])
    assert savings.mean_s[0, 1] == pytest.approx(0.375) and savings.mean_s[0, 0] == 0.0
    expected = np.std([1.0, 0.0, 0.5, 0.0], ddof=1) / 2.0
    assert savings.error_s[0, 1] == pytest.approx(expected) and np.isnan(savings.mean_s[0, 2])
    assert np.allclose(savings_of(told, {}).draws_s[0, 1], [1.0, 0.0, 3.0, 0.0])
    both = savings_of(of_two_tasks(told, told), {0: flat, 1: flat._replace(scale_s=2.0)})
    assert np.allclose(both.draws_s[2, 1], [1.0, 0.0, -2.0, 0.0])
    assert np.array_equal(both.draws_s[0], savings.draws_s[0], equal_nan=True)


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
    assert result.held_out == 8


def test_tasks_of_other_scales_are_learned_like_one():
    """Seconds a hundredfold as long in one task change nothing for the other, nor for what is learned."""
    one, other = labels(2.0, states=200), labels(2.0, states=200, seed=5)
    longer = other._replace(
        seconds=100.0 * other.seconds,
        to_go_s=100.0 * other.to_go_s,
        moments_to_go_s=100.0 * other.moments_to_go_s,
    )
    learning = RegressionSettings(epochs=4, batch=64, learning_rate=3e-3)
    policies = [policy(parts(), P) for _ in range(2)]
    same, _ = regress(policies[0], of_two_tasks(one, other), learning)
    scaled, _ = regress(policies[1], of_two_tasks(one, longer), learning)
    assert scaled.loss_before == pytest.approx(same.loss_before, rel=1e-3)
    weights = [each.actor.residual.weight.detach().numpy() for each in policies]
    assert np.abs(weights[0]).max() > 0.0 and np.allclose(*weights, atol=2e-3)


def test_the_time_to_go_of_a_branch_is_its_own_tasks():
    """What the maps hold is the same in both tasks, what is to go is not: neither is off by the mean."""
    one = labels(0.0, states=40)
    longer = one._replace(moments_to_go_s=50.0 * one.moments_to_go_s)
    result, _ = regress(policy(parts(), P), of_two_tasks(one, longer), RegressionSettings(epochs=1))
    alone, _ = regress(policy(parts(), P), one, RegressionSettings(epochs=1))
    assert alone.to_go_error_s < 10.0
    assert result.to_go_error_s < 300.0  # of 2,500 s in the one task on average, 50 s in the other


def test_every_fifth_mission_of_a_task_is_held_out():
    one = labels(1.0, states=40)._replace(moments_mission=np.arange(300) % 10)
    held = held_out_states(of_two_tasks(one, one))
    assert np.array_equal(
        np.flatnonzero(held), [*range(16, 20), *range(36, 40), *range(56, 60), *range(76, 80)]
    )


@pytest.mark.parametrize(
    ("missions", "held"),
    [
        ([0, 0, 1, 1, 1], [2, 3, 4]),  # the last mission
        ([0, 0, 0, 0, 0, 0], [5]),  # of one mission the last fifth
        ([0, 0], [1]),
        ([4, 4, 4], [2]),  # all of them would be
        ([0, 9], [1]),
    ],
)
def test_of_few_states_some_are_held_out(missions, held):
    few = labels(1.0, states=len(missions))._replace(
        mission=np.array(missions), moments_mission=np.arange(300) % 10
    )
    assert np.flatnonzero(held_out_states(few)).tolist() == held
    result, _ = regress(policy(parts(), P), few, RegressionSettings(epochs=1))
    assert result.held_out == len(held) and np.isfinite(result.loss_after)
    assert as_json(result)["saved_low_s"] is None


@pytest.mark.parametrize("states", [0, 1])
def test_too_few_states_are_named(states):
    whole = labels(1.0, states=20)
    per_state = ("observations", "candidates", "seconds", "ended", "at_end", "to_go_s", "mission", "task")
    few = whole._replace(**{name: getattr(whole, name)[:states] for name in per_state})
    with pytest.raises(LabelsError, match=f"states of task 0 = {states}: .*at least 2"):
        regress(policy(parts(), P), few, QUICK)
    with pytest.raises(LabelsError, match=f"states of task 1 = {states}: .*at least 2"):
        regress(policy(parts(), P), of_two_tasks(whole, few) if states else _without(whole), QUICK)


def _without(one: Labels) -> Labels:
    """A second task that has moments and no states."""
    more = np.arange(300) >= 150
    return one._replace(moments_task=more.astype(np.int64))


def test_intervals_are_over_missions():
    """States of one mission that are alike count once: the interval does not shrink with their number."""
    each = np.array([-1.0, 3.0, 4.0, 2.0, 0.5, 7.0])
    once = saved_interval(each, np.arange(6))
    often = saved_interval(np.repeat(each, 50), np.repeat(np.arange(6), 50))
    assert once == pytest.approx(often) and once.value == pytest.approx(each.mean())
    uneven = saved_interval(np.array([1.0, 1.0, 4.0]), np.array([7, 7, 9]))
    assert uneven.value == pytest.approx(2.0) and uneven.low == 1.0 and uneven.high == 4.0
