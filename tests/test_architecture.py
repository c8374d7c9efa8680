"""docs/architecture.md names every folder, of a folder all modules or none, and nothing that is not there."""

from __future__ import annotations

import re
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
PACKAGES = ("entropy_explore_env", "baselines", "training", "benchmarks")
FOLDERS = (*PACKAGES, "tests")


def named_paths(page: str) -> list[str]:
    """The paths in the page's trees; a tree begins with a folder of ours, other indented blocks do not."""
    paths, folders = [], []
    for line in page.splitlines():
        entry = re.match(r"    ( *)(\w+)(/|\.py)( |$)", line)
        if entry is None:
            folders = []
            continue
        depth, name, ending = len(entry[1]) // 2, entry[2], entry[3]
        if depth == 0 and name not in FOLDERS:
            continue
        folders = [*folders[:depth], name]
        paths.append("/".join(folders) + ending)
    return paths


def test_the_page_names_every_folder_and_of_a_folder_all_modules_or_none():
    modules = {
        path.relative_to(ROOT).as_posix()
        for package in PACKAGES
        for path in (ROOT / package).rglob("*.py")
        if path.name != "__init__.py"
    }
    folders = {parent + "/" for path in modules for parent in folders_above(path)}
    named = named_paths(PAGE)
    assert len(named) == len(set(named)), "named twice"
    listed = {folder_of(path) for path in named if path.endswith(".py")}
    wanted = folders | {path for path in modules if folder_of(path) in listed}
    assert not sorted(wanted - set(named)), "docs/architecture.md lacks a line for these"
    gone = [path for path in named if not (ROOT / path).exists()]
    assert not gone, "docs/architecture.md names what is not there"


def test_no_two_files_of_tests_share_a_name():
    """pytest imports files of folders that are no packages by their names alone, and refuses the second."""
    files = (ROOT / "tests").rglob("test_*.py")
    names = Counter(path.name for path in files if not (path.parent / "__init__.py").exists())
    assert [name for name, count in names.items() if count > 1] == []


def folder_of(path: str) -> str:
    return path.rpartition("/")[0]


def folders_above(path: str) -> list[str]:
    return [parent.as_posix() for parent in Path(path).parents if parent.as_posix() != "."]


def test_lines_of_the_page_say_what_a_module_does():
    entries = re.findall(r"^ {4,}(\w+\.py) *(.*)$", PAGE, flags=re.MULTILINE)
    assert len(entries) > 100
    assert [name for name, said in entries if len(said) < 5] == []


def test_the_tree_is_read_by_its_indentation():
    page = """
    A ──► B
    other/         not ours

    training/      learning
      a.py         x
      b/           y
        c.py       z
      d.py         z
    """
    below = ["", "a.py", "b/", "b/c.py", "d.py"]
    assert named_paths(page) == [f"training/{path}" for path in below]
