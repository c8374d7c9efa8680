"""Sweeps and trainers that are killed."""

from __future__ import annotations

import random

import pytest

from benchmarks.proofs import kills
from tests.systems import needs_posix

pytestmark = needs_posix


def test_a_few_kills_of_a_trainer(tmp_path, monkeypatch):
    monkeypatch.setattr(kills, "KILLS", 3)
    assert kills.kill_trainer(tmp_path / "run", random.Random(0)) >= 3


@pytest.mark.long
def test_kills_of_a_sweep(tmp_path):
    assert len(kills.kill_sweep(tmp_path / "sweep", random.Random(0))) == kills.KILLS
