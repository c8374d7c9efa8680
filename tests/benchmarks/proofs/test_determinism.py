"""Digests of drawn scenarios depend on nothing but their numbers."""

from __future__ import annotations

import pytest

from benchmarks.proofs import determinism
from benchmarks.proofs.cases import BrokenPromiseError
from benchmarks.proofs.drawn_scenarios import first_allowed


def test_scenarios_whose_actions_are_candidates_are_played():
    """Their numbers go as far as there are candidates."""
    for number in range(40):
        drawn, _ = first_allowed(number, few_kernels=True)
        if drawn.scenario.action.kind == "candidates":
            break
    assert len({determinism.digest_of(number, 1, missions) for missions in (1, 2)}) == 1


def test_a_digest_does_not_depend_on_threads_or_company():
    digests = {determinism.digest_of(3, threads, missions) for threads in (1, 2) for missions in (1, 3)}
    assert len(digests) == 1 != len({determinism.digest_of(number, 1, 1) for number in (3, 5)})


@pytest.mark.long
def test_a_case_compares_two_processes(monkeypatch):
    monkeypatch.setattr(determinism, "SCENARIOS_EACH", 2)
    assert determinism.play(0).figures == {"plays of a scenario compared": 2}


def test_a_state_that_differs_is_told(monkeypatch):
    plain = {False: ["a", "b"], True: ["a", "c"]}
    monkeypatch.setattr(determinism, "_digests", lambda first, variant: plain[variant != ("", 1, 1)])
    with pytest.raises(BrokenPromiseError, match=r"scenarios \[11\] end in another state in \('', 2, 1\)"):
        determinism.play(determinism.VARIANTS + 1)
