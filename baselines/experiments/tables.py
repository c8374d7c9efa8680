"""Tables of results as text: Markdown for pages, CSV for the numbers behind figures."""

from __future__ import annotations

import csv
import io
import textwrap
from collections.abc import Callable, Iterable, Mapping, Sequence

from tabulate import tabulate

_WIDEST_HEAD = 20


def markdown_table(head: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    """Return a Markdown table; cells stand in it as `str` has them.

    Nothing is padded: a number that changes its width leaves the other lines of a page as they are.
    """
    assert all(len(row) == len(head) for row in rows), "rows are as wide as the head"
    lines = [head, ["---"] * len(head), *rows]
    return "".join(f"| {' | '.join(map(str, line))} |\n" for line in lines)


def terminal_table(head: Sequence[str], rows: Sequence[Sequence[object]], widest: int = 60) -> str:
    """Return a table for people at a terminal; the lines of a cell are kept, and wide ones are wrapped."""
    heads = [textwrap.fill(text, _WIDEST_HEAD) for text in head]
    # Not by tabulate's maxcolwidths, which takes 1,204 for a number and fails to read it.
    wrapped = [[_wrapped(str(cell), widest) for cell in row] for row in rows]
    return tabulate(wrapped, heads, "simple", disable_numparse=True)


def _wrapped(text: str, widest: int) -> str:
    return "\n".join(textwrap.fill(line, widest) for line in text.split("\n"))


def latex_table(head: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    """Return a LaTeX tabular, with booktabs' rules; the first column is left-aligned, the others right."""
    align = ["left", *["right"] * (len(head) - 1)]
    return tabulate(rows, head, "latex_booktabs", disable_numparse=True, colalign=align) + "\n"


def cells_table(
    names: Sequence[str],
    rows: Iterable[tuple[Sequence[object], str]],
    columns: Mapping[str, Callable[[str], object]],
) -> str:
    """Return a Markdown table of cells of an experiment, a row each.

    Args:
        names: Heads of what tells the cells apart.
        rows: Of each row what stands below them, and the cell.
        columns: Head → what is shown of a cell.
    """
    shown = [[*row, *(show(cell) for show in columns.values())] for row, cell in rows]
    return markdown_table([*names, *columns], shown)


def csv_table(columns: Mapping[str, Sequence[object]]) -> str:
    """Return columns of equal length as CSV."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([tuple(columns), *zip(*columns.values(), strict=True)])
    return text.getvalue()
