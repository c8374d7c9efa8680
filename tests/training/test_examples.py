"""The examples for other trainers do what they say, and pages show all of them."""

import re
import runpy
from pathlib import Path

import pytest

from tests.code_blocks import shown_files

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "training" / "examples"


def test_pages_show_the_files():
    files = set(EXAMPLES.glob("[a-z]*.py"))
    assert files <= set(shown_files()) and len(files) > 2


@pytest.mark.filterwarnings("ignore")  # TorchRL's and PettingZoo's own
def test_torchrl_rolls_out(capsys):
    pytest.importorskip("torchrl", reason="torchrl is not installed")
    runpy.run_path(str(EXAMPLES / "torchrl_wrapper.py"))
    said = capsys.readouterr().out
    assert re.search(r"Size\(\[100, 3, 144\]\) torch.Size\(\[100, 3, 1\]\) tensor\((\d+)\)", said), said


def test_a_loop_in_cleanrl_s_form_stores_choices(capsys):
    pytest.importorskip("torch", reason="torch is not installed")
    stored = runpy.run_path(str(EXAMPLES / "cleanrl_loop.py"))["rollout"]
    assert len(stored) == 64 and "choices to learn from" in capsys.readouterr().out
    chosen = sum(int(one[2].sum()) for one in stored)
    assert 0 < chosen < 64 * 4 * 3  # robots are busy most of the time
    masked = [one[1] for one in stored]
    assert masked[0].shape == (4, 3)
