"""The form that all commands share: arguments from a dataclass, results out, progress and errors aside.

Results go to standard output (with `--json` exactly one JSON object), progress to standard error.
Exit codes: 0 done, 1 a claim or goal does not hold where `--strict` asked, 2 bad input, 130
interrupted.
"""

from __future__ import annotations

import contextlib
import io
import json
import os
import re
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from entropy_explore_env.errors import EntropyExploreError, MissingExtraError, SettingError

if TYPE_CHECKING:
    from tyro.conf import OmitArgPrefixes, Positional
else:
    try:
        from tyro.conf import OmitArgPrefixes, Positional
    except ImportError:  # `parse` says what is missing

        class Positional:
            """Stands in for tyro's."""

            def __class_getitem__(cls, kind: type) -> type:
                """The kind itself."""
                return kind

        OmitArgPrefixes = Positional

__all__ = ["OmitArgPrefixes", "Positional"]  # for the commands
Arguments = TypeVar("Arguments")

BAD_INPUT = 2
INTERRUPTED = 130
_FRAME = re.compile(r"[─-╿]+")
_TITLE = re.compile(r"^(Unrecognized options|Invalid choice|Value error|Parsing error|Required options) ")
"""What stands on the parser's frame; the message says it again."""


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
            return tyro.cli(kind, prog=_program(), args=list(words), description=description, default=start)
    except SystemExit as stop:
        if stop.code in (0, None):
            raise
        raise UsageError(_one_line(complaint.getvalue())) from None


def _program() -> str:
    """How the command was started, as one types it."""
    module = getattr(sys.modules["__main__"], "__spec__", None)
    return Path(sys.argv[0]).name if module is None else f"python -m {module.name}"


class UsageError(EntropyExploreError):
    """The words of a command line do not fit its options."""


def _one_line(complaint: str) -> str:
    """The parser's framed message as one line."""
    words = " ".join(_FRAME.sub(" ", complaint).split())
    words = _TITLE.sub("", words)
    return words.split(" For full helptext")[0] or "the arguments do not fit; see --help"


def run_command(main: Callable[[Sequence[str]], int], words: Sequence[str] | None = None) -> int:
    """Run a command's main function; its errors become one line on standard error and an exit code.

    Args:
        main: Takes the words of the command line, returns an exit code.
        words: None = those of the process.
    """
    try:
        return main(sys.argv[1:] if words is None else words)
    except EntropyExploreError as error:
        print("error: " + " ".join(str(error).split()), file=sys.stderr)
        return BAD_INPUT
    except BrokenPipeError:  # whoever read our output has seen enough
        sys.stdout = Path(os.devnull).open("w")
        return 0
    except ModuleNotFoundError as error:
        print(f"error: {error}: pip install 'entropy_explore_env[baselines]'", file=sys.stderr)
        return BAD_INPUT
    except OSError as error:
        print(f"error: {error}", file=sys.stderr)
        return BAD_INPUT
    except MemoryError as error:
        print(f"error: not enough memory: {error}", file=sys.stderr)
        return BAD_INPUT
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return INTERRUPTED


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
