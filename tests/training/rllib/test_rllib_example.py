"""The tutorial's example with RLlib trains."""

from __future__ import annotations

import runpy
from pathlib import Path

import pytest

pytest.importorskip("ray.rllib", reason="ray[rllib] is not installed: make test-rllib")

EXAMPLE = Path(__file__).parents[3] / "training" / "examples" / "rllib_adapter.py"


@pytest.mark.filterwarnings("ignore")  # RLlib's own
def test_the_example_trains():
    ran = runpy.run_path(str(EXAMPLE), run_name="__main__")
    assert ran["result"]["env_runners"]["num_env_steps_sampled"] >= 256
