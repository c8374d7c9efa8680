"""Origin and licence of every bundled file: the page has a row for each that is neither code nor text."""

from __future__ import annotations

import fnmatch
import re
import subprocess
from pathlib import PurePosixPath

import pytest

from tests.code_blocks import DOCS, ROOT

CODE_AND_TEXT = {".cff", ".cfg", ".css", ".j2", ".md", ".py", ".toml", ".txt", ".typed", ".yml"}
NAMES = {".ci/run", ".gitignore", "LICENSE", "Makefile"}
ROWS = re.compile(r"^\| (`.*?) \|", re.MULTILINE)


def patterns() -> list[str]:
    """Of the page's first column, written out: a name without a folder lies in that of the one before it."""
    found = []
    for row in ROWS.findall((DOCS / "bundled_files.md").read_text(encoding="utf-8")):
        folder = PurePosixPath()
        for name in re.findall(r"`([^`]+)`", row):
            path = PurePosixPath(name)
            folder = path.parent if len(path.parts) > 1 else folder
            found.append(
                (path if len(path.parts) > 1 else folder / path).as_posix() + "/*" * name.endswith("/")
            )
    return found


def bundled() -> list[str]:
    """What is in the repository and is neither code nor text."""
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=False)
    files = [PurePosixPath(name) for name in listed.stdout.splitlines()]
    return [
        path.as_posix() for path in files if path.suffix not in CODE_AND_TEXT and path.as_posix() not in NAMES
    ]


def test_every_bundled_file_has_a_row():
    files = bundled()
    if not files:
        pytest.skip("not a git checkout")
    assert [name for name in files if not any(fnmatch.fnmatch(name, each) for each in patterns())] == []


def test_every_row_is_of_files_that_are_there():
    assert len(patterns()) > 10
    assert [each for each in patterns() if not [*ROOT.glob(each.removesuffix("/*"))]] == []
