"""The README's examples run as they stand there, and what it names is there."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")
EXAMPLES = re.findall(r"```python\n(.*?)```", README, flags=re.DOTALL)


def test_there_is_an_example_for_each_interface():
    assert len(EXAMPLES) == 6
    assert "parallel_env" in EXAMPLES[0]
    assert "gymnasium.make(" in EXAMPLES[1]
    assert "gymnasium.make_vec(" in EXAMPLES[2]
    assert "reward_function=" in EXAMPLES[3]
    assert "RobotKind(" in EXAMPLES[4]
    assert "world=world" in EXAMPLES[5]


NAMES = ("pettingzoo", "gymnasium", "vector", "reward", "mixed", "world")


@pytest.mark.parametrize("example", EXAMPLES, ids=NAMES)
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


def rows_of(text: str) -> list[str]:
    """The rows of all Markdown tables, without their heads' rules."""
    return [line for line in text.splitlines() if line.startswith("| ") and not line.startswith("| ---")]


@pytest.mark.parametrize(
    ("heading", "report", "rows"),
    [
        ("Rocha04, reproduced", "rocha04", 10),
        ("RochaMI, reproduced", "rochami", 10),
        ("Bhattacharya, reproduced", "bhattacharya", 10),
        ("Sawhney, reproduced", "sawhney", 10),
        ("Speed", "speed", 15),
        ("Strategies head to head", "head-to-head", 10),
        ("A policy that learns", "ppo", 8),
    ],
)
def test_tables_are_those_of_the_reports(heading, report, rows):
    section = README.split(f"## {heading}\n")[1].split("\n## ")[0].split("\n### ")[0]
    written = set(rows_of((ROOT / "docs" / "results" / f"{report}.md").read_text(encoding="utf-8")))
    shown = rows_of(section)
    assert len(shown) >= rows
    assert [row for row in shown if row not in written] == []


def test_no_placeholder_is_left():
    assert "RESULTS_" not in README
