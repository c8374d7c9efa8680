"""The table of an experiment: nothing is lost, whatever is cut or killed; what is no row is named."""

from __future__ import annotations

import json
import lzma

import pytest

from baselines.experiments.origin import Origin, commits_since, this_origin
from baselines.experiments.rows import GrowingTable, Row, origins_line, read_table, write_table
from entropy_explore_env.errors import SettingError

ORIGIN = Origin("abc", True, {"numpy": "2"})


def row(cell="room", seed=0, settings=None, record=None, origin=ORIGIN):
    return Row(cell, seed, "room", settings or {"σ": 0.1}, origin, record or {"t": 1.5})


def test_rows_come_back_sorted_and_the_later_of_two_of_one_trial_counts(tmp_path):
    table = tmp_path / "trials.jsonl"
    rows = [row("b", 1), row("a", 10), row("a", 9), row("b", 1, record={"t": 2.0})]
    with GrowingTable(table).opened() as kept:
        assert kept == []
        for each in rows:
            GrowingTable(table).append(each)
    assert read_table(table) == [rows[2], rows[1], rows[3]]
    GrowingTable(table).finish()
    assert [json.loads(line)["seed"] for line in table.read_text("utf-8").splitlines()] == [9, 10, 1]
    write_table(tmp_path / "again.jsonl", reversed([*rows[1:]]))
    write_table(tmp_path / "packed.jsonl.xz", rows)
    assert read_table(tmp_path / "packed.jsonl.xz") == read_table(table)
    assert lzma.decompress((tmp_path / "packed.jsonl.xz").read_bytes()) == table.read_bytes()


def test_a_row_that_was_cut_at_any_byte_is_dropped_and_the_others_stay(tmp_path):
    table, first, last = tmp_path / "trials.jsonl", row(seed=0), row(seed=1)
    whole = f"{first.line()}\n".encode()
    for length in range(len(last.line().encode()) + 1):
        table.write_bytes(whole + last.line().encode()[:length])
        assert read_table(table) == [first]
        with GrowingTable(table).opened():
            GrowingTable(table).append(last)
        assert read_table(table) == [first, last]


@pytest.mark.parametrize(
    ("line", "said"),
    [
        (b'{"table": 1, "cell": "room", "se', "line 2.*one row of a table"),
        (b"[]", "line 2.*one row of a table"),
        (b'{"table": 2, "cell": "room"}', "line 2.*version 1 of tables: this is one of version 2"),
        (b'{"table": 1, "cell": "room"}', "line 2.*with the fields cell, seed"),
    ],
)
def test_a_line_that_is_no_row_is_named_and_nothing_is_lost(tmp_path, line, said):
    table = tmp_path / "trials.jsonl"
    content = f"{row().line()}\n".encode() + line + f"\n{row(seed=1).line()}\n".encode()
    table.write_bytes(content)
    with pytest.raises(SettingError, match=said):
        read_table(table)
    with pytest.raises(SettingError, match=said), GrowingTable(table).opened():
        pass
    assert table.read_bytes() == content


def test_tables_that_cannot_be_read_or_grown(tmp_path):
    (tmp_path / "t.jsonl.xz").write_bytes(b"no xz")
    with pytest.raises(SettingError, match="a file of rows that can be read"):
        read_table(tmp_path / "t.jsonl.xz")
    with pytest.raises(SettingError, match="not compressed"), GrowingTable(tmp_path / "t.jsonl.xz").opened():
        pass
    assert read_table(tmp_path / "t.jsonl.xz" / "below.jsonl") == []  # as where no file is
    table = GrowingTable(tmp_path / "t.jsonl")
    with table.opened(), pytest.raises(SettingError, match="no other command"), table.opened():
        pass


def test_a_page_says_in_a_line_which_commits_its_rows_come_from():
    rows = [row(seed=0), row(seed=1), row(seed=2, origin=Origin("def", False)), row(seed=3, origin=Origin())]
    assert origins_line(rows) == (
        "Rows: 4, of commit `abc` (2), `def` with changes that were not committed (1), "
        "`unknown` with changes that were not committed (1)."
    )


def test_the_origin_of_this_tree_and_commits_since():
    origin = this_origin()
    assert {"python", "numpy", "numba", "scipy"} == set(origin.versions)
    if origin.commit is None:
        pytest.skip("no git repository")
    assert origin.commit in commits_since("HEAD") and len(commits_since("HEAD")) == 1
    with pytest.raises(SettingError, match="a commit of this repository"):
        commits_since("no-such-commit")
