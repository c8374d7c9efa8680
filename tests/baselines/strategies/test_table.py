"""The table of strategies, and what is made from it: help, the page's lists, and the suites' strategies."""

from __future__ import annotations

import re

from baselines.strategies import ALIASES, CLIFF_STRATEGIES, STRATEGIES, make_strategy
from baselines.strategies.table import TABLE, Family, help_text, markdown_list, suite_names
from baselines.suites import SCOREBOARD
from tests.code_blocks import DOCS

ENTRIES = [entry for entries in TABLE.values() for entry in entries]


def test_every_name_stands_once_with_a_line_and_makes_a_strategy():
    names = [entry.name for entry in ENTRIES]
    assert len(set(names)) == len(names) == len(STRATEGIES) + len(CLIFF_STRATEGIES)
    assert set(ALIASES) == {"best"} and set(ALIASES.values()) <= set(STRATEGIES)
    for entry in ENTRIES:
        assert "\n" not in entry.line and 20 < len(entry.line) < 220, entry.name
        made = make_strategy(entry.name)
        assert callable(made.reset) and callable(made.choose)


def test_the_page_lists_exactly_the_tables_lines():
    page = (DOCS / "strategies.md").read_text(encoding="utf-8")
    assert [family for family in Family if markdown_list(family) not in page] == []
    listed = re.findall(r"^- `([\w:-]+)`: ", page, flags=re.MULTILINE)
    assert sorted(listed) == sorted(entry.name for entry in ENTRIES)


def test_the_help_names_all_of_them_in_short_lines():
    words = set(re.findall(r"[\w:-]+", help_text()))
    assert [entry.name for entry in ENTRIES if entry.name not in words] == []


def test_suites_are_named_as_they_are():
    assert {suite for entry in ENTRIES for suite in entry.suites} == {*SCOREBOARD, "c2"}
    assert set(suite_names("others")) < set(suite_names("plans")) < set(suite_names("teams"))
    assert "voronoi" not in suite_names("plans") and "voronoi" in suite_names("teams")
