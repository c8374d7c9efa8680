"""Which sources played a case: the digest of a checkout's library, and the commits that have it.

    python -m benchmarks.reliability.sources
    python -m benchmarks.reliability.sources v1.2

print it for the checkout as it is, and for a commit.
"""

from __future__ import annotations

import hashlib
import subprocess
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path, PurePosixPath

import entropy_explore_env
from baselines.cli.arguments import Positional, parse, run_command
from entropy_explore_env.errors import SettingError

LIBRARY = "entropy_explore_env"
HOW = (
    "the first twelve digits of the SHA-256 of all files `*.py` of `entropy_explore_env`, one after the "
    "other in the order of their paths; `python -m benchmarks.reliability.sources COMMIT` prints it"
)
"""What a digest is, for the page."""


@dataclass(frozen=True)
class Args:
    """Print the digest of the library's sources.

    Attributes:
        commit: Of which commit; nothing = as they are in the checkout.
    """

    commit: Positional[str] = ""


def main(words: Sequence[str]) -> int:
    """Run the command."""
    commit = parse(Args, words).commit
    print(digest_of_commit(_root(), commit) if commit else library_digest())
    return 0


@cache
def library_digest() -> str:
    """That of the library that is imported: rows of other sources were played by other code."""
    folder = Path(entropy_explore_env.__file__).parent
    return _digest(path.read_bytes() for path in sorted(folder.rglob("*.py")))


def digest_of_commit(root: Path, commit: str) -> str:
    """That of a commit.

    Args:
        root: Of the checkout.
        commit: As git takes it.

    Raises:
        SettingError: There is no such commit.
    """
    try:
        listed = _git(root, "ls-tree", "-r", "-z", commit, "--", LIBRARY)
    except subprocess.CalledProcessError:
        raise SettingError("commit", commit, "a commit of this checkout") from None
    files = (line.split("\t", 1) for line in listed.decode().split("\0") if line.endswith(".py"))
    by_path = sorted((PurePosixPath(path), about.split()[2]) for about, path in files)
    return _digest(_content(root, name) for _, name in by_path)


def commits_of(root: Path, digests: Iterable[str], most: int = 400) -> dict[str, str]:
    """Digest → the newest commit that has it, of those that changed the library; others are left out.

    Args:
        root: Of the checkout.
        digests: Those looked for.
        most: How many commits are looked at.
    """
    missing, found = set(digests), {}
    for commit in _changes(root, most) if missing else ():
        digest = digest_of_commit(root, commit)
        if digest in missing:
            missing.remove(digest)
            found[digest] = commit
        if not missing:
            break
    return found


def _changes(root: Path, most: int) -> Iterator[str]:
    """Short names of the commits that changed the library, the newest first; none outside of git."""
    try:
        yield from _git(root, "log", f"-{most}", "--format=%h", "--", LIBRARY).decode().split()
    except (OSError, subprocess.CalledProcessError):
        return


def _digest(contents: Iterable[bytes]) -> str:
    digest = hashlib.sha256()
    for content in contents:
        digest.update(content)
    return digest.hexdigest()[:12]


@cache
def _content(root: Path, name: str) -> bytes:
    return _git(root, "cat-file", "blob", name)


def _git(root: Path, *words: str) -> bytes:
    return subprocess.run(["git", *words], cwd=root, check=True, capture_output=True).stdout


def _root() -> Path:
    return Path(entropy_explore_env.__file__).parents[1]


if __name__ == "__main__":
    raise SystemExit(run_command(main))
