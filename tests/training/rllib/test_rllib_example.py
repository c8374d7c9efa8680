"""The tutorial's example with RLlib trains."""

import runpy
import sys
from pathlib import Path

import pytest

pytest.importorskip("ray.rllib", reason="ray[rllib] is not installed: make test-rllib")

EXAMPLE = Path(__file__).parents[3] / "training" / "examples" / "rllib_adapter.py"


@pytest.mark.filterwarnings("ignore")  # RLlib's own
@pytest.mark.parametrize("words", [[], ["candidates"]])
def test_the_example_trains(words, monkeypatch):
    monkeypatch.setattr(sys, "argv", ["rllib_adapter.py", *words])
    ran = runpy.run_path(str(EXAMPLE), run_name="__main__")
    assert ran["result"]["env_runners"]["num_env_steps_sampled"] >= 256
