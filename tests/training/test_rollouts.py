"""Rollouts ask the policy where robots decide, and nothing of busy robots counts."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from stable_baselines3 import PPO

from training.advantages import DecisionBuffer
from training.ppo import DecisionPPO, parsed, set_up, training_task
from training.resuming import TrainingState
from training.seeds import learning_seeds

STEPS = 64
TINY = (
    f"--scenario box-7x11x5 --robots 2 --missions 3 --threads 1 --rollout-steps {STEPS} --hidden 8 8 "
    "--validation-missions 1 --time-limit-s 30"
).split()


def new_run(words: list[str]) -> TrainingState:
    """A run before its first rollout."""
    args = parsed([*TINY, *words])
    return set_up(args, training_task(args))


def collect(run: TrainingState) -> None:
    """One rollout."""
    _, callback = run.model._setup_learn(1, None)
    assert run.model.collect_rollouts(run.envs, callback, run.buffer, STEPS)


def spoil(rows: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Busy rows do something else and observe nothing that is a number."""
    step, chance = rows.step_wait, np.random.default_rng(0)

    def spoiled() -> tuple[Any, ...]:
        busy, actions = ~rows.deciding, rows._actions
        if actions.dtype.kind == "f":
            actions[busy] = chance.uniform(-1.0, 1.0, actions[busy].shape)
        else:
            actions[busy] = chance.integers(0, rows.action_space.n, busy.sum())
        observations, *rest = step()
        return np.where(rows.deciding[:, None], observations, np.nan).astype(np.float32), *rest

    monkeypatch.setattr(rows, "step_wait", spoiled)


@pytest.mark.parametrize("words", ["", "--features vector", "--features vector --actions continuous"])
def test_busy_rows_change_nothing_and_decisions_are_the_policy_s(
    monkeypatch: pytest.MonkeyPatch, words: str
) -> None:
    run = new_run(words.split())
    collect(run)
    other = new_run(words.split())
    spoil(other.envs, monkeypatch)
    collect(other)
    plain, spoiled = run.buffer, other.buffer
    decided = plain.steps.decided
    assert 0.0 < decided.mean() < 0.9 and plain.steps.ended.any() and plain.steps.final_values.any()
    assert np.array_equal(plain.complete, spoiled.complete)
    for name in ("decided", "ended", "rewards", "final_values"):
        assert np.array_equal(getattr(plain.steps, name), getattr(spoiled.steps, name)), name
    for name in ("observations", "actions", "values", "log_probs", "advantages"):
        assert np.array_equal(getattr(plain, name)[decided], getattr(spoiled, name)[decided]), name
    assert not plain.actions[~decided].any() and not plain.log_probs[~decided].any()
    chosen = torch.as_tensor(plain.actions[decided])
    with torch.no_grad():
        values, log_probs, _ = run.model.policy.evaluate_actions(
            torch.as_tensor(plain.observations[decided]), chosen if "continuous" in words else chosen[:, 0]
        )
    assert np.allclose(log_probs, plain.log_probs[decided], atol=1e-4)
    assert np.allclose(values[:, 0], plain.return_stats.denormalise(plain.values)[decided], atol=1e-4)


def test_where_all_decide_rollouts_are_those_of_stable_baselines3() -> None:
    """One robot waits for nobody: every row decides, and what is drawn and valued is what PPO draws."""
    words = ["--robots", "1"]
    run = new_run(words)
    collect(run)
    other = new_run(words)
    _, callback = other.model._setup_learn(1, None)
    bootstrapped = []

    def add_step(final_values: Any, *step: Any) -> None:
        DecisionBuffer.add_step(other.buffer, final_values, *step)

    def add(obs: Any, action: Any, reward: np.ndarray, *rest: Any) -> None:
        bootstrapped.append((reward - other.envs.rewards.astype(np.float32)) / other.model.gamma)
        other.buffer.add = DecisionBuffer.add.__get__(other.buffer)
        add_step(np.zeros(len(reward)), obs, action, reward, *rest)
        other.buffer.add = add  # pyright: ignore[reportAttributeAccessIssue]

    other.buffer.add = add  # pyright: ignore[reportAttributeAccessIssue]
    PPO.collect_rollouts(other.model, other.envs, callback, other.buffer, STEPS)
    ours, theirs = run.buffer, other.buffer
    assert ours.steps.decided.all() and ours.steps.ended.any()
    for name in ("observations", "actions"):
        assert np.array_equal(getattr(ours, name), getattr(theirs, name)), name
    for name in ("ended", "rewards"):
        assert np.array_equal(getattr(ours.steps, name), getattr(theirs.steps, name)), name
    assert np.allclose(ours.log_probs, theirs.log_probs, atol=1e-5)
    values = [each.return_stats.denormalise(each.values) for each in (ours, theirs)]
    assert np.allclose(*values, atol=1e-4)
    final_values = ours.steps.final_values
    assert final_values.any() and np.allclose(final_values, bootstrapped, atol=1e-4)


def test_missions_to_learn_from_have_the_seeds_for_learning() -> None:
    run = new_run(["--seed", "3"])
    run.model._setup_learn(1, None)
    assert list(run.envs.vector_env.missions.seeds) == learning_seeds(3, 3)


def test_stable_baselines3_saves_the_trainer_without_its_missions(tmp_path: Path) -> None:
    run = new_run([])
    collect(run)
    run.model.save(tmp_path / "model.zip")
    again = DecisionPPO.load(tmp_path / "model.zip", device="cpu")
    seen = run.buffer.observations[:, 0]
    assert np.array_equal(
        run.model.predict(seen, deterministic=True)[0], again.predict(seen, deterministic=True)[0]
    )
