"""Rollouts ask the policy where robots decide, and nothing of the other rows counts."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from baselines.command import parse
from training.ppo import Args, Run, training_scenario
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
