"""The documentation site: its examples run, it builds without a warning, and its links lead somewhere."""

from __future__ import annotations

import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

from docs.extensions.repository_links import to_repository
from tests.code_blocks import DOCS, ROOT, Block, blocks, shown_files

LARGE = ("benchmarl", "ray", "stable_baselines3", "torch", "torchrl")
"""What only some extras bring."""


TESTED_THERE = tuple(
    path for path in shown_files() if "training" in path.parts or path.name.startswith("test_")
)
"""Files that tests/training/test_examples.py or pytest itself runs."""
BLOCKS = [block for block in blocks() if ROOT / block.name not in TESTED_THERE]


@pytest.mark.parametrize("block", BLOCKS, ids=lambda block: block.name)
@pytest.mark.filterwarnings("ignore")  # of TorchRL, PettingZoo and Matplotlib
def test_example_runs(block: Block, tmp_path, monkeypatch):
    for package in LARGE:
        if re.search(rf"^\s*(?:import|from) {package}\b", block.text, flags=re.MULTILINE):
            pytest.importorskip(package, reason=f"{package} is not installed")
    monkeypatch.chdir(tmp_path)  # some write files
    exec(compile(block.text, block.name, "exec"), {"__name__": "__main__"})  # the pages are ours


def test_examples_are_found():
    names = [block.name for block in blocks()]
    assert len(names) == len(set(names))
    assert "README.md-0" in names and all(path.is_relative_to(ROOT) for path in shown_files())


class _Page(HTMLParser):
    """What a page of the site refers to, and the places in it that can be referred to."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.places, self.targets = set(), set()
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attrs):
        for name, value in attrs:
            if name == "id":
                self.places.add(value)
            if name in ("href", "src") and value and not urlsplit(value).scheme:
                self.targets.add(value)


@pytest.fixture(scope="module")
def site(tmp_path_factory) -> Path:
    pytest.importorskip("furo", reason="the extra docs is not installed")
    out = tmp_path_factory.mktemp("site")
    words = [sys.executable, "-m", "sphinx", "-b", "html", "-W", "--keep-going", "-q", "docs", str(out)]
    built = subprocess.run(words, cwd=ROOT, capture_output=True, text=True)
    assert built.returncode == 0, built.stderr[-3000:]
    assert built.stderr == ""
    return out


def test_every_page_is_built_and_its_links_lead_somewhere(site):
    sources = {p.relative_to(DOCS).with_suffix("").as_posix() for p in DOCS.rglob("*.md")}
    sources -= {name for name in sources if name.endswith("README") or name.startswith("build/")}
    built = {p.relative_to(site).with_suffix("").as_posix(): _Page(p) for p in site.rglob("*.html")}
    assert sources <= set(built) and len(sources) > 25
    broken = []
    for name, page in built.items():
        for target in page.targets:
            address = urlsplit(target)
            file = (site / name).parent / unquote(address.path) if address.path else site / f"{name}.html"
            if not file.exists():
                broken.append(f"{name}: {target}")
            elif address.fragment and file.suffix == ".html":
                there = built[file.resolve().relative_to(site.resolve()).with_suffix("").as_posix()]
                if unquote(address.fragment) not in there.places:
                    broken.append(f"{name}: {target}")
    assert not broken


def test_links_out_of_docs_lead_to_the_repository():
    text = "[a](../x/y.py) [b](results/z.md) ![c](../d.png) [`e`](../../README.md#f) [g](../api.md)"
    assert to_repository(text, "results/page.md", "https://h/r") == (
        "[a](../x/y.py) [b](results/z.md) ![c](../d.png) "
        "[`e`](https://h/r/blob/main/README.md#f) [g](../api.md)"
    )
    assert to_repository("[a](../x/y.py)", "page.md", "https://h/r") == "[a](https://h/r/blob/main/x/y.py)"
