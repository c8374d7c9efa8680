"""The suite runs on systems without POSIX, too: no module needs one of its parts in order to be imported."""

from __future__ import annotations

import ast

import pytest

from tests.code_blocks import ROOT

POSIX_ONLY = {"crypt", "fcntl", "grp", "pty", "pwd", "resource", "syslog", "termios", "tty"}
FOLDERS = ("baselines", "benchmarks", "docs", "entropy_explore_env", "tests", "training")


def imported_at_once(tree: ast.Module) -> set[str]:
    """The packages that a module imports wherever it is imported itself."""
    names = set()
    for node in tree.body:
        if isinstance(node, ast.Import):
            names |= {alias.name.partition(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module is not None and not node.level:
            names.add(node.module.partition(".")[0])
    return names


@pytest.mark.parametrize("folder", FOLDERS)
def test_no_module_needs_posix_to_be_imported(folder):
    files = sorted((ROOT / folder).rglob("*.py"))
    trees = [(path, ast.parse(path.read_text(encoding="utf-8"))) for path in files]
    assert trees
    assert [str(path) for path, tree in trees if imported_at_once(tree) & POSIX_ONLY] == []


def test_what_is_looked_for_would_be_found():
    assert imported_at_once(ast.parse("import os, fcntl\nfrom resource import getrlimit\n")) >= {
        "fcntl",
        "resource",
    }
