"""Sweeps that are killed."""

from __future__ import annotations

import random

import pytest

from benchmarks.proofs import kills
from tests.systems import needs_posix

pytestmark = needs_posix


@pytest.mark.long
def test_kills_of_a_sweep(tmp_path):
    assert len(kills.kill_sweep(tmp_path / "sweep", random.Random(0))) == kills.KILLS
