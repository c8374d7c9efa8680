"""Archives of kept results: what comes out is what went in, and counts only where it may."""

from __future__ import annotations

import json
import lzma

import pytest

from baselines.experiments import runner
from baselines.experiments.archive import read_archive, write_archive
from baselines.experiments.runner import TRACE, read_record, run_all, write_record
from entropy_explore_env.errors import SettingError
from tests.baselines.experiments.test_confirmation import Doubled, conditions, works
from tests.code_blocks import ROOT


def kept(folder, code="new", count=4):
    records = [read_record(folder, work, code) for work in works([], count)]
    return [record and record["twice"] for record in records]


@pytest.fixture
def archive(tmp_path):
    """Of four results."""
    run_all(works([]), conditions(tmp_path / "first"))
    assert write_archive(tmp_path / "all.xz", tmp_path / "first", works([], count=6)) == 4
    return tmp_path / "all.xz"


def test_who_begins_with_an_archive_runs_the_rest(archive, tmp_path):
    log, folder = [], tmp_path / "second"
    fresh = works(log, count=6)
    assert read_archive(archive, folder, fresh) == 4
    for first in (tmp_path / "first").rglob("*.json"):
        assert (folder / "doubled" / first.name).read_bytes() == first.read_bytes()
    records = run_all(fresh, conditions(folder))
    assert log == [4, 5] and [record["twice"] for record in records] == [0.0, 2.0, 4.0, 6.0, 8.0, 10.0]


def test_the_same_results_make_the_same_bytes_in_whatever_order(archive, tmp_path):
    write_archive(tmp_path / "again.xz", tmp_path / "first", works([])[::-1])
    assert (tmp_path / "again.xz").read_bytes() == archive.read_bytes()


def test_only_what_is_asked_for_is_taken(archive, tmp_path):
    asked = works([])[1:3]
    assert read_archive(archive, tmp_path / "second", asked) == 2
    assert kept(tmp_path / "second") == [None, 2.0, 4.0, None]


def test_what_is_kept_already_stays(archive, tmp_path):
    folder = tmp_path / "second"
    run_all([Doubled(1, code="other", wrong=1.0)], conditions(folder))
    assert read_archive(archive, folder, works([])) == 3
    assert kept(folder) == [0.0, None, 4.0, 6.0] and kept(folder, "other") == [None, 3.0, None, None]


def test_results_of_other_code_are_there_but_do_not_count(archive, tmp_path):
    assert read_archive(archive, tmp_path / "second", works([], code="later")) == 4
    assert kept(tmp_path / "second", "later") == [None] * 4 and kept(tmp_path / "second") == [0, 2, 4, 6]


def test_a_record_that_was_changed_by_hand_does_not_count(archive, tmp_path):
    lines = [json.loads(line) for line in lzma.decompress(archive.read_bytes()).splitlines()]
    lines[2]["record"]["twice"] = 5.0
    archive.write_bytes(lzma.compress("\n".join(map(json.dumps, lines)).encode()))
    read_archive(archive, tmp_path / "second", works([]))
    assert kept(tmp_path / "second") == [0.0, 2.0, None, 6.0]


def test_names_with_colons_are_kept_where_files_must_not_have_them(tmp_path, monkeypatch):
    monkeypatch.setattr(runner, "_NO_COLONS", True)
    assert (
        runner.kept_file(tmp_path, "office/a.py:Mine/seed-0")
        == tmp_path / "office" / "a.py_Mine" / "seed-0.json"
    )
    monkeypatch.setattr(runner, "_NO_COLONS", False)
    assert runner.kept_file(tmp_path, "pretrained:plans", ".npz") == tmp_path / "pretrained:plans.npz"


def test_folders_of_the_machine_that_ran_it_are_left_out(tmp_path):
    """A mission that failed: its trace stays here, its reason is told to others."""
    (work,) = works([], count=1)
    record = {"failed": "WorldError: no", TRACE: 'File "/home/me/clone/a.py", line 1', "limit_s": None}
    write_record(tmp_path / "first", work, "new", record)
    assert write_archive(tmp_path / "all.xz", tmp_path / "first", [work]) == 1
    assert b"/home/me" not in lzma.decompress((tmp_path / "all.xz").read_bytes())
    assert read_archive(tmp_path / "all.xz", tmp_path / "second", [work]) == 1
    assert read_record(tmp_path / "second", work, "new") == {**record, TRACE: ""}
    assert read_record(tmp_path / "first", work, "new") == record


@pytest.mark.parametrize(
    "path", sorted((ROOT / "docs" / "results").rglob("*.xz")), ids=lambda p: p.parent.name
)
def test_published_archives_name_no_folder_of_a_machine(path):
    lines = lzma.decompress(path.read_bytes()).splitlines()
    assert lines and not [line[:200] for line in lines if b"Traceback" in line or b'File \\"' in line]


@pytest.mark.parametrize(
    "content",
    [b"", b"no archive", lzma.compress(b"[]"), lzma.compress(b"\xff"), lzma.compress(b'{"digest": "0"}')],
)
def test_what_is_no_archive_is_refused_and_nothing_written(content, tmp_path):
    path = tmp_path / "broken.xz"
    path.write_bytes(content)
    with pytest.raises(SettingError, match="archive"):
        read_archive(path, tmp_path / "second", works([]))
    assert not (tmp_path / "second").exists()


def test_an_archive_that_is_not_there_is_named(tmp_path):
    with pytest.raises(SettingError, match=r"nowhere\.xz.*No such file"):
        read_archive(tmp_path / "nowhere.xz", tmp_path / "second", works([]))
