"""Advantages of decisions, against a plain walk through each robot's steps, and running means."""

from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import pytest
import torch
from gymnasium import spaces
from hypothesis import given
from hypothesis import strategies as st

from entropy_explore_env.errors import SettingError
from tests.reference.scenes import drawn
from training.advantages import DecisionBuffer, Discounting, Normaliser, Steps, decision_advantages
from training.checkpoints import CheckpointError

SPACE = spaces.Box(-1.0, 1.0, (2,), np.float32)
GAMMA, LAMBDA = 0.8, 0.7


class Rollout(NamedTuple):
    """Steps (T, N), values (T, N) and after them (N,), and who decides then (N,)."""

    steps: Steps
    values: np.ndarray
    last_values: np.ndarray
    deciding: np.ndarray


def drawn_rollout(rng: np.random.Generator, steps: int, robots: int) -> Rollout:
    """Robots that are busy half of the time, missions of some seven steps, half of which are cut off."""
    shape = (steps, robots)
    ended, decided = rng.random(shape) < 0.15, rng.random(shape) < 0.5
    decided[1:] |= ended[:-1]  # all decide when a mission begins
    cut_off = ended & (rng.random(shape) < 0.5)
    return Rollout(
        Steps(
            decided,
            ended,
            rng.uniform(0, 3, shape),
            rng.normal(size=shape),
            np.where(cut_off, rng.normal(size=shape), 0.0),
        ),
        rng.normal(size=shape),
        rng.normal(size=robots),
        (rng.random(robots) < 0.5) | ended[-1],
    )


def filled(rollout: Rollout, stats: Normaliser | None = None) -> DecisionBuffer:
    """A buffer of these steps; the critic gave the rollout's values in units of `stats`."""
    steps, values, last_values, deciding = rollout
    count, robots = values.shape
    envs: Any = SimpleNamespace()
    stats = stats or Normaliser()
    buffer = DecisionBuffer(
        count,
        SPACE,
        spaces.Discrete(9),
        gamma=GAMMA,
        gae_lambda=LAMBDA,
        n_envs=robots,
        envs=envs,
        discount="seconds",
        return_stats=stats,
        rng=np.random.default_rng(0),
    )
    for step in range(count):
        envs.decided, envs.ended = steps.decided[step], steps.ended[step]
        envs.elapsed_s, envs.rewards = steps.elapsed_s[step], steps.rewards[step]
        final = steps.final_values[step]
        buffer.add_step(
            np.where(final != 0.0, stats.normalise(final), 0.0),
            np.full((robots, 2), step, np.float32),
            np.arange(robots) + 3,
            steps.rewards[step],
            np.zeros(robots),
            torch.as_tensor(stats.normalise(values[step]).astype(np.float32)),
            torch.zeros(robots),
        )
    envs.deciding = deciding
    last = torch.as_tensor(stats.normalise(last_values).astype(np.float32))
    buffer.compute_returns_and_advantage(last, steps.ended[-1])
    return buffer


def walked(rollout: Rollout, robot: int, unit: str) -> np.ndarray:
    """Advantages of a robot's decisions by the equations, NaN where there is none."""
    steps, values = rollout.steps, rollout.values[:, robot]
    decided, ended = steps.decided[:, robot], steps.ended[:, robot]
    advantages = np.full(len(values), np.nan)

    def outcome(start: int) -> tuple[float, float, float, int | None] | None:
        """R, Γ, V of what comes next, and the step of the next decision if the rollout has it."""
        gained, decay = 0.0, 1.0
        for step in range(start, len(values)):
            decay *= GAMMA ** steps.elapsed_s[step, robot]
            gained += (decay if unit == "seconds" else 1.0) * steps.rewards[step, robot]
            discount = decay if unit == "seconds" else GAMMA
            if ended[step]:
                return gained, discount, steps.final_values[step, robot], None
            if step + 1 < len(values) and decided[step + 1]:
                return gained, discount, values[step + 1], step + 1
        last = rollout.last_values[robot]
        return (gained, discount, last, None) if rollout.deciding[robot] else None

    for start in reversed(np.flatnonzero(decided)):
        result = outcome(int(start))
        if result is not None:
            gained, discount, value, following = result
            later = 0.0 if following is None or np.isnan(advantages[following]) else advantages[following]
            advantages[start] = gained + discount * value - values[start] + discount * LAMBDA * later
    return advantages


@drawn()
@given(st.integers(0, 2**32 - 1), st.integers(1, 11), st.sampled_from(["seconds", "decisions"]))
def test_advantages_are_those_of_a_plain_walk(seed: int, count: int, unit: Any) -> None:
    rollout = drawn_rollout(np.random.default_rng(seed), count, robots=5)
    advantages, complete = decision_advantages(*rollout, Discounting(GAMMA, LAMBDA, unit))
    expected = np.stack([walked(rollout, robot, unit) for robot in range(5)], axis=1)
    assert (complete == ~np.isnan(expected)).all()
    assert np.allclose(advantages, np.where(complete, expected, 0.0))


def test_a_drive_of_two_steps_by_hand() -> None:
    """Decides, drives 1 s and 2 s, decides again: R = 0.8·1 + 0.8³·3, Γ = 0.8³; then the rollout ends."""
    steps = Steps.empty(3, 1)
    steps.decided[[0, 2]] = True
    steps.rewards[:, 0], steps.elapsed_s[:, 0] = (1.0, 3.0, 5.0), (1.0, 2.0, 1.0)
    values = np.array([[2.0], [77.0], [4.0]])
    advantages, complete = decision_advantages(
        steps, values, np.array([99.0]), np.array([False]), Discounting(0.8, 0.7, "seconds")
    )
    assert complete[:, 0].tolist() == [True, False, False]
    assert advantages[0, 0] == pytest.approx(0.8 * 1 + 0.8**3 * 3 + 0.8**3 * 4 - 2)


def test_only_decisions_are_learned_from_and_each_once() -> None:
    steps = Steps.empty(7, 4)
    steps.decided[:] = np.random.default_rng(0).random((7, 4)) < 0.4
    buffer = filled(Rollout(steps, np.zeros((7, 4)), np.zeros(4), np.ones(4, bool)))
    assert buffer.complete.sum() == steps.decided.sum()
    batches = list(buffer.get(3))
    assert max(len(batch.actions) for batch in batches) - min(len(batch.actions) for batch in batches) <= 1
    seen = sorted(
        (int(step), int(action) - 3)
        for batch in batches
        for step, action in zip(batch.observations[:, 0], batch.actions[:, 0], strict=True)
    )
    assert seen == sorted(zip(*np.nonzero(steps.decided), strict=True))


def test_a_rollout_in_which_no_robot_decides_twice_is_named() -> None:
    nobody = filled(Rollout(Steps.empty(2, 3), np.zeros((2, 3)), np.zeros(3), np.ones(3, bool)))
    with pytest.raises(SettingError, match=r"rollout_steps = 2: .*decides twice"):
        list(nobody.get(3))


def test_values_are_in_units_of_the_returns() -> None:
    """A critic in other units comes to the same advantages, and learns returns in its units."""
    rollout, rng = drawn_rollout(np.random.default_rng(1), 6, 3), np.random.default_rng(2)
    plain, stats = filled(rollout), Normaliser()
    stats.update(rng.normal(3.0, 2.0, 10))
    other = filled(rollout, stats)
    assert plain.complete.sum() > 5 and np.allclose(plain.advantages, other.advantages, atol=1e-4)
    assert stats.count == 10 + plain.complete.sum()
    returns = (plain.advantages + rollout.values)[plain.complete]
    assert np.allclose(stats.denormalise(other.returns[plain.complete]), returns, atol=1e-4)


@drawn()
@given(st.lists(st.integers(1, 9), min_size=1, max_size=6), st.integers(0, 1000))
def test_mean_and_deviation_are_those_of_all_samples(sizes: list[int], seed: int) -> None:
    rng, stats = np.random.default_rng(seed), Normaliser(3)
    parts = [rng.normal(2.0, 5.0, (size, 3)) for size in sizes]
    for part in parts:
        stats.update(part)
    whole = np.concatenate(parts)
    assert np.allclose(stats.mean, whole.mean(axis=0)) and np.allclose(stats.var, whole.var(axis=0))
    assert np.allclose(stats.denormalise(stats.normalise(whole)), whole)


def test_with_a_memory_old_samples_fade_and_a_constant_is_not_blown_up() -> None:
    stats = Normaliser(1, memory=10)
    stats.update(np.full(1000, 7.0))
    assert stats.normalise(np.array([7.0])) == 0.0 and stats.std == 1.0
    for _ in range(20):
        stats.update(np.full(10, -1.0))
    assert abs(stats.mean[0] + 1.0) < 1e-3
    stats.update(np.zeros((0, 1)))
    assert stats.count == 10


def test_arrays_come_back_and_what_does_not_fit_changes_nothing() -> None:
    stats, again = Normaliser(3), Normaliser(3)
    stats.update(np.random.default_rng(0).normal(2.0, 5.0, (7, 3)))
    kept = stats.arrays("observations")
    again.load_arrays("observations", kept)
    assert again.count == 7 and (again.mean == stats.mean).all() and (again.var == stats.var).all()
    for broken in ({"observations_variance": np.ones(2)}, {"observations_mean": np.full(3, np.nan)}):
        with pytest.raises(CheckpointError, match=r"observations_.*finite float64"):
            again.load_arrays("observations", kept | {"observations_count": np.array(1.0)} | broken)
        assert again.count == 7 and (again.mean == stats.mean).all()
