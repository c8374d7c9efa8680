"""Which packages the library needs, and which its extras bring: as its metadata, from pyproject.toml, say."""

from __future__ import annotations

import importlib.metadata
import re

from packaging.requirements import Requirement

_OURS = "entropy_explore_env"
_FOR_DEVELOPERS = ("test", "dev")
"""Extras for developers of the project: left out."""
_OF_EXTRA = re.compile(r"""\bextra == ["']([^"']+)["']""")


def needed() -> list[str]:
    """Return the packages that the library always needs; none where it is not installed."""
    return [each.name for each in _by_extra(_OURS).get(None, [])]


def extras() -> dict[str, list[str]]:
    """Return, by extra of the library, the packages that it brings.

    `ray[rllib]` brings what Ray's own extra needs, too, as far as Ray is there to tell. What an extra takes
    from another one of ours stands there.
    """
    return {
        extra: list(dict.fromkeys(each.name for each in brought)) for extra, brought in _brought().items()
    }


def pins() -> dict[str, dict[str, str]]:
    """Return, by extra of the library, the packages of which it takes one version alone, and this version."""
    found: dict[str, dict[str, str]] = {}
    for extra, brought in _brought().items():
        for each in brought:
            for clause in each.specifier:
                if clause.operator == "==":
                    found.setdefault(extra, {})[each.name] = clause.version
    return found


def _brought() -> dict[str, list[Requirement]]:
    """Return, by extra of the library, all that it brings."""
    found: dict[str, list[Requirement]] = {}
    for extra, listed in _by_extra(_OURS).items():
        own = [each for each in listed if each.name != _OURS]
        if extra is not None and extra not in _FOR_DEVELOPERS and own:
            more = [
                other for each in own for name in each.extras for other in _by_extra(each.name).get(name, [])
            ]
            found[extra] = [*own, *more]
    return found


def version_of(name: str) -> str | None:
    """Return the version of an installed package; None = it is not installed."""
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return None


def _by_extra(distribution: str) -> dict[str | None, list[Requirement]]:
    """Return, by extra or None, what a distribution needs for it here; nothing where it is not installed."""
    try:
        lines = importlib.metadata.requires(distribution) or []
    except importlib.metadata.PackageNotFoundError:
        return {}
    found: dict[str | None, list[Requirement]] = {}
    for line in lines:
        requirement, named = Requirement(line), _OF_EXTRA.search(line)
        extra = None if named is None else named[1]
        if requirement.marker is None or requirement.marker.evaluate({"extra": extra or ""}):
            found.setdefault(extra, []).append(requirement)
    return found
