"""The form of the commands here: arguments from a dataclass, results out, progress and errors aside.

Results go to standard output (with `--json` exactly one JSON object), progress to standard error. Exit codes
are those of `entropy_explore_env.command`.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import re
import shlex
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from decimal import Decimal
from pathlib import Path
from typing import Any, TypeVar

from baselines.cli.help import help_text
from baselines.cli.options import Option, options_of
from entropy_explore_env import command
from entropy_explore_env.command import LineParser, UsageError, is_file
from entropy_explore_env.errors import SettingError, did_you_mean
from entropy_explore_env.worlds.given import distinct_paths

Arguments = TypeVar("Arguments")

_HELP = ("-h", "--help")
_NEGATIVE = re.compile(r"-(\d+\.?\d*|\.\d+)e[+-]?\d+", re.IGNORECASE)
"""A negative number with an exponent, which argparse takes for a flag."""


def parse(
    kind: type[Arguments],
    words: Sequence[str],
    default: Arguments | None = None,
    description: str | None = None,
) -> Arguments:
    """Return the arguments in the words of a command line.

    Args:
        kind: A dataclass; its fields, all with defaults, are the options. Its class variable `usual` names
            those that the short help shows, by default all but those of parts.
        words: What follows the command.
        default: Values of options that are not given; None = those of the dataclass.
        description: What the help begins with; None = the dataclass's docstring.

    Raises:
        UsageError: The words do not fit; the message is one line.
        SettingError: A value is not allowed.
        SystemExit: The help was asked for.
    """
    start = kind() if default is None else default
    options = options_of(kind, start)
    asked = next((place for place, word in enumerate(words) if word in _HELP), None)
    if asked is not None:
        topic = words[asked + 1] if asked + 1 < len(words) else None
        about = description or kind.__doc__ or ""
        print(help_text(_program(), about, options, getattr(kind, "usual", ()), topic))
        raise SystemExit(0)
    return overlaid(start, _given(options, words))


def given_values(kind: type, words: Sequence[str]) -> dict[str, Any]:
    """Return the values that a command line gives, by the names of fields; those of a dataclass within it.

    Args:
        kind: The dataclass of the command's arguments.
        words: What follows the command; `parse` takes them.
    """
    return _given(options_of(kind, kind()), words)


def _spelled(word: str) -> str:
    """Return a word in the spelling of argparse: hyphens in options, no exponent in negative numbers."""
    if word.startswith("--"):
        name, equals, value = word.partition("=")
        return name.replace("_", "-") + equals + value
    return format(Decimal(word), "f") if _NEGATIVE.fullmatch(word) else word


def _given(options: Iterable[Option], words: Sequence[str]) -> dict[str, Any]:
    """Return the values that words give to options, as a tree along the options' paths."""
    parser = LineParser(_program(), add_help=False, allow_abbrev=False, argument_default=argparse.SUPPRESS)
    for option in options:
        _add(parser, option)
    found, unknown = parser.parse_known_intermixed_args([_spelled(word) for word in words])
    if unknown and unknown[0].startswith("-"):
        raise UsageError(f"{unknown[0]}: no such option{_meant(unknown[0], options)}")
    if unknown:
        raise UsageError(f"{unknown[0]}: expected an option; see --help")
    tree: dict[str, Any] = {}
    for option in options:
        value = getattr(found, option.name, None)
        if value is None or (option.positional and value == []):
            continue
        inner = tree
        for name in option.path[:-1]:
            inner = inner.setdefault(name, {})
        inner[option.path[-1]] = _joined(option, value)
    return tree


def _meant(word: str, options: Iterable[Option]) -> str:
    """Return the end of the message about a word that is no option: what was probably meant."""
    flag = word.partition("=")[0]
    for option in options:
        if option.positional and flag == option.flag:
            return f"; its value stands alone: {_program()} {option.name.upper()}"
    flags = [option.flag for option in options if not option.positional]
    return did_you_mean(flag, flags) or "; see --help"


def _add(parser: argparse.ArgumentParser, option: Option) -> None:
    """Let a parser take an option."""
    values = option.values

    def read(word: str) -> Any:  # noqa: ANN401
        try:
            return values.read(word)
        except ValueError as error:
            raise argparse.ArgumentTypeError(f"{word!r}: expected {error}") from None

    if option.positional:
        parser.add_argument(
            option.name, nargs=values.count or "?", type=read, default=None, metavar=values.shown
        )
    elif option.kind is bool:
        parser.add_argument(option.flag, dest=option.name, action="store_const", const=True)
        parser.add_argument(option.opposite, dest=option.name, action="store_const", const=False)
    else:
        parser.add_argument(option.flag, dest=option.name, nargs=values.count, type=read)


def _joined(option: Option, value: Any) -> Any:  # noqa: ANN401
    """Return an option's value, combined from the values of its words."""
    joined = option.values.joined
    if joined is None:
        return value
    try:
        return joined(value)
    except ValueError as error:
        raise UsageError(f"{option.flag}: expected {error}; see --help {option.name}") from None


def overlaid(base: Any, changes: Mapping[str, Any]) -> Any:  # noqa: ANN401 - any dataclass
    """Return a dataclass with some fields changed, all at once; a mapping changes fields of a field."""
    values = {}
    for name, value in changes.items():
        own = getattr(base, name)
        inner = isinstance(value, Mapping) and dataclasses.is_dataclass(own)
        values[name] = overlaid(own, value) if inner else value
    return dataclasses.replace(base, **values)


def _program() -> str:
    """Return the command as it is typed, such as `python -m baselines.run`."""
    module = getattr(sys.modules["__main__"], "__spec__", None)
    return Path(sys.argv[0]).name if module is None else f"python -m {module.name.removesuffix('.__main__')}"


def run_command(main: Callable[[Sequence[str]], int], words: Sequence[str] | None = None) -> int:
    """Run a command's main function as `entropy_explore_env.command` does; a missing package is bad input.

    Args:
        main: Takes the words of the command line, returns an exit code.
        words: None = those of the process.
    """

    def with_extras(words: Sequence[str]) -> int:
        try:
            return main(words)
        except ModuleNotFoundError as error:
            raise UsageError(f"{error}: pip install 'entropy_explore_env[baselines]'") from None

    return command.run_command(with_extras, words)


def make_folder(option: str, folder: Path) -> None:
    """Make the folder that an option names, before anything is computed for nothing.

    Raises:
        SettingError: It cannot be made.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise SettingError(option, str(folder), f"a folder that can be made ({error.strerror})") from None


def print_json(results: dict[str, Any]) -> None:
    """Print exactly one JSON object on standard output."""
    print(json.dumps(results, indent=2, allow_nan=False))


def told_command(command: str, words: Sequence[str], leave_out: Sequence[str]) -> str:
    """Return a command line as pages tell it: without some options, and of files what tells them apart.

    Args:
        command: What the words follow.
        words: As they were typed.
        leave_out: Options with their values, such as `--out`.
    """
    told: list[str] = []
    left_out = False
    for word in words:
        if word.startswith("--"):
            left_out = word.split("=")[0].replace("_", "-") in leave_out
        if not left_out:
            told.append(word)
    files = [word for word in told if not word.startswith("-") and is_file(word)]
    names = dict(zip(files, distinct_paths([Path(file) for file in files]), strict=True))
    return " ".join([command, shlex.join(names.get(word, word) for word in told)]).strip()
