"""The form of every command: arguments, one line for an error, exit codes, one JSON object."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import pytest

from baselines.cli.arguments import WholeNumber, parse, print_json, run_command, whole_number
from entropy_explore_env.command import BAD_INPUT, UsageError
from entropy_explore_env.errors import MissingExtraError


@dataclass
class Args:
    """Do something."""

    number: int = 3
    """How many."""
    folder: Path | None = None
    """Where."""
    loud: bool = False
    """Whether to shout."""


def test_words_become_arguments():
    assert parse(Args, []) == Args()
    assert parse(Args, ["--number", "5", "--folder", "a/b", "--loud"]) == Args(5, Path("a/b"), True)
    assert parse(Args, ["--loud"], default=Args(7)) == Args(7, None, True)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--number", "many"], "--number"),
        (["--number"], "--number"),
        (["--nmber", "3"], "--nmber, 3; did you mean --number?"),
        (["stray"], "stray"),
        (["--loud", "yes"], "yes"),
    ],
)
def test_words_that_do_not_fit_are_named_in_one_line_and_print_nothing(words, said, capsys):
    with pytest.raises(UsageError) as error:
        parse(Args, words)
    assert said in str(error.value) and "\n" not in str(error.value)
    assert not set(str(error.value)) & set("│╭╮╰╯─")
    assert "helptext" not in str(error.value) and "---" not in str(error.value)
    assert capsys.readouterr() == ("", "")


@dataclass
class Choices:
    """Choose."""

    split: Literal["train", "validation", "test"] = "train"
    """Of which worlds."""


@pytest.mark.parametrize(("word", "meant"), [("tests", "; did you mean test?"), ("xyz", ")")])
def test_a_choice_that_is_nearly_right_is_answered_with_the_right_one(word, meant):
    with pytest.raises(UsageError, match=r"--split.*'train', 'validation', 'test'") as error:
        parse(Choices, ["--split", word])
    assert str(error.value).endswith(meant)


@dataclass
class Counts:
    """Count."""

    steps: WholeNumber = 3
    """How many."""
    most: WholeNumber | None = None
    """At most."""


@pytest.mark.parametrize(
    ("word", "number"),
    [("1e6", 10**6), ("2.5e6", 2_500_000), ("2_500", 2500), ("-3", -3), ("9007199254740993", 2**53 + 1)],
)
def test_a_whole_number_may_be_typed_with_an_exponent(word, number):
    assert whole_number(word) == number
    assert parse(Counts, ["--steps", word, "--most", word]) == Counts(number, number)


@pytest.mark.parametrize("word", ["1.5", "1e-1", "many", "inf", "nan", "1e400", ""])
def test_what_is_no_whole_number_is_named(word):
    with pytest.raises(UsageError, match=r"--steps.*is not a whole number"):
        parse(Counts, [f"--steps={word}"])


def test_help_goes_to_standard_output_and_ends_well(capsys):
    with pytest.raises(SystemExit) as stop:
        run_command(lambda words: 0 if parse(Args, words) else 1, ["--help"])
    out, err = capsys.readouterr()
    assert stop.value.code in (0, None) and err == ""
    assert "How many." in out and "--number" in out


def test_a_package_that_is_missing_is_named_with_its_extra(capsys, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "tyro", None)
    assert run_command(lambda words: 0 if parse(Args, words) else 1, []) == BAD_INPUT
    out, err = capsys.readouterr()
    assert out == "" and err.count("\n") == 1 and "entropy_explore_env[baselines]" in err
    assert isinstance(MissingExtraError("tyro", "baselines"), ImportError)


def test_json_is_one_object_that_any_reader_takes(capsys):
    print_json({"a": [1.5, None, True], "b": "σ"})
    out, err = capsys.readouterr()
    assert json.loads(out) == {"a": [1.5, None, True], "b": "σ"} and err == ""
    with pytest.raises(ValueError, match="JSON"):
        print_json({"a": float("nan")})
    assert capsys.readouterr().out == ""


@dataclass
class Many:
    """Do something."""

    count: int = 3
    """How many."""
    most: int | None = None
    """At most."""
    out: Path | None = None
    """Where."""
    folder: Path = Path("a")
    """Where from."""


def test_all_whole_numbers_may_be_typed_with_an_exponent_and_all_paths_begin_at_home(monkeypatch, tmp_path):
    monkeypatch.setenv("HOME", str(tmp_path))
    assert parse(Many, ["--count", "1e6", "--most", "2.5e3"]) == Many(1_000_000, 2500)
    assert parse(Many, ["--count", "1_000", "--out", "~/b/c"]) == Many(1000, None, tmp_path / "b" / "c")
    assert parse(Many, ["--folder", "~"], default=Many(7)).folder == tmp_path
    assert parse(Many, [], default=Many(7, 8, Path("b"))) == Many(7, 8, Path("b"))
    for words in (["--count", "1.5"], ["--count", "1e-3"], ["--most", "x"], ["--count", "inf"]):
        with pytest.raises(UsageError, match=words[0]):
            parse(Many, words)
