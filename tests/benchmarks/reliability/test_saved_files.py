"""Changed records and checkpoints: read, or refused by name; changes reach what lies behind digests."""

from __future__ import annotations

import json

import numpy as np
import pytest

from benchmarks.reliability.saved_files import CHANGES, KINDS, another_value, play_files
from entropy_explore_env.errors import EntropyExploreError


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("files", [60, pytest.param(2000, marks=pytest.mark.long)])
def test_only_sound_files_and_named_errors(kind, files, tmp_path):
    found = play_files(KINDS[kind](tmp_path), tmp_path / "changed", files, 3)
    assert found["wrong"] == []
    assert 0 < found["loaded"] < found["files"] == files


@pytest.mark.parametrize("kind", KINDS)
def test_a_digest_made_right_again_lets_a_change_through_and_one_that_is_not_does_not(kind, tmp_path):
    made = KINDS[kind](tmp_path)
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
        made.load(folder)
    for name, content in made.repair(changed).items():
        (folder / name).write_bytes(content)
    made.load(folder)


def test_what_is_wrong_is_said():
    rng = np.random.default_rng(0)
    document = json.dumps({"a": [1, {"b": 2}], "c": "d"}).encode()
    assert {another_value(document, rng) for _ in range(40)} >= {b'{"a": [1, {"b": 2}], "c": null}'}
    assert all(change(document, np.random.default_rng(5)) != document for change in CHANGES[:4])


def test_an_error_without_a_name_and_a_slow_file_are_found(tmp_path, monkeypatch):
    def raises(folder):
        raise KeyError("x")

    made = KINDS["record"](tmp_path)._replace(load=raises)
    found = play_files(made, tmp_path / "changed", 2, 0)
    assert len(found["wrong"]) == 2 and "KeyError: 'x'" in found["wrong"][0]
    monkeypatch.setattr("benchmarks.reliability.saved_files.MOST_S", -1.0)
    found = play_files(made._replace(load=lambda folder: None), tmp_path / "changed", 1, 0)
    assert found["loaded"] == 1 and len(found["wrong"]) == 1
