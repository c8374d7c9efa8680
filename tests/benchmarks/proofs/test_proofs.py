"""The command of the proofs: what it prints of cases that pass, fail, hang and crash, and what it refuses."""

from __future__ import annotations

import os

import pytest

from benchmarks.proofs import __main__ as command
from benchmarks.proofs.__main__ import PROOFS, Played, Proof, main, table, write_page
from benchmarks.proofs.cases import Found, play_cases


def squares(number):
    if number == 13:
        raise ValueError("unlucky\nnumber")
    return Found({"squares": number * number, "s at most": number / 8}, "odd" if number % 2 else "even")


def assertions(number):
    del number
    return Found({"assertions": float(os.environ.get("ENTROPY_EXPLORE_ASSERT", "0"))})


@pytest.fixture
def small(monkeypatch):
    """One proof, of squares."""
    monkeypatch.setattr(command, "PROOFS", {"squares": Proof(squares, 2, 5, 60.0)})


def test_cases_are_drawn_from_their_numbers_and_a_failed_one_is_played_again(small, capsys, tmp_path):
    out = tmp_path / "new" / "page.md"
    assert main(["--first", "12", "--out", str(out)]) == 1
    said = capsys.readouterr()
    assert "python -m benchmarks.proofs squares --cases 1 --first 13" in said.err
    assert "ValueError: unlucky number (test_proofs.py, line " in said.err and "squares: 2 of 2" in said.err
    assert "| squares | all | 2 | 1 | 144 squares, 1.5 s at most |" in said.out
    text = out.read_text("utf-8")
    assert "`python -m benchmarks.proofs squares --cases 1 --first 13`: ValueError: unlucky number" in text
    assert f"`python -m benchmarks.proofs --first 12 --out {out}` at commit" in text
    assert main(["squares", "--cases", "1", "--first", "13"]) == 1
    assert main(["squares", "--cases", "1", "--first", "14"]) == 0


def test_the_command_plays_as_many_cases_as_it_is_told(small, capsys):
    late = ["--full", "--limit-s", "1e-9"]
    for words, cases in ((["--full"], 5), (["--cases", "3"], 3), ([], 2), (late, 1)):
        assert main(words) == 0
        assert f"| squares | all | {cases} | 0 |" in capsys.readouterr().out


def test_cases_are_played_with_what_this_process_says_of_assertions(monkeypatch):
    monkeypatch.setenv("ENTROPY_EXPLORE_ASSERT", "1")
    assert dict(play_cases(assertions, [4], 60.0)) == {4: Found({"assertions": 1.0})}


def test_groups_have_rows_of_their_own():
    played = {"squares": Played([squares(number) for number in range(3)], {13: "ValueError"})}
    assert table(played).splitlines()[2:] == [
        "| squares | all | 4 | 1 | 5 squares, 0.25 s at most |",
        "| squares | even | 2 | - | 4 squares, 0.25 s at most |",
        "| squares | odd | 1 | - | 1 squares, 0.125 s at most |",
    ]


def test_the_page_says_what_each_proof_is(tmp_path):
    write_page(tmp_path / "page.md", {"squares": Played([squares(1)], {})}, ["--full"])
    text = (tmp_path / "page.md").read_text("utf-8")
    assert all(f"- **{name}**: " in text for name in PROOFS)
    assert len(text.split()) < 1500
