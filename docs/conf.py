"""How Sphinx builds the documentation site: `make docs`."""

from __future__ import annotations

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))  # the library, its strategies and the site's own extensions, uninstalled

from entropy_explore_env.version import VERSION  # noqa: E402

project = "entropy_explore_env"
author = "the entropy_explore_env authors"
copyright = "2026, the entropy_explore_env authors"
release = version = VERSION

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_copybutton",
    "docs.extensions.literal_blocks",
    "docs.extensions.repository_links",
    "docs.extensions.scenario_cards",
]
repository_url = "https://github.com/entropy-explore-env/entropy_explore_env"
exclude_patterns = ["build", "**/README.md"]
nitpicky = True
nitpick_ignore_regex = [("py:.*", ".*")]  # types in signatures are names, not links

myst_enable_extensions = ["colon_fence", "deflist", "attrs_inline"]
myst_heading_anchors = 3
highlight_language = "text"  # indented blocks are commands and trees

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_class_signature = "separated"
napoleon_google_docstring = True
napoleon_numpy_docstring = False
napoleon_use_ivar = True
default_role = "code"  # docstrings write names in single backticks

html_theme = "furo"
html_title = "entropy_explore_env"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_theme_options = {
    "source_repository": repository_url,
    "source_branch": "main",
    "source_directory": "docs/",
}
copybutton_exclude = ".linenos, .gp"

linkcheck_timeout = 20
linkcheck_workers = 4
