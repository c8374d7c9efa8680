"""Ctrl-C while a command still imports what it needs: one line and the exit code that it has later, too.

Imported first. `python -m` imports the packages around a module before it runs it; only then is its first
word "-m", so that programs that import the library get no hook.
"""

from __future__ import annotations

import sys
from pathlib import Path
from types import TracebackType

INTERRUPTED = 130
_SCRIPTS = "entropy-explore-"
"""What the names of the installed commands begin with."""


def is_command(word: str) -> bool:
    """Return whether a process whose first word is this one is just starting a command of ours."""
    return word == "-m" or Path(word).name.startswith(_SCRIPTS)


def end(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
    """Say what ended the process, as `sys.excepthook` does.

    Raises:
        SystemExit: The user interrupted it.
    """
    if not issubclass(kind, KeyboardInterrupt):
        sys.__excepthook__(kind, error, trace)
        return
    print("interrupted", file=sys.stderr)
    raise SystemExit(INTERRUPTED)


if is_command(sys.argv[0] if sys.argv else ""):
    sys.excepthook = end
