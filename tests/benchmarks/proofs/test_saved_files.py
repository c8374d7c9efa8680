"""Changed records and checkpoints: read, or refused by name; changes reach what lies behind digests."""

from __future__ import annotations

import json

import numpy as np
import pytest

from benchmarks.proofs import files
from benchmarks.proofs.cases import BrokenPromiseError
from benchmarks.proofs.files import read_changed, read_saved
from benchmarks.proofs.saved_files import CHANGES, SAVED, another_value
from entropy_explore_env.errors import EntropyExploreError


@pytest.mark.parametrize("kind", SAVED)
def test_only_sound_files_and_named_errors(kind, tmp_path):
    reads = read_saved(kind, tmp_path, 60, 3)
    assert reads.wrong == []
    assert 0 < reads.loaded < reads.files == 60


@pytest.mark.parametrize("kind", SAVED)
def test_a_digest_made_right_again_lets_a_change_through_and_one_that_is_not_does_not(kind, tmp_path):
    made = SAVED[kind](tmp_path)
    changed = {
        name: content + (b" " if name.endswith(".json") else b"") for name, content in made.files.items()
    }
    if kind == "record":
        assert made.repair(changed)["mission.npz"] != made.files["mission.npz"]
        return
    folder = tmp_path / "changed"
    folder.mkdir()
    for name, content in changed.items():
        (folder / name).write_bytes(content)
    with pytest.raises(EntropyExploreError, match="whole and unchanged"):
        made.load(folder / next(iter(made.files)))
    for name, content in made.repair(changed).items():
        (folder / name).write_bytes(content)
    made.load(folder / next(iter(made.files)))


def test_what_is_wrong_is_said():
    rng = np.random.default_rng(0)
    document = json.dumps({"a": [1, {"b": 2}], "c": "d"}).encode()
    assert {another_value(document, rng) for _ in range(40)} >= {b'{"a": [1, {"b": 2}], "c": null}'}
    assert all(change(document, np.random.default_rng(5)) != document for change in CHANGES[:4])


def test_an_error_without_a_name_and_a_slow_file_are_found(tmp_path):
    def raises(path):
        raise KeyError("x")

    saved = SAVED["record"](tmp_path)
    reads = read_changed(saved.changed, raises, tmp_path / "changed", 2, 0, 5.0)
    assert len(reads.wrong) == 2 and "KeyError: 'x'" in reads.wrong[0]
    reads = read_changed(saved.changed, lambda path: None, tmp_path / "changed", 1, 0, -1.0)
    assert reads.loaded == 1 and len(reads.wrong) == 1


def test_cases_of_changed_files_take_turns_and_keep_their_reader(monkeypatch):
    monkeypatch.setattr(files, "BATCH", 8)
    image, formats = files.FORMATS.index("image"), len(files.FORMATS)
    found = [files.play(number) for number in (image, image + formats, 0)]
    assert [each.of for each in found] == ["image", "image", "record"]
    assert all(each.figures["read"] + each.figures["refused"] == 8 for each in found)
    assert 10.0 < found[0].figures["MiB at most"] < 512.0
    reader = files._reader()
    assert reader._process is not None and reader._process.poll() is None
    reader.close()
    files._reader.cache_clear()


def test_files_that_are_treated_wrongly_fail_their_case(monkeypatch):
    monkeypatch.setattr(files, "BATCH", 3)
    monkeypatch.setattr(files, "MOST_SAVED_S", -1.0)
    with pytest.raises(BrokenPromiseError, match=r"record: 3 files: \[0, 0\] "):
        files.play(0)
