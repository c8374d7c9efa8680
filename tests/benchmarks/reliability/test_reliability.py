"""The command of the proofs: what is kept is not played again, failures are counted and shown."""

from __future__ import annotations

import json

import pytest

from benchmarks.reliability import __main__ as command
from benchmarks.reliability import determinism, page, soak
from benchmarks.reliability.__main__ import PROOFS, Proof, carry_on, main, rows_of
from benchmarks.reliability.page import Kept
from entropy_explore_env.errors import SettingError

EMPTY = {name: Kept((), 10) for name in PROOFS}


def fails_at_three(number):
    if number == 3:
        raise ValueError("three")
    return {"square": number * number}


def test_a_run_goes_on_where_it_was(tmp_path, capsys):
    file, proof = tmp_path / "kept" / "squares.jsonl", Proof(fails_at_three, 2, 5, 60.0)
    carry_on(proof, file, 2)
    assert rows_of(file) == [{"number": 0, "square": 0}, {"number": 1, "square": 1}]
    carry_on(proof, file, 5)
    rows = sorted(rows_of(file), key=lambda row: row["number"])
    assert [row.get("square") for row in rows] == [0, 1, 4, None, 16]
    assert rows[3] == {"number": 3, "failure": "ValueError: three"}
    before = file.read_bytes()
    carry_on(proof, file, 5)
    assert file.read_bytes() == before
    assert "squares: 5 of 5" in capsys.readouterr().err


def test_the_page_says_what_was_played_and_what_failed(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(command, "carry_on", lambda *_: None)
    rows = [
        {"number": 0, "refused": ["Robot.reach_m"], "seconds": 1.25, "episodes": 3},
        {"number": 1, "refused": [], "seconds": 0.5, "episodes": 1},
        {"number": 2, "failure": "ran past 600 s on the clock"},
    ]
    (tmp_path / "settings.jsonl").write_text("".join(json.dumps(row) + "\n" for row in rows))
    where = ["--results", str(tmp_path), "--page", str(tmp_path / "page.md")]
    assert main(where) == 1
    text = (tmp_path / "page.md").read_text("utf-8")
    assert "3 of 10,000 cases played, 1 failed." in text and "- case 2: ran past 600 s" in text
    assert "slowest took 1.2 s; 4 episodes" in text and "Robot.reach_m (1)" in text
    (tmp_path / "settings.jsonl").unlink()
    assert main(where) == 0
    capsys.readouterr()
    with pytest.raises(SettingError, match="one of settings, states"):
        main(["--proofs", "luck"])


def test_digests_that_differ_and_memory_that_grows_are_shown():
    told = {"variant": 0, "scenario": 4, "digest": "a", "number": 0}
    same = [told, {**told, "variant": 1, "number": 1}]
    other = [*same, {**told, "variant": 2, "digest": "b", "number": 2}]
    for rows, said in (
        (same, "1 drawn scenarios, each in 2"),
        (same, "no difference"),
        (other, "scenarios [4]"),
    ):
        assert said in page.page({**EMPTY, "determinism": Kept(rows, 10)})
    rows = [{"number": n, "resident_mib": 100.0 + n, "episodes": 1} for n in range(25)]
    text = page.page({**EMPTY, "soak": Kept(rows[::-1], 30)})
    assert "1,250,000 robot-steps" in text and "120 MiB after 10⁶, and 124 MiB" in text


def test_a_digest_does_not_depend_on_threads_or_company():
    digests = {determinism.digest_of(3, threads, missions) for threads in (1, 2) for missions in (1, 3)}
    assert len(digests) == 1 != len({determinism.digest_of(number, 1, 1) for number in (3, 5)})


def test_a_piece_of_soak(monkeypatch):
    monkeypatch.setattr(soak, "ROBOT_STEPS", 60)
    assert soak.play_number(0)["resident_mib"] > 10.0
