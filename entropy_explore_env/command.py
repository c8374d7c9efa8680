"""What all commands have in common: errors as one line on standard error, and the exit codes.

Exit codes: 0 done, 1 a check of the command failed, 2 bad input, 130 interrupted.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import math
import os
import sys
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NoReturn

from entropy_explore_env.errors import EntropyExploreError, SettingError, WorldWarning
from entropy_explore_env.starting import INTERRUPTED

BAD_INPUT = 2

READ_MEMORY_VARIABLE = "ENTROPY_EXPLORE_READ_MEMORY_MIB"
"""Variable of the environment with the memory limit, in MiB, of reading world files that are given none."""


def allow_read_memory(read_memory_mib: float | None) -> None:
    """Let this process, and those it starts, take this much memory to read a world file; None = as before.

    Raises:
        SettingError: It is no finite number > 0.
    """
    if read_memory_mib is None:
        return
    if not 0 < read_memory_mib < math.inf:
        raise SettingError("read_memory_mib", read_memory_mib, "a number of MiB > 0")
    os.environ[READ_MEMORY_VARIABLE] = str(read_memory_mib)


def whole_number(word: str) -> int:
    """Return a whole number as one types it: `2500000`, `2_500_000`, `2.5e6` or `1e6`.

    Raises:
        ValueError: It is something else.
    """
    for kind in (int, float):  # a float holds 2^53 and above only roughly, an int exactly
        with contextlib.suppress(ValueError):
            value = kind(word)
            if value == value // 1:
                return int(value)
    raise ValueError(f"{word} is not a whole number")


def home_path(word: str) -> Path:
    """Return a path as one types it, `~` at its beginning standing for the home folder.

    Raises:
        ValueError: There is no such home folder.
    """
    try:
        return Path(word).expanduser()
    except RuntimeError as error:
        raise ValueError(f"{word}: {error}") from None


def is_file(word: str) -> bool:
    """Return whether a word is the path of a file, as one types it."""
    try:
        return home_path(word).is_file()
    except (OSError, ValueError):
        return False


class UsageError(EntropyExploreError):
    """The arguments of a command line do not fit its options."""


class LineParser(argparse.ArgumentParser):
    """An argument parser whose errors are one line; whole numbers may be typed as 1e6, paths with `~`."""

    def __init__(self, *args: Any, **more: Any) -> None:  # noqa: ANN401 - argparse's
        """Take words as all commands do."""
        super().__init__(*args, **more)
        self.register("type", int, whole_number)
        self.register("type", Path, home_path)

    def error(self, message: str) -> NoReturn:
        """Raise a UsageError, for `run_command` to print."""
        raise UsageError(f"{message}; see --help")


def _showing_worlds_in_a_line(show: Callable[..., None]) -> Callable[..., None]:
    """Return a function that shows warnings as `show` does, those about world files in one line."""

    def shown(message: Warning | str, category: type[Warning], *more: Any) -> None:  # noqa: ANN401 - as Python's
        if issubclass(category, WorldWarning):
            print(f"warning: {message}", file=sys.stderr)
        else:
            show(message, category, *more)

    return shown


def run_command(main: Callable[[Sequence[str]], int], words: Sequence[str] | None = None) -> int:
    """Run a command's main function; its errors become one line on standard error and an exit code.

    Characters that a terminal does not have, as one of ASCII has no σ, are written as question marks.

    Args:
        main: Takes the arguments of the command line, returns an exit code.
        words: The arguments; None = those of the process.
    """
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper) and stream.errors == "strict":
            stream.reconfigure(errors="replace")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("always", WorldWarning)
            warnings.showwarning = _showing_worlds_in_a_line(warnings.showwarning)
            return main(sys.argv[1:] if words is None else words)
    except EntropyExploreError as error:
        print("error: " + " ".join(str(error).split()), file=sys.stderr)
        return BAD_INPUT
    except BrokenPipeError:  # the reader of our output has closed it
        sys.stdout = Path(os.devnull).open("w")
        return 0
    except OSError as error:
        where = "" if error.filename is None else f"{error.filename}: "
        print(f"error: {where}{error.strerror or error}", file=sys.stderr)
        return BAD_INPUT
    except MemoryError as error:
        print(f"error: not enough memory: {error}", file=sys.stderr)
        return BAD_INPUT
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return INTERRUPTED
