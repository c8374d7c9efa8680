"""docs/architecture.md names folders that exist, and test files have names of their own."""

from __future__ import annotations

import re
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).parents[1]
PACKAGES = ("entropy_explore_env", "baselines", "training", "benchmarks")


def folders_in(page: str) -> list[str]:
    """Return the folders in a page's tree, whose depth is told by the indentation."""
    folders: list[str] = []
    found = []
    for spaces, name in re.findall(r"^    ( *)(\w+)/ ", page, flags=re.MULTILINE):
        folders = [*folders[: len(spaces) // 2], name]
        found.append("/".join(folders))
    return found


def test_the_page_names_every_room_and_none_that_is_not_there():
    named = folders_in((ROOT / "docs" / "architecture.md").read_text("utf-8"))
    assert [folder for folder in named if not (ROOT / folder).is_dir()] == []
    rooms = {path.parent for package in PACKAGES for path in (ROOT / package).glob("*/__init__.py")}
    assert {path.relative_to(ROOT).as_posix() for path in rooms} <= set(named)


def test_no_two_files_of_tests_share_a_name():
    """pytest imports files of folders that are no packages by their names alone, and refuses the second."""
    files = (ROOT / "tests").rglob("test_*.py")
    names = Counter(path.name for path in files if not (path.parent / "__init__.py").exists())
    assert [name for name, count in names.items() if count > 1] == []
