"""The examples for other trainers run, and docs/training.md shows them as they are."""

import re
import runpy
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "training.md").read_text(encoding="utf-8")
EXAMPLES = ROOT / "training" / "examples"


def test_the_page_shows_the_files():
    shown = re.findall(r"```python\n(.*?)```", PAGE, flags=re.DOTALL)
    files = [path.read_text(encoding="utf-8") for path in EXAMPLES.glob("[a-z]*.py")]
    assert sorted(shown) == sorted(files) and len(shown) == 2


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


def test_links_of_the_page_exist():
    for link in re.findall(r"\]\(([^)#]+)\)", PAGE):
        assert "://" in link or (ROOT / "docs" / link).exists(), link
