"""Saved states with a number changed, in a process of its own, where a crash is seen."""

from __future__ import annotations

from benchmarks.proofs.cases import Found, play_cases
from benchmarks.proofs.states import change, play


def test_a_changed_state_is_refused_by_name_or_goes_on():
    numbers = range(150)
    outcomes = [outcome for _, outcome in play_cases(play, numbers, 120.0)]
    assert [outcome for outcome in outcomes if not isinstance(outcome, Found)] == []
    refused = sum(outcome.figures["refused"] for outcome in outcomes if isinstance(outcome, Found))
    assert 0.2 < refused / len(numbers) < 0.9


def test_a_refusal_names_the_number():
    refused = [said for what, said in map(change, range(12)) if said]
    assert refused and all("expected" in said for said in refused)
