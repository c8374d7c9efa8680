"""Rollouts ask the policy where robots decide, and nothing of the other rows counts."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from stable_baselines3 import PPO

from baselines.cli.arguments import parse
from training.collecting import DecisionPPO
from training.decisions import DecisionBuffer
from training.ppo import Args, Run, training_scenario
from training.seeds import learning_seeds
from training.terminal import TrainingBar

TINY = (
    "--scenario box-7x11x5 --robots 2 --missions 3 --threads 1 --rollout-steps 64 --hidden 8 8 "
    "--validation-missions 1 --time-limit-s 30"
).split()


def new_run(out: Path, words: list[str]) -> Run:
    """A run before its first rollout."""
    args = parse(Args, [*TINY, *words, "--out", str(out / "run")])
    return Run(args, training_scenario(args), TrainingBar(1, hidden=True))


def collect(run: Run) -> None:
    """One rollout."""
    _, callback = run.model._setup_learn(1, None)
    assert run.model.collect_rollouts(run.rows, callback, run.buffer, run.args.rollout_steps)


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
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: str
) -> None:
    run = new_run(tmp_path, words.split())
    collect(run)
    other = new_run(tmp_path, words.split())
    spoil(other.rows, monkeypatch)
    collect(other)
    plain, spoiled = run.buffer, other.buffer
    decided = plain.decided
    assert 0.0 < decided.mean() < 0.9 and plain.ended.any() and plain.beyond.any()
    for name in ("decided", "complete", "gained", "beyond"):
        assert np.array_equal(getattr(plain, name), getattr(spoiled, name)), name
    for name in ("observations", "actions", "values", "log_probs", "advantages"):
        assert np.array_equal(getattr(plain, name)[decided], getattr(spoiled, name)[decided]), name
    assert not plain.actions[~decided].any() and not plain.log_probs[~decided].any()
    chosen = torch.as_tensor(plain.actions[decided])
    with torch.no_grad():
        values, log_probs, _ = run.model.policy.evaluate_actions(
            torch.as_tensor(plain.observations[decided]), chosen if "continuous" in words else chosen[:, 0]
        )
    assert np.allclose(log_probs, plain.log_probs[decided], atol=1e-4)
    assert np.allclose(values[:, 0], run.returns.restored(plain.values)[decided], atol=1e-4)


def test_where_all_decide_rollouts_are_those_of_stable_baselines3(tmp_path: Path) -> None:
    """One robot waits for nobody: every row decides, and what is drawn and valued is what PPO draws."""
    words = ["--robots", "1"]
    run = new_run(tmp_path, words)
    collect(run)
    other = new_run(tmp_path, words)
    _, callback = other.model._setup_learn(1, None)
    bootstrapped = []

    def add_step(beyond: Any, *step: Any) -> None:
        DecisionBuffer.add_step(other.buffer, beyond, *step)

    def add(obs: Any, action: Any, reward: np.ndarray, *rest: Any) -> None:
        bootstrapped.append((reward - other.rows.rewards.astype(np.float32)) / other.model.gamma)
        other.buffer.add = DecisionBuffer.add.__get__(other.buffer)
        add_step(np.zeros(len(reward)), obs, action, reward, *rest)
        other.buffer.add = add  # pyright: ignore[reportAttributeAccessIssue]

    other.buffer.add = add  # pyright: ignore[reportAttributeAccessIssue]
    PPO.collect_rollouts(other.model, other.rows, callback, other.buffer, other.args.rollout_steps)
    ours, theirs = run.buffer, other.buffer
    assert ours.decided.all() and ours.ended.any()
    for name in ("observations", "actions", "ended", "gained"):
        assert np.array_equal(getattr(ours, name), getattr(theirs, name)), name
    assert np.allclose(ours.log_probs, theirs.log_probs, atol=1e-5)
    values = [each.returns.restored(each.buffer.values) for each in (run, other)]
    assert np.allclose(*values, atol=1e-4)
    assert ours.beyond.any() and np.allclose(ours.beyond, bootstrapped, atol=1e-4)


def test_missions_to_learn_from_have_the_seeds_for_learning(tmp_path: Path) -> None:
    run = new_run(tmp_path, ["--seed", "3"])
    run.model._setup_learn(1, None)
    assert list(run.rows.vector_env.missions.seeds) == learning_seeds(3, 3)


def test_stable_baselines3_saves_the_trainer_without_its_missions(tmp_path: Path) -> None:
    run = new_run(tmp_path, [])
    collect(run)
    run.model.save(tmp_path / "model.zip")
    again = DecisionPPO.load(tmp_path / "model.zip", device="cpu")
    seen = run.buffer.observations[: run.args.missions, 0]
    assert np.array_equal(
        run.model.predict(seen, deterministic=True)[0], again.predict(seen, deterministic=True)[0]
    )
