"""The README's examples run as they stand there, and what it names is there."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")
EXAMPLES = re.findall(r"```python\n(.*?)```", README, flags=re.DOTALL)


def test_there_is_an_example_for_each_interface():
    assert len(EXAMPLES) == 3
    assert "parallel_env" in EXAMPLES[0]
    assert "gymnasium.make(" in EXAMPLES[1]
    assert "gymnasium.make_vec(" in EXAMPLES[2]


@pytest.mark.parametrize("example", EXAMPLES, ids=["pettingzoo", "gymnasium", "vector"])
def test_example_runs(example, capsys):
    exec(compile(example, "README.md", "exec"), {})  # the README is ours
    assert capsys.readouterr().out


def test_links_and_pictures_exist():
    links = re.findall(r"\]\(([^)#]+)\)", README)
    missing = [link for link in links if "://" not in link and not (ROOT / link).exists()]
    assert not missing


def test_commands_exist():
    modules = set(re.findall(r"python -m ([\w.]+)", README))
    assert "baselines.run" in modules
    for module in modules:
        path = ROOT / Path(*module.split("."))
        assert path.with_suffix(".py").exists() or (path / "__main__.py").exists()


def test_no_placeholder_is_left():
    assert "RESULTS_" not in README
