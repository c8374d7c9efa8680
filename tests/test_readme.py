"""The README stays short, and what it names and shows is there. Its example runs in tests/test_site.py."""

import json
import re

import pytest

from entropy_explore_env.planner.weights import SHIPPED
from tests.code_blocks import PAGES, ROOT

README = (ROOT / "README.md").read_text(encoding="utf-8")


def test_it_is_one_screen_and_some_links():
    assert len(README.splitlines()) <= 150
    assert len(README) <= 9000


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_links_and_pictures_exist(page):
    text = page.read_text(encoding="utf-8")
    links = re.findall(r"\]\(([^)#\s]+)[^)]*\)", re.sub(r"```.*?```", "", text, flags=re.DOTALL))
    missing = [link for link in links if "://" not in link and not (page.parent / link).exists()]
    assert not [link for link in missing if page.name != "changelog.md"]


def rows_of(text: str) -> list[dict[str, str]]:
    """The rows of all Markdown tables: head of the column → cell."""
    rows, heads = [], []
    lines = text.splitlines()
    for line, after in zip(lines, [*lines[1:], ""], strict=True):
        if not line.startswith("| ") or line.startswith("| ---"):
            continue
        cells = [cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]]
        if after.startswith("| ---"):
            heads = cells
        else:
            rows.append(dict(zip(heads, cells, strict=True)))
    return rows


def test_the_scoreboard_is_of_the_page_that_it_links():
    section = (ROOT / "docs" / "index.md").read_text("utf-8").split("## A result\n")[1]
    written = [set(row.items()) for row in rows_of((ROOT / "docs/results/scoreboard.md").read_text("utf-8"))]
    shown = rows_of(section)
    assert len(shown) == 6 and all(len(row) >= 4 for row in shown)
    assert [row for row in shown if not any(set(row.items()) <= each for each in written)] == []
    assert shown[0]["strategy"] == "`planned-rate`"
    low_to_high = next(cell for head, cell in shown[0].items() if head.startswith("time"))
    assert low_to_high.replace(" (", "\n(") in README


def test_the_addresses_are_those_of_the_project():
    project = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    (repository,) = re.findall(r'^Repository = "(.*)"$', project, flags=re.MULTILINE)
    assert f"git clone {repository}\n" in README
    assert f"pip install git+{repository}\n" in README
    (documentation,) = re.findall(r'^Documentation = "(.*)"$', project, flags=re.MULTILINE)
    owner, name = repository.removeprefix("https://github.com/").split("/")
    assert documentation == f"https://{owner}.github.io/{name}/"  # where docs.yml publishes the site


def test_the_model_card_tells_of_every_policy_what_its_file_says():
    page = (ROOT / "docs" / "model_card.md").read_text(encoding="utf-8")
    folders = [path.parent for path in (ROOT / "training" / "pretrained").glob("*/policy.json")]
    assert folders
    for folder in folders:
        told = page.split(f"## {folder.name}\n")[1].split("\n## ")[0]
        progress = json.loads((folder / "policy.json").read_text(encoding="utf-8"))["progress"]
        assert f"{progress['steps']:,} robot-steps" in told
        assert f"{progress['validation']['median_s']:g} s" in told
    for file in SHIPPED.glob("*.json"):
        told = page.split(f"## {file.stem}\n")[1].split("\n## ")[0]
        assert file.relative_to(ROOT).as_posix() in told
