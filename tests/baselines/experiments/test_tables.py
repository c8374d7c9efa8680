"""Tables as text."""

from __future__ import annotations

import pytest

from baselines.experiments.tables import csv_table, markdown_table, terminal_table


def test_columns_become_csv():
    assert csv_table({"a": [1, 2], "b": ["x", 0.5]}) == "a,b\n1,x\n2,0.5\n"
    assert csv_table({"a": ['x, "y"']}) == 'a\n"x, ""y"""\n'
    with pytest.raises(ValueError, match=r"shorter|longer"):
        csv_table({"a": [1, 2], "b": [3]})


def test_rows_become_markdown_as_they_are():
    """Numbers as `str` has them, blanks kept, no padding: a wider number leaves the other lines alone."""
    assert (
        markdown_table(["a", "b"], [[1, "x"], [2, 0.5]])
        == "| a | b |\n| --- | --- |\n| 1 | x |\n| 2 | 0.5 |\n"
    )
    wide = markdown_table(["a", "b"], [["1,234.50", ""], ["  x", "1e5"]]).splitlines()
    assert wide[2:] == ["| 1,234.50 |  |", "|   x | 1e5 |"]


def test_a_table_for_the_terminal_keeps_the_lines_of_its_cells():
    lines = terminal_table(["a", "b"], [["42 s\n(39 … 44)", 1]]).splitlines()
    assert [line.split() for line in lines[2:]] == [["42", "s", "1"], ["(39", "…", "44)"]]
    narrow = terminal_table(["a"], [["42 s\n(39 … 44)"]], 6).splitlines()
    assert [line.split() for line in narrow[2:]] == [["42", "s"], ["(39", "…"], ["44)"]]


def test_a_table_for_the_terminal_wraps_texts_and_leaves_numbers_as_they_are():
    lines = terminal_table(["a", "b"], [["198,700", "x y z"], [1, "1,204 (1,138 … 1,274)"]], 12).splitlines()
    assert [line.split() for line in lines] == [
        ["a", "b"],
        ["-------", "------------"],
        ["198,700", "x", "y", "z"],
        ["1", "1,204", "(1,138"],
        ["…", "1,274)"],
    ]
