"""The form of every command: arguments, one line for an error, exit codes, one JSON object."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, ClassVar, Literal

import pytest

from baselines.cli.arguments import parse, print_json, run_command
from baselines.cli.options import Mark, options_of
from entropy_explore_env.command import BAD_INPUT, UsageError
from entropy_explore_env.errors import SettingError


@dataclass(frozen=True)
class Wheel:
    """A wheel.

    Attributes:
        radius_m, width_m: Of the tyre.
        spokes: How many.
    """

    radius_m: float = 0.3
    width_m: float = 0.05
    spokes: int | None = None

    def __post_init__(self):
        if self.radius_m <= 0:
            raise SettingError("Wheel.radius_m", self.radius_m, "a number > 0")


@dataclass(frozen=True)
class Body:
    """A body: what stands on wheels."""

    wheel: Wheel = field(default_factory=Wheel)
    places_m: tuple[tuple[float, float], ...] = ()
    turns: Literal["left", "right"] | float = "left"
    lights: bool = True


@dataclass
class More:
    """More of it."""

    tags: tuple[str, ...] = ("a", "b")
    """Words."""
    size: tuple[int, int] = (1, 2)
    """Two numbers."""


@dataclass
class Args:
    """Do something."""

    usual: ClassVar = ("name", "tags", "number")

    name: Annotated[str, Mark.POSITIONAL] = "room"
    """Which."""
    number: int = 3
    """How many."""
    most: int | None = None
    """At most."""
    folder: Path | None = None
    """Where."""
    loud: bool = False
    """Whether to shout."""
    more: Annotated[More, Mark.INLINE] = field(default_factory=More)
    body: Body = field(default_factory=Body)


@pytest.mark.parametrize(
    ("words", "args"),
    [
        ("", Args()),
        ("office --number 5 --folder a/b --loud", Args("office", 5, None, Path("a/b"), True)),
        ("--number=5 office --folder a --no-loud", Args("office", 5, None, Path("a"))),
        ("--number 1 --tags --size 3 4 --number 2", Args(number=2, more=More((), (3, 4)))),
        ("--tags c d -- office", Args("office", more=More(("c", "d")))),
        ("--body.wheel.radius_m 1 --body.no-lights", Args(body=Body(Wheel(1.0), lights=False))),
        ("--body.wheel.radius-m inf --body.turns right", Args(body=Body(Wheel(math.inf), turns="right"))),
        ("--body.turns -2e-1", Args(body=Body(turns=-0.2))),
        ("--body.places-m -1 2 3 -4e1", Args(body=Body(places_m=((-1.0, 2.0), (3.0, -40.0))))),
    ],
)
def test_words_become_arguments(words, args):
    assert parse(Args, words.split()) == args


def test_what_is_not_given_is_as_in_the_default():
    default = Args("cave", 7, body=Body(Wheel(spokes=4)))
    given = parse(Args, ["--body.wheel.radius-m", "2"], default=default)
    assert given == Args("cave", 7, body=Body(Wheel(2.0, spokes=4)))


@pytest.mark.parametrize(
    ("word", "number"),
    [
        ("1e6", 10**6),
        ("2.5e6", 2_500_000),
        ("2_500", 2500),
        ("-3", -3),
        ("-1e3", -1000),
        ("9007199254740993", 2**53 + 1),
    ],
)
def test_a_whole_number_may_be_typed_with_an_exponent(word, number):
    assert parse(Args, ["--number", word, "--most", word]) == Args(number=number, most=number)


def test_paths_begin_at_home(monkeypatch, tmp_path):
    monkeypatch.setenv("HOME", str(tmp_path))
    assert parse(Args, ["--folder", "~/b/c"]).folder == tmp_path / "b" / "c"


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("--number many", "argument --number: 'many': expected a whole number; see --help"),
        *((f"--number={word}", "whole number") for word in ("1.5", "1e-1", "inf", "nan", "1e400", "")),
        ("--number", "argument --number: expected one argument"),
        ("--size 1", "argument --size: expected 2 arguments"),
        ("--most x", "--most"),
        ("--folder ~nobody-of-this-name/a", "no such home folder"),
        ("--nmber 3", "--nmber: no such option; did you mean --number?"),
        ("--radius-m 3", "did you mean --body.wheel.radius-m?"),
        ("--body.light", "did you mean --body.lights?"),
        ("--what-else 3", "--what-else: no such option; see --help"),
        ("office stray", "stray: expected an option"),
        ("--body.turns lef", "expected one of left, right; did you mean left?, or a number"),
        ("--body.places-m 1 2 3", "--body.places-m: expected 2 numbers each"),
        ("--num 3", "did you mean --number?"),
        ("--number -1.5.2e3", "--number"),
    ],
)
def test_words_that_do_not_fit_are_named_in_one_line_and_print_nothing(words, said, capsys):
    with pytest.raises(UsageError) as error:
        parse(Args, words.split())
    assert said in str(error.value) and "\n" not in str(error.value)
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize("words", ["--name office", "--name=office", "--name"])
def test_who_gives_a_value_that_stands_alone_by_an_option_is_told_how_to_write_it(words):
    with pytest.raises(UsageError, match=rf"^{words.split()[0]}: no such option; its value .* NAME$"):
        parse(Args, words.split())


def test_a_value_that_is_not_allowed_is_the_settings_own_error():
    with pytest.raises(SettingError, match=r"Wheel.radius_m = -1.0"):
        parse(Args, ["--body.wheel.radius-m", "-1"])


def help_of(*words, capsys, width="80"):
    with pytest.raises(SystemExit) as stop:
        run_command(lambda words: 0 if parse(Args, words) else 1, ["--help", *words])
    out, err = capsys.readouterr()
    assert stop.value.code in (0, None) and err == ""
    assert max(map(len, out.splitlines())) <= int(width) and "\n\n\n" not in out
    return out


def test_the_short_help_shows_what_is_usual_and_names_the_other_parts(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    said = help_of(capsys=capsys)
    assert "Do something." in said and "usage: " in said and "[NAME] [OPTIONS]" in said
    assert said.index("NAME  ") < said.index("--tags TEXT ...") < said.index("--number INT")
    assert "Words. (default: a b)" in said
    assert "--loud" not in said and "--body.lights" not in said and "--size" not in said
    assert "others                    What is less often given (3 options)" in said
    assert "body                      A body (6 options)" in said


@pytest.mark.parametrize(
    ("topic", "there", "not_there"),
    [
        ("body", "--body.wheel.radius-m FLOAT", "--loud"),
        ("body", "--body.lights, --body.no-lights", "--size"),
        ("others", "--folder PATH", "--size"),
        ("more", "--size INT INT", "--number"),
        ("all", "--body.wheel.width-m FLOAT", "usage"),
        ("width_m", "Of the tyre. (default: 0.05)", "--number"),
        ("--number", "How many. (default: 3)", "--loud"),
    ],
)
def test_a_part_or_an_option_has_its_own_help(topic, there, not_there, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "60")
    said = help_of(topic, capsys=capsys, width="60")
    assert there in said and not_there not in said


def test_help_on_what_is_not_there_names_the_parts(capsys):
    assert run_command(lambda words: 0 if parse(Args, words) else 1, ["--help", "bodi"]) == BAD_INPUT
    out, err = capsys.readouterr()
    assert out == "" and "others, more, body, all" in err and "did you mean body?" in err


def test_fields_that_no_word_can_be_are_refused():
    @dataclass
    class Odd:
        """Odd."""

        table: dict = field(default_factory=dict)

    with pytest.raises(TypeError, match="dict"):
        parse(Odd, [])
    assert [option.flag for option in options_of(Wheel, Wheel())] == ["--radius-m", "--width-m", "--spokes"]


def test_a_package_that_is_missing_is_named_with_its_extra(capsys, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "docstring_parser", None)
    assert run_command(lambda words: 0 if parse(Args, words) else 1, []) == BAD_INPUT
    out, err = capsys.readouterr()
    assert out == "" and err.count("\n") == 1 and "entropy_explore_env[baselines]" in err


def test_json_is_one_object_that_any_reader_takes(capsys):
    print_json({"a": [1.5, None, True], "b": "σ"})
    out, err = capsys.readouterr()
    assert json.loads(out) == {"a": [1.5, None, True], "b": "σ"} and err == ""
    with pytest.raises(ValueError, match="JSON"):
        print_json({"a": float("nan")})
    assert capsys.readouterr().out == ""
