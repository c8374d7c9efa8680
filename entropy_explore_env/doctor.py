"""What a report of a problem needs: versions, what of the extras is there, and where compiled kernels are.

`python -m entropy_explore_env doctor` prints it.
"""

from __future__ import annotations

import importlib.metadata
import json
import os
import platform
import re
import sys
import tempfile
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from packaging.requirements import Requirement

from entropy_explore_env.command import LineParser
from entropy_explore_env.compilation.announcement import short_path
from entropy_explore_env.compilation.folder import SUFFIX, kernel_folder
from entropy_explore_env.version import VERSION

_COMPILER = "llvmlite"
"""What Numba compiles with: of another version than Numba wants, kernels do not compile."""
_OURS = "entropy_explore_env"
_FOR_DEVELOPERS = ("test", "dev")
"""Extras for developers of the project: left out."""
_OF_EXTRA = re.compile(r"""\bextra == ["']([^"']+)["']""")


def main(words: Sequence[str]) -> int:
    """Run the command; return 1 where a problem is found, else 0."""
    about = "Print versions and what is installed and compiled, for reports of problems."
    parser = LineParser("python -m entropy_explore_env doctor", description=about)
    parser.add_argument("--json", action="store_true", help="print one JSON object and nothing else")
    given = parser.parse_args(words)
    found = findings()
    print(json.dumps(found) if given.json else report(found))
    return 1 if found["problems"] else 0


def findings() -> dict[str, Any]:
    """Return what there is, as plain values.

    Keys: `version`, `library` (its folder), `python`, `system`, `processors`; `packages` and `extras` (name →
    version, None where it is not installed); `pins` (extra → packages of which another version is installed
    than the only one that it takes, and this one); `kernels`: `folder`, whether it is `writable`, the number
    of `files` and of `mebibytes`, and `rooms` (packages of modules → files); `problems`, sentences.
    """
    folder = kernel_folder()
    kernels = _kernels(folder)
    packages = {name: version_of(name) for name in (*needed(), _COMPILER)}
    problems = [f"{name} is not installed" for name, version in packages.items() if version is None]
    if folder is None:
        problems.append("no folder for compiled kernels: set NUMBA_CACHE_DIR, or every process compiles anew")
    elif not kernels["writable"]:
        problems.append(f"{folder} cannot be written: set NUMBA_CACHE_DIR, or every process compiles anew")
    return {
        "version": VERSION,
        "library": str(Path(__file__).parent),
        "python": platform.python_version(),
        "system": platform.platform(),
        "processors": os.cpu_count(),
        "packages": packages,
        "extras": {extra: {name: version_of(name) for name in names} for extra, names in extras().items()},
        "pins": {
            extra: {name: pin for name, pin in versions.items() if version_of(name) not in (None, pin)}
            for extra, versions in pins().items()
        },
        "kernels": kernels,
        "problems": problems,
    }


def report(found: dict[str, Any]) -> str:
    """Return the findings as lines for people."""
    lines = [
        f"entropy_explore_env {found['version']} in {found['library']}",
        f"Python {found['python']} ({sys.executable}), {found['system']}, {found['processors']} processors",
        "packages: " + _named(found["packages"]),
    ]
    for extra, packages in found["extras"].items():
        missing = [name for name, version in packages.items() if version is None]
        missing += [f"{name} {pin}" for name, pin in found["pins"].get(extra, {}).items()]
        there = _named({name: version for name, version in packages.items() if version is not None})
        lines.append(f"extra {extra}: {there or 'not installed'}")
        if missing and there:
            lines[-1] += f"; lacks {', '.join(missing)}"
    if not found["extras"]:
        lines.append("extras: not known where the library runs from its folder without being installed")
    kernels = found["kernels"]
    if kernels["folder"] is not None:
        lines.append(
            f"compiled kernels: {kernels['files']} files, {kernels['mebibytes']:.1f} MiB, in "
            f"{short_path(Path(kernels['folder']))}"
        )
        lines += [f"  {room}: {files}" for room, files in kernels["rooms"].items()]
        if not kernels["files"]:
            lines.append("  none yet: the first step compiles them, or now entropy-explore-env warm")
    lines += [f"problem: {problem}" for problem in found["problems"]] or ["no problem found"]
    return "\n".join(lines)


def _named(packages: dict[str, str | None]) -> str:
    return ", ".join(f"{name} {version or 'missing'}" for name, version in packages.items())


def _kernels(folder: Path | None) -> dict[str, Any]:
    """Return what is in the folder of compiled kernels; of this version of the library, and of others."""
    found: dict[str, Any] = {"folder": None if folder is None else str(folder)}
    paths = sorted(folder.glob(f"*{SUFFIX}")) if folder is not None and folder.is_dir() else []
    rooms = Counter(".".join(path.name.rpartition("-")[0].split(".")[:2]) for path in paths)
    found["writable"] = folder is not None and _writable(folder)
    found["files"] = len(paths)
    found["mebibytes"] = sum(_size(path) for path in paths) / 2**20
    found["rooms"] = dict(sorted(rooms.items()))
    return found


def _size(path: Path) -> int:
    try:
        return path.stat().st_size
    except OSError:  # another process has just removed it
        return 0


def _writable(folder: Path) -> bool:
    """Return whether files can be made in it, or in the nearest folder above it that exists."""
    there = next((parent for parent in (folder, *folder.parents) if parent.exists()), None)
    if there is None or not there.is_dir():
        return False
    try:
        with tempfile.TemporaryFile(dir=there):
            return True
    except OSError:
        return False


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
