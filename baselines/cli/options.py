"""The options of a command line, read off a dataclass: their names, the values that they take, their texts.

An option of a dataclass within another one is called `--robot.reach-m`; without the prefix where the field is
annotated as Mark.INLINE. Its text is the string below the field, or the field's entry in the docstring.
"""

from __future__ import annotations

import dataclasses
import types
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import Enum
from functools import cache, cached_property
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple, Union, get_args, get_origin, get_type_hints

from entropy_explore_env.command import home_path, whole_number
from entropy_explore_env.errors import MissingExtraError, one_of


class Mark(Enum):
    """What `Annotated[…, Mark.…]` says of a field."""

    INLINE = "the options of this dataclass have no prefix"
    POSITIONAL = "the option is a word without a flag"


class Values(NamedTuple):
    """The words that an option takes, and how they become its value."""

    count: int | str | None
    """Number of words: None = one, "*" = any."""
    read: Callable[[str], Any]
    """Turns a word into a value; its ValueError says what is expected."""
    shown: str
    """Stands for a word in the help."""
    joined: Callable[[list[Any]], Any] | None = None
    """Combines the values of the words into the option's value; None for a single word."""


class Part(NamedTuple):
    """A dataclass among the fields of a command's arguments: the options within it have one heading."""

    name: str
    text: str


@dataclass(frozen=True)
class Option:
    """An option of a command.

    Attributes:
        path: Names of the fields that lead to it.
        name: Name with prefixes, as in `robot.reach_m`.
        part: Where it belongs, such as `robot`; None for the command's own.
        kind: Type of its value.
        default: Value where it is not given.
        owner: The dataclass that has it as a field.
        notes: What the help says of it after the field's own text.
        positional: Whether it has no flag.
    """

    path: tuple[str, ...]
    name: str
    part: Part | None
    kind: Any
    default: Any
    owner: type
    notes: tuple[str, ...] = ()
    positional: bool = False

    @property
    def flag(self) -> str:
        """Flag such as `--robot.reach-m`."""
        return "--" + self.name.replace("_", "-")

    @property
    def opposite(self) -> str:
        """Flag that switches a bool off, such as `--robot.no-tilts`."""
        prefix, dot, last = self.flag[2:].rpartition(".")
        return f"--{prefix}{dot}no-{last}"

    @property
    def text(self) -> str:
        """What the help says of it."""
        return "\n".join([_texts(self.owner).get(self.path[-1], ""), *self.notes]).strip()

    @cached_property
    def values(self) -> Values:
        """The words that it takes."""
        return values_of(self.kind)


def options_of(kind: type, default: Any) -> list[Option]:  # noqa: ANN401 - an instance of the dataclass
    """Return the options in the fields of a dataclass, and in dataclasses within it, with their defaults.

    Raises:
        MissingExtraError: The parser of docstrings, which the help needs, is not installed.
    """
    if find_spec("docstring_parser") is None:
        raise MissingExtraError("docstring_parser", "baselines")
    return list(_options_of(kind, default, (), "", None))


def _options_of(
    kind: type,
    default: Any,  # noqa: ANN401
    path: tuple[str, ...],
    prefix: str,
    part: Part | None,
) -> Iterator[Option]:
    hints = get_type_hints(kind, include_extras=True)
    for field in dataclasses.fields(kind):
        hint, notes = hints[field.name], []
        if get_origin(hint) is Annotated:
            hint, *notes = get_args(hint)
        here, value = (*path, field.name), getattr(default, field.name)
        if dataclasses.is_dataclass(hint):
            inner = prefix if Mark.INLINE in notes else f"{prefix}{field.name}."
            within = part  # what is in a part with a prefix, such as robot.localization, belongs to it
            if not prefix:
                text = (hint.__doc__ or "").partition("\n")[0]
                within = Part(field.name.replace("_", "-"), text)
            yield from _options_of(hint, value, here, inner, within)  # type: ignore[arg-type]
            continue
        said = tuple(note for note in notes if isinstance(note, str))
        name = prefix + field.name
        yield Option(here, name, part, hint, value, kind, said, Mark.POSITIONAL in notes)


@cache
def _texts(kind: type) -> dict[str, str]:
    """Return what a dataclass says of its fields, one line each; reading the source takes a while."""
    from docstring_parser import parse_from_object

    texts: dict[str, str] = {}
    for parent in reversed(kind.__mro__):
        if dataclasses.is_dataclass(parent):
            for entry in parse_from_object(parent).params:
                text = " ".join((entry.description or "").split())
                texts |= dict.fromkeys(entry.arg_name.split(", "), text)
    return texts


def values_of(kind: Any) -> Values:  # noqa: ANN401 - any type
    """Return how the words of a command line become values of a type.

    Raises:
        TypeError: No words stand for values of this type.
    """
    origin, inner = get_origin(kind), get_args(kind)
    if origin in (Union, types.UnionType):
        kinds = [values_of(each) for each in inner if each is not type(None)]
        return kinds[0] if len(kinds) == 1 else _either(kinds)
    if origin is Literal:
        return Values(None, lambda word: _choice(word, inner), "{" + ",".join(inner) + "}")
    if origin in (tuple, list):
        of = values_of(inner[0])
        many = origin is list or inner[-1] is Ellipsis
        if of.joined is not None and many:
            return Values("*", of.read, of.shown, lambda values: _grouped(values, of))
        return Values("*" if many else len(inner), of.read, of.shown, origin)
    if kind not in _SIMPLE:
        raise TypeError(f"{kind} has no words")
    return _SIMPLE[kind]


def _reading(read: Callable[[str], Any], expected: str) -> Callable[[str], Any]:
    """Return a function that reads a word, and whose ValueError says what is expected."""

    def reads(word: str) -> Any:  # noqa: ANN401
        try:
            return read(word)
        except ValueError:
            raise ValueError(expected) from None

    return reads


_SIMPLE = {
    int: Values(None, _reading(whole_number, "a whole number"), "INT"),
    float: Values(None, _reading(float, "a number"), "FLOAT"),
    str: Values(None, str, "TEXT"),
    Path: Values(None, _reading(home_path, "a path; there is no such home folder"), "PATH"),
    bool: Values(0, bool, ""),
}


def _either(kinds: list[Values]) -> Values:
    """Return how words become values of several types: the first type that accepts a word reads it."""

    def read(word: str) -> Any:  # noqa: ANN401
        expected = []
        for kind in kinds:
            try:
                return kind.read(word)
            except ValueError as error:
                expected.append(str(error))
        raise ValueError(", or ".join(expected))

    return Values(None, read, "|".join(kind.shown for kind in kinds))


def _choice(word: str, known: tuple[str, ...]) -> str:
    if word not in known:
        raise ValueError(one_of(word, known))
    return word


def _grouped(values: list[Any], of: Values) -> tuple[Any, ...]:
    """Group values into tuples of equal length, such as places (x, y, z).

    Raises:
        ValueError: The last tuple is incomplete.
    """
    assert of.joined is not None and isinstance(of.count, int)
    if len(values) % of.count:
        raise ValueError(f"{of.count} numbers each")
    return tuple(of.joined(values[at : at + of.count]) for at in range(0, len(values), of.count))
