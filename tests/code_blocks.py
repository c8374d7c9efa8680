"""The Python examples of README.md and the site: what pages fence as `python`, and files that they show."""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
FENCED = re.compile(r"^```python\n(.*?)^```", flags=re.DOTALL | re.MULTILINE)
_SHOWN = re.compile(r"^```\{literalinclude\} (\S+\.py)$", flags=re.MULTILINE)


class Block(NamedTuple):
    """An example.

    Attributes:
        name: Its page and place in it, or the path of the file that a page shows.
        text: Python that runs by itself, in any folder, with the checkout importable.
    """

    name: str
    text: str


PAGES = [
    page
    for page in (ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted(DOCS.rglob("*.md")))
    if not {DOCS / "scenarios", DOCS / "build"}.intersection(page.parents)
]
"""All that is not made from the code."""


def pages() -> list[Path]:
    """README.md and the pages that people write: neither results nor what is made from the code."""
    made = {DOCS / "results", DOCS / "scenarios", DOCS / "build"}
    return [ROOT / "README.md", *(p for p in sorted(DOCS.rglob("*.md")) if not made.intersection(p.parents))]


def blocks() -> list[Block]:
    """All examples, each once."""
    found = []
    for page in pages():
        text, name = page.read_text(encoding="utf-8"), page.relative_to(ROOT).as_posix()
        found += [Block(f"{name}-{n}", block) for n, block in enumerate(FENCED.findall(text))]
    for path in shown_files():
        found.append(Block(path.relative_to(ROOT).as_posix(), path.read_text(encoding="utf-8")))
    return found


def shown_files() -> list[Path]:
    """The Python files that pages show."""
    files = set()
    for page in pages():
        for target in _SHOWN.findall(page.read_text(encoding="utf-8")):
            files.add((page.parent / target).resolve())
    return sorted(files)
