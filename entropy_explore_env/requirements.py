"""Which packages the library needs, and which its extras bring: as its metadata, from pyproject.toml, say."""

from __future__ import annotations

import importlib.metadata
import re
import sys
from collections.abc import Iterator
from typing import NamedTuple

_OURS = "entropy_explore_env"
_FOR_DEVELOPERS = ("test", "dev")
"""Extras for developers of the project: left out."""
_WRITTEN = re.compile(r"([\w.-]+)\s*(?:\[([^]]*)\])?([^;]*)(?:;(.*))?")
_PIN = re.compile(r"==\s*([\w.]+)$")
_CLAUSE = re.compile(r"""(\w+)\s*([<>=!]+)\s*["']([^"']*)["']""")


class Requirement(NamedTuple):
    """A package that a distribution needs here, in this version of Python."""

    name: str
    extras: tuple[str, ...]
    """Which of the package's own extras are needed."""
    extra: str | None
    """The extra of the distribution that needs it; None = it is always needed."""
    pin: str | None
    """The only version that does; None = others do, too."""


def needed() -> list[str]:
    """Return the packages that the library always needs; none where it is not installed."""
    return [each.name for each in _requirements(_OURS) if each.extra is None]


def extras() -> dict[str, list[str]]:
    """Extra of the library → the packages that it brings.

    `ray[rllib]` brings what Ray's own extra needs, too, as far as Ray is there to tell. What an extra takes
    from another one of ours stands there.
    """
    return {
        extra: list(dict.fromkeys(each.name for each in brought)) for extra, brought in _brought().items()
    }


def pins() -> dict[str, dict[str, str]]:
    """Extra of the library → the packages of which it takes one version alone, and this version."""
    exact = {
        extra: {each.name: each.pin for each in brought if each.pin is not None}
        for extra, brought in _brought().items()
    }
    return {extra: versions for extra, versions in exact.items() if versions}


def _brought() -> dict[str, list[Requirement]]:
    """Extra of the library → all that it brings."""
    found: dict[str, list[Requirement]] = {}
    for each in _requirements(_OURS):
        if each.extra is None or each.extra in _FOR_DEVELOPERS or each.name == _OURS:
            continue
        more = (other for other in _requirements(each.name) if other.extra in each.extras)
        found.setdefault(each.extra, []).extend((each, *more))
    return found


def version_of(name: str) -> str | None:
    """Return the version of an installed package; None = it is not installed."""
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return None


def _requirements(distribution: str) -> Iterator[Requirement]:
    """Yield what a distribution needs here; nothing where it is not installed."""
    try:
        lines = importlib.metadata.requires(distribution) or []
    except importlib.metadata.PackageNotFoundError:
        return
    for line in lines:
        written = _WRITTEN.match(line)
        clauses = [] if written is None else _CLAUSE.findall(written[4] or "")
        conditions = [clause for clause in clauses if clause[0] != "extra"]
        if written is None or not all(_holds(*condition) for condition in conditions):
            continue
        extra = next((value for name, _, value in clauses if name == "extra"), None)
        asked = tuple(word.strip() for word in (written[2] or "").split(",") if word.strip())
        pin = _PIN.search(written[3].strip())
        yield Requirement(written[1], asked, extra, None if pin is None else pin[1])


def _holds(name: str, compare: str, value: str) -> bool:
    """Whether a condition on the version of Python holds; others, such as on the system, count as not met."""
    if name != "python_version":
        return False
    here, there = sys.version_info[:2], tuple(int(part) for part in value.split(".")[:2])
    return {
        ">=": here >= there,
        ">": here > there,
        "<": here < there,
        "<=": here <= there,
        "==": here == there,
        "!=": here != there,
    }.get(compare, False)
