"""Indented blocks of docstrings (formulas, tables of parts, commands) as literal text."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sphinx.application import Sphinx

_AFTER_NAPOLEON = 900
_NOT_TEXT = (".. ", ":", "- ", "* ")
"""Beginnings of paragraphs whose indented blocks are their own: directives, fields, lists."""


def mark_literal(lines: list[str]) -> list[str]:
    """Return a docstring's lines, with `::` before each indented block that follows a paragraph of text.

    Args:
        lines: reStructuredText without indentation of its own.
    """
    marked: list[str] = []
    paragraph = ""  # the first line of the latest one that is not indented
    for number, line in enumerate(lines):
        before = lines[number - 1] if number else ""
        if line.startswith(" ") and not before.strip() and paragraph and not paragraph.startswith(_NOT_TEXT):
            marked += ["::", ""]
            paragraph = ""
        elif line.strip() and not line.startswith(" ") and not before.strip():
            paragraph = line
        marked.append(line)
    return marked


def setup(app: Sphinx) -> dict[str, bool]:
    """Sphinx calls this."""

    def rewrite(sphinx: Sphinx, what: str, name: str, of: object, options: object, lines: list[str]) -> None:
        lines[:] = mark_literal(lines)

    app.connect("autodoc-process-docstring", rewrite, priority=_AFTER_NAPOLEON)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
