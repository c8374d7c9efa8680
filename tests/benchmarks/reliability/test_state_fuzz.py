"""Saved states with a number changed, in a process of its own, where a crash is seen."""

from __future__ import annotations

import pytest

from baselines.experiments.worker_pool import run_each
from benchmarks.reliability.state_fuzz import Change, Changed, play


@pytest.mark.parametrize(
    "numbers", [range(150), pytest.param(range(20_000), marks=pytest.mark.long)], ids=len
)
def test_a_changed_state_is_refused_by_name_or_goes_on(numbers):
    tasks = [Change(number) for number in numbers]
    outcomes = [outcome for _, outcome in run_each(play, tasks, 1, limit_s=120.0, apart=True)]
    changed = [outcome for outcome in outcomes if isinstance(outcome, Changed)]
    assert [outcome.reason for outcome in outcomes if not isinstance(outcome, Changed)] == []
    assert len(changed) == len(numbers)
    refused = [outcome for outcome in changed if outcome.refused]
    assert 0.2 < len(refused) / len(changed) < 0.9
    for outcome in refused:
        assert "allowed is" in outcome.refused
