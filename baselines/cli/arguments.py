"""The form of the commands here: arguments from a dataclass, results out, progress and errors aside.

Results go to standard output (with `--json` exactly one JSON object), progress to standard error. Exit codes
are those of `entropy_explore_env.command`; 1: a claim or goal does not hold where `--strict` asked.
"""

from __future__ import annotations

import contextlib
import dataclasses
import io
import json
import re
import shlex
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

from entropy_explore_env import command
from entropy_explore_env.command import UsageError, home_path, whole_number, with_meant
from entropy_explore_env.errors import MissingExtraError, SettingError
from entropy_explore_env.worlds.given import distinct_paths

if TYPE_CHECKING:
    from tyro.conf import OmitArgPrefixes, Positional

    WholeNumber = int
    INLINE: Any
    ONCE_WORLD: Any
    _WHOLE: Any
    _PATH: Any
else:
    try:
        from tyro.conf import OmitArgPrefixes, Positional, arg
        from tyro.constructors import PrimitiveConstructorSpec

        _WHOLE = PrimitiveConstructorSpec(
            nargs=1,
            metavar="INT",
            instance_from_str=lambda words: whole_number(words[0]),
            is_instance=lambda value: isinstance(value, int) and not isinstance(value, bool),
            str_from_instance=lambda value: [str(value)],
        )
        _PATH = PrimitiveConstructorSpec(
            nargs=1,
            metavar="PATH",
            instance_from_str=lambda words: home_path(words[0]),
            is_instance=lambda value: isinstance(value, Path),
            str_from_instance=lambda value: [str(value)],
        )
        WholeNumber = Annotated[int, _WHOLE]
        """Of a field: an int that may also be typed as 1e6, as all ints of commands may."""
        INLINE = arg(name="")
        """`Annotated[Options, INLINE]`: the options of a dataclass without the field's name before theirs."""
        ONCE_WORLD = arg(aliases=("--world",))
        """`Annotated[str, ONCE_WORLD]`: an option that was `--world`, which is still taken."""
    except ImportError:  # `parse` says what is missing

        class Positional:
            """Stands in for tyro's."""

            def __class_getitem__(cls, kind: type) -> type:
                """The kind itself."""
                return kind

        OmitArgPrefixes, WholeNumber, INLINE, ONCE_WORLD = Positional, int, None, None

Arguments = TypeVar("Arguments")

_FRAME = re.compile(r"[─-╿]+|-{4,}")
"""The lines around the parser's message, also where a terminal has no characters for them."""
_TITLE = re.compile(r"^(Unrecognized options|Invalid choice|Value error|Parsing error|Required options) ")
"""What stands on the parser's frame; the message says it again."""
_HELP = re.compile(r" Argument helptext: .*?(?= For full helptext|$)")
"""The text of the option that was wrong: `--help` has it."""


_MEANT = re.compile(r" Perhaps you meant: (--[\w.-]+).*")
"""An option that is like the one that is none, with its help."""


def option_help(text: str) -> Any:  # noqa: ANN401 - tyro's
    """Return the annotation that gives an option a computed help text."""
    try:
        from tyro.conf import arg
    except ImportError:  # `parse` says what is missing
        return None
    return arg(help=text)


def parse(
    kind: type[Arguments],
    words: Sequence[str],
    default: Arguments | None = None,
    description: str | None = None,
) -> Arguments:
    """Arguments from the words of a command line.

    Args:
        kind: A dataclass; its fields, all with defaults, are the options.
        words: What follows the command.
        default: Values for what is not given; None = those of the dataclass.
        description: The first line of the help.

    Raises:
        UsageError: The words do not fit; the message is one line.
        SystemExit: The help was asked for.
    """
    try:
        import tyro
    except ImportError:
        raise MissingExtraError("tyro", "baselines") from None
    complaint = io.StringIO()
    try:
        with contextlib.redirect_stderr(complaint):
            start = kind() if default is None else default
            return tyro.cli(
                kind,
                prog=_program(),
                args=list(words),
                description=description,
                default=start,
                registry=_registry(),
                config=(tyro.conf.DisallowNone,),  # options that are not given are None: nobody types it
            )
    except SystemExit as stop:
        if stop.code in (0, None):
            raise
        raise UsageError(_one_line(complaint.getvalue())) from None


def _registry() -> Any:  # noqa: ANN401 - tyro comes late
    """How fields of a kind are typed in all commands: whole numbers also as 1e6, paths also with `~`."""
    from tyro.constructors import ConstructorRegistry

    registry = ConstructorRegistry()
    registry.primitive_rule(lambda field: {int: _WHOLE, Path: _PATH}.get(field.type))
    return registry


def _program() -> str:
    """How the command was started, as one types it."""
    module = getattr(sys.modules["__main__"], "__spec__", None)
    return Path(sys.argv[0]).name if module is None else f"python -m {module.name.removesuffix('.__main__')}"


def _one_line(complaint: str) -> str:
    """The parser's framed message as one line; tyro 1.0 has errors as values in a private module only."""
    words = " ".join(_FRAME.sub(" ", complaint).split())
    words = _TITLE.sub("", words)
    words = _MEANT.sub(r"; did you mean \1?", _HELP.sub("", words))
    return with_meant(words.split(" For full helptext")[0]) or "the arguments do not fit; see --help"


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
    files = [word for word in told if Path(word).expanduser().is_file()]
    names = dict(zip(files, distinct_paths([Path(file) for file in files]), strict=True))
    return " ".join([command, shlex.join(names.get(word, word) for word in told)]).strip()


def given_options(args: Any, leave_out: Sequence[str] = ()) -> list[str]:  # noqa: ANN401 - any dataclass
    """The options that differ from their defaults as words of a command line; of paths, the file's name.

    Args:
        args: A dataclass of options.
        leave_out: Names of fields.
    """
    words: list[str] = []
    for each in dataclasses.fields(args):
        value = getattr(args, each.name)
        if each.name in leave_out or value == each.default:
            continue
        words.append("--" + each.name.replace("_", "-"))
        if value is not True:
            words += [_word(part) for part in (value if isinstance(value, tuple) else (value,))]
    return words


def _word(value: object) -> str:
    if isinstance(value, Path):
        return value.name
    return f"{value:g}" if isinstance(value, float) else str(value)
