"""The errors of the package: each names a field, its value and what is expected."""

from __future__ import annotations

import difflib
import importlib
import pickle
from collections.abc import Iterable
from typing import Any

CPU_BUILD = "https://download.pytorch.org/whl/cpu"
"""Index of PyTorch's CPU build: what other indices have brings gigabytes of CUDA libraries."""
_WITH_TORCH = ("training", "rllib")
"""Extras that need PyTorch."""
_LONGEST_VALUE = 200
"""Characters of a value that a message shows at most."""


def shown(value: object) -> str:
    """Return a value in one line of a message; of one that cannot be shown, what kind it is."""
    try:
        text = " ".join(repr(value).split())
    except Exception:  # a repr of somebody else's, or a whole number of too many digits
        text = f"<{type(value).__name__}>"
    return text if len(text) <= _LONGEST_VALUE else text[:_LONGEST_VALUE] + " …"


class ShownValue:
    """Stands for a value that cannot be pickled, such as a function without a name; it looks the same."""

    def __init__(self, shown: str) -> None:
        """Keep what `repr` shows."""
        self.shown = shown

    def __repr__(self) -> str:
        """Return what `repr` showed of the value."""
        return self.shown


def _passed_on(value: object) -> object:
    """Return the value, if it can be pickled and restored."""
    try:
        pickle.loads(pickle.dumps(value))
    except Exception:  # objects may raise whatever they want
        return ShownValue(shown(value))
    return value


def did_you_mean(word: object, known: Iterable[str]) -> str:
    """Return the known name most like a word, as the end of a message; empty where none is like it.

    Names that begin with the word, such as `loss_probability` for `loss`, come first; of equally good names
    two are named.
    """
    if not isinstance(word, str):
        return ""
    names = list(known)
    alike = [name for name in names if name.startswith((f"{word}_", f"{word}-"))]
    if not alike:
        near = difflib.get_close_matches(word, names, n=2)
        ratios = [difflib.SequenceMatcher(None, name, word).ratio() for name in near]
        alike = [name for name, ratio in zip(near, ratios, strict=True) if ratio == ratios[0]]
    return f"; did you mean {' or '.join(alike[:2])}?" if alike else ""


def one_of(value: object, known: Iterable[str]) -> str:
    """Return what is expected of a value that has to be one of some names; ends with the likeliest."""
    names = list(known)
    return "one of " + ", ".join(names) + did_you_mean(value, names)


def counted(number: int, noun: str) -> str:
    """Return how many there are of something, as in `1 robot` and `3 robots`."""
    return f"{number} {noun}{'s' * (number != 1)}"


class EntropyExploreError(ValueError):
    """A request of the caller that cannot be met; the message is one line."""


class SettingError(EntropyExploreError):
    """A setting is unknown, of the wrong kind or out of its range."""

    def __init__(self, field: str, value: object, allowed: str) -> None:
        """Take the field, its value and what is expected of it."""
        super().__init__(f"{field} = {shown(value)}: expected {allowed}")
        self.field, self.value, self.allowed = field, value, allowed

    def __reduce__(self) -> tuple[type, tuple[str, object, str]]:
        """Restore the error in another process, with what is shown of a value that cannot go there."""
        return type(self), (self.field, _passed_on(self.value), self.allowed)


class ActionError(SettingError):
    """An action has the wrong shape or type, is not finite, or its robot is missing."""


class WorldError(SettingError):
    """A world cannot be used: a file that is missing or broken, or no room for the robots."""


class WorldWarning(UserWarning):
    """A world file was read in a way that its author may not have meant."""


class RecordError(SettingError):
    """A mission record cannot be used: missing, broken, edited or of another format."""


class CallOrderError(EntropyExploreError):
    """A call came at the wrong time: `step` before `reset`, or after the mission's end."""


class MissingExtraError(EntropyExploreError, ImportError):
    """An optional package is needed; the message names the extra that installs it."""

    def __init__(self, package: str, extra: str) -> None:
        """Name the package that is missing and the extra that brings it."""
        first = f"pip install torch --index-url {CPU_BUILD} (for CUDA: pip install torch), then "
        how = f"{first if extra in _WITH_TORCH else ''}pip install 'entropy_explore_env[{extra}]'"
        super().__init__(f"{package} is not installed: {how}")
        self.package, self.extra = package, extra

    def __reduce__(self) -> tuple[type, tuple[str, str]]:
        """Restore the error in another process."""
        return type(self), (self.package, self.extra)


def imported(module: str, package: str, extra: str) -> Any:  # noqa: ANN401 - a module
    """Return a module of a package that one of our extras brings.

    Raises:
        MissingExtraError: It is not installed.
    """
    try:
        return importlib.import_module(module)
    except ImportError:
        raise MissingExtraError(package, extra) from None
