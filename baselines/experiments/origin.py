"""Where rows of a table come from: the git commit, whether the tree was clean, and versions of libraries."""

from __future__ import annotations

import platform
import subprocess
from dataclasses import dataclass, field
from functools import cache
from importlib import metadata
from pathlib import Path

from entropy_explore_env.errors import SettingError

_ROOT = Path(__file__).parents[2]
_CODE = ("*.py", "*.toml", "training/pretrained", "entropy_explore_env/planner/learned")
"""What has to be committed for a tree to be clean; pages and figures may differ."""
_LIBRARIES = ("numpy", "numba", "scipy")
_SHORT = 12


@dataclass(frozen=True)
class Origin:
    """What made a row.

    Attributes:
        commit: Of git, shortened; None outside a repository.
        clean: Whether all code was as it is in the commit.
        versions: Library → version.
    """

    commit: str | None = None
    clean: bool = False
    versions: dict[str, str] = field(default_factory=dict)


@cache
def this_origin() -> Origin:
    """Return the origin of what this process makes, as the tree was when it was first asked for."""
    versions = {"python": platform.python_version()}
    versions |= {name: metadata.version(name) for name in _LIBRARIES}
    commit = _git("rev-parse", f"--short={_SHORT}", "HEAD")
    changed = _git("status", "--porcelain", "--", *_CODE)
    return Origin(commit, commit is not None and changed == "", versions)


def commits_since(commit: str) -> frozenset[str]:
    """Return a commit and those up to today's that come after it, shortened as in rows.

    Raises:
        SettingError: The repository has no such commit, or this is none.
    """
    first = _git("rev-parse", "--verify", "--quiet", f"{commit}^{{commit}}")
    later = None if first is None else _git("rev-list", f"{first}..HEAD")
    if first is None or later is None:
        raise SettingError("since", commit, "a commit of this repository")
    return frozenset(name[:_SHORT] for name in (first, *later.split()))


def _git(*words: str) -> str | None:
    """Return what git says about this tree; None where it says nothing."""
    try:
        done = subprocess.run(["git", *words], cwd=_ROOT, capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return None
    return done.stdout.strip()
