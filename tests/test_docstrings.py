"""Docstrings of the API's pages: their sections begin at the margin, and words that readers stumble over."""

from __future__ import annotations

import inspect
import pkgutil
import re
from collections.abc import Iterator

import pytest

import entropy_explore_env
from tests.code_blocks import DOCS, ROOT

_DOCUMENTED = re.compile(r"^\.\. auto(?:class|function):: (\S+)$", flags=re.MULTILINE)
_SECTION = re.compile(r"^( *)(?:Args|Returns|Yields|Raises|Attributes|Note|Example):$", flags=re.MULTILINE)


def documented() -> Iterator[tuple[str, object]]:
    """What is public or on a page of the API, by name; of classes what people call of them, too."""
    pages = "\n".join(page.read_text(encoding="utf-8") for page in sorted((DOCS / "api").glob("*.md")))
    for name in sorted({*_DOCUMENTED.findall(pages), *entropy_explore_env.__all__}):
        there = pkgutil.resolve_name(name if "." in name else f"entropy_explore_env:{name}")
        yield name, there
        if inspect.isclass(there):
            for part, member in inspect.getmembers(there):
                if part == "__init__" or not part.startswith("_"):
                    yield f"{name}.{part}", member


def indented_sections(text: str) -> list[str]:
    """The heads of sections that are not at the margin."""
    return [found[0] for found in _SECTION.finditer(text) if found[1]]


def test_sections_of_docstrings_begin_at_the_margin():
    texts = {name: inspect.getdoc(there) or "" for name, there in documented()}
    assert sum(bool(_SECTION.search(text)) for text in texts.values()) > 40
    assert _SECTION.search(texts["parallel_env"])
    assert {name: heads for name, text in texts.items() if (heads := indented_sections(text))} == {}


@pytest.mark.parametrize(
    ("text", "heads"),
    [("A.\n\nArgs:\n    x: y.", []), ("A.\n\n    Args:\n        x: y.\n\nB.", ["    Args:"])],
)
def test_an_indented_section_is_found(text, heads):
    assert indented_sections(text) == heads


GONE = r"\b(dregs|clairvoyant|thinned|doubtful|nobody|so many|nothing is none|what is nothing)\b"
"""Words that are not the field's, or not plain English."""


def test_words_that_readers_stumble_over_stay_away():
    packages = ("entropy_explore_env", "baselines", "training", "benchmarks")
    files = [path for package in packages for path in (ROOT / package).rglob("*.py")]
    files += [ROOT / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md")]
    files += [*DOCS.glob("*.md"), *(DOCS / "tutorials").glob("*.md"), *(DOCS / "api").glob("*.md")]
    found = {
        f"{path.relative_to(ROOT)}: {word}"
        for path in files
        for word in re.findall(GONE, path.read_text("utf-8"), flags=re.IGNORECASE)
    }
    assert len(files) > 300 and found == set()
