"""Links of pages to files outside `docs/`: on the site they lead to the repository, as on GitHub itself."""

from __future__ import annotations

import posixpath
import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sphinx.application import Sphinx

_LINK = re.compile(r"(?<!!)\[((?:[^\[\]]|\[[^\]]*\])*)\]\((\.\./[^)\s]*)\)")


def to_repository(text: str, page: str, url: str) -> str:
    """Return a page's text whose links out of `docs/` are addresses.

    Args:
        text: Markdown.
        page: The page's path below `docs/`, with slashes.
        url: Where the repository is.
    """
    folder = posixpath.dirname(page)

    def replaced(match: re.Match[str]) -> str:
        target = posixpath.normpath(posixpath.join("docs", folder, match[2]))
        if target.split("/")[0] == "docs":
            return match[0]
        return f"[{match[1]}]({url}/blob/main/{target})"

    return _LINK.sub(replaced, text)


def setup(app: Sphinx) -> dict[str, bool]:
    """Sphinx calls this."""
    app.add_config_value("repository_url", "", "env", str)

    def rewrite(sphinx: Sphinx, page: str, source: list[str]) -> None:
        source[0] = to_repository(source[0], page, sphinx.config.repository_url)

    app.connect("source-read", rewrite)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
