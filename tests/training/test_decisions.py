"""Decisions of rows, against a plain walk through each row, and by hand."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import torch
from gymnasium import spaces
from hypothesis import given
from hypothesis import strategies as st

from tests.reference.scenes import drawn
from training.decisions import DecisionBuffer
from training.errors import NotFiniteError
from training.scales import RunningScale

SPACE = spaces.Box(-1.0, 1.0, (2,), np.float32)


def filled(
    decided: np.ndarray,
    rewards: np.ndarray,
    elapsed_s: np.ndarray,
    ended: np.ndarray,
    cut_off: np.ndarray,
    values: np.ndarray,
    last: np.ndarray,
    deciding: np.ndarray,
    discount: Any = "seconds",
    scale: RunningScale | None = None,
    gamma: float = 0.8,
    lam: float = 0.7,
) -> DecisionBuffer:
    """A buffer that saw these steps (T, N); `cut_off` is V of the last observation where time ended it."""
    steps, count = decided.shape
    rows: Any = SimpleNamespace()
    buffer = DecisionBuffer(
        steps,
        SPACE,
        spaces.Discrete(9),
        gamma=gamma,
        gae_lambda=lam,
        n_envs=count,
        rows=rows,
        discount=discount,
        scale=scale or RunningScale(),
        chance=np.random.default_rng(0),
    )
    for step in range(steps):
        rows.decided, rows.ended, rows.elapsed_s = decided[step], ended[step], elapsed_s[step]
        rows.rewards = rewards[step]
        seen = np.full((count, 2), step, np.float32)
        buffer.add_step(
            cut_off[step],
            seen,
            np.arange(count) + 3,
            rewards[step],
            np.zeros(count),
            torch.as_tensor(values[step].astype(np.float32)),
            torch.zeros(count),
        )
    rows.deciding = deciding
    buffer.compute_returns_and_advantage(torch.as_tensor(last.astype(np.float32)), ended[-1])
    return buffer


def walked(decided, rewards, elapsed_s, ended, cut_off, values, last, deciding, discount, gamma, lam):
    """Advantages of a row's decisions by the equations, NaN where there is none."""
    steps, out = len(decided), np.full(len(decided), np.nan)
    marks = [step for step in range(steps) if decided[step]]

    def outcome(start: int) -> tuple[float, float, float | None, int | None] | None:
        """R, Γ, V of what comes next (None = of a decision), and which decision that is."""
        gained, fade = 0.0, 1.0
        for step in range(start, steps):
            fade *= gamma ** elapsed_s[step]
            gained += (fade if discount == "seconds" else 1.0) * rewards[step]
            shrink = fade if discount == "seconds" else gamma
            if ended[step]:
                return gained, shrink, cut_off[step], None
            if step + 1 < steps and decided[step + 1]:
                return gained, shrink, values[step + 1], step + 1
        return (gained, shrink, last, None) if deciding else None

    for start in reversed(marks):
        found = outcome(start)
        if found is not None:
            gained, shrink, after, following = found
            more = 0.0 if following is None or np.isnan(out[following]) else out[following]
            out[start] = gained + shrink * after - values[start] + shrink * lam * more
    return out


@drawn()
@given(st.integers(0, 2**32 - 1), st.sampled_from(["seconds", "decisions"]))
def test_advantages_are_those_of_a_plain_walk(seed: int, discount: str) -> None:
    rng, steps, count = np.random.default_rng(seed), int(np.random.default_rng(seed).integers(1, 12)), 5
    ended = rng.random((steps, count)) < 0.15
    decided = rng.random((steps, count)) < 0.5
    decided[1:] |= ended[:-1]  # all decide when a mission begins
    deciding = (rng.random(count) < 0.5) | ended[-1]
    numbers = {name: rng.normal(size=(steps, count)) for name in ("rewards", "values")}
    elapsed_s = rng.uniform(0, 3, (steps, count))
    cut_off = np.where(ended & (rng.random((steps, count)) < 0.5), rng.normal(size=(steps, count)), 0.0)
    last = rng.normal(size=count)
    buffer = filled(
        decided, numbers["rewards"], elapsed_s, ended, cut_off, numbers["values"], last, deciding, discount
    )
    for row in range(count):
        expected = walked(
            decided[:, row],
            numbers["rewards"][:, row],
            elapsed_s[:, row],
            ended[:, row],
            cut_off[:, row],
            numbers["values"][:, row],
            last[row],
            deciding[row],
            discount,
            0.8,
            0.7,
        )
        assert (buffer.complete[:, row] == ~np.isnan(expected)).all()
        chosen = buffer.complete[:, row]
        assert np.allclose(buffer.advantages[chosen, row], expected[chosen], atol=1e-5)


def test_a_drive_of_two_steps_by_hand() -> None:
    """Decides, drives 1 s and 2 s, decides again: R = 0.8·1 + 0.8³·3, Γ = 0.8³; then the rollout ends."""
    column = np.array([[True], [False], [True]])
    nothing = np.zeros((3, 1))
    buffer = filled(
        column,
        np.array([[1.0], [3.0], [5.0]]),
        np.array([[1.0], [2.0], [1.0]]),
        nothing.astype(bool),
        nothing,
        np.array([[2.0], [77.0], [4.0]]),
        np.array([99.0]),
        np.array([False]),
    )
    assert buffer.complete[:, 0].tolist() == [True, False, False]
    assert buffer.advantages[0, 0] == pytest.approx(0.8 * 1 + 0.8**3 * 3 + 0.8**3 * 4 - 2)


def test_only_decisions_are_learned_from_and_each_once() -> None:
    rng = np.random.default_rng(0)
    decided = rng.random((7, 4)) < 0.4
    zeros = np.zeros((7, 4))
    buffer = filled(decided, zeros, zeros, zeros.astype(bool), zeros, zeros, np.zeros(4), np.ones(4, bool))
    assert buffer.complete.sum() == decided.sum()
    batches = list(buffer.get(3))
    assert max(len(batch.actions) for batch in batches) - min(len(batch.actions) for batch in batches) <= 1
    seen = sorted(
        (int(step), int(action) - 3)
        for batch in batches
        for step, action in zip(batch.observations[:, 0], batch.actions[:, 0], strict=True)
    )
    assert seen == sorted(zip(*np.nonzero(decided), strict=True))


def test_values_are_those_of_the_scale() -> None:
    """A critic in other units comes to the same advantages."""
    rng, shape = np.random.default_rng(1), (6, 3)
    decided, elapsed_s = rng.random(shape) < 0.6, rng.uniform(0, 2, shape)
    ended, rewards, values = rng.random(shape) < 0.2, rng.normal(size=shape), rng.normal(size=shape)
    decided[1:] |= ended[:-1]
    cut_off, last = np.where(ended, 0.3, 0.0), rng.normal(size=3)
    given = (decided, rewards, elapsed_s, ended)
    plain = filled(*given, cut_off, values, last, np.ones(3, bool))
    scale = RunningScale()
    scale.count, scale.mean, scale.variance = 10.0, np.array([3.0]), np.array([4.0])
    units = [scale.scaled(each) for each in (np.where(ended, cut_off, 3.0), values, last)]
    scaled = filled(*given, np.where(ended, units[0], 0.0), *units[1:], np.ones(3, bool), scale=scale)
    assert np.allclose(plain.advantages, scaled.advantages, atol=1e-4)
    assert scale.count == 10 + plain.complete.sum()


def test_a_reward_that_is_not_finite_stops() -> None:
    ones = np.ones((1, 2))
    with pytest.raises(NotFiniteError, match="reward = nan"):
        filled(ones > 0, ones * np.nan, ones, ones < 0, ones * 0, ones, np.ones(2), np.ones(2, bool))


@drawn()
@given(st.lists(st.integers(1, 9), min_size=1, max_size=6), st.integers(0, 1000))
def test_a_running_scale_is_the_scale_of_all(sizes: list[int], seed: int) -> None:
    rng, scale = np.random.default_rng(seed), RunningScale(3)
    parts = [rng.normal(2.0, 5.0, (size, 3)) for size in sizes]
    for part in parts:
        scale.update(part)
    whole = np.concatenate(parts)
    assert np.allclose(scale.mean, whole.mean(axis=0)) and np.allclose(scale.variance, whole.var(axis=0))
    assert np.allclose(scale.restored(scale.scaled(whole)), whole)


def test_a_scale_with_a_memory_forgets_and_a_constant_is_not_blown_up() -> None:
    scale = RunningScale(1, memory=10)
    scale.update(np.full(1000, 7.0))
    assert scale.scaled(np.array([7.0])) == 0.0 and scale.deviation == 1.0
    for _ in range(20):
        scale.update(np.full(10, -1.0))
    assert abs(scale.mean[0] + 1.0) < 1e-3
    scale.update(np.zeros((0, 1)))
    assert scale.count == 10
