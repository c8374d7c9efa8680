"""Which code makes a result: a digest of the meaning of every module of ours that the result comes from.

The meaning of a module is its syntax tree without docstrings. An edit of a comment, of a docstring or of the
layout keeps what was computed; any other edit of a module that is imported, however far away, does not. The
tree differs from one version of Python to the next.
"""

from __future__ import annotations

import ast
import hashlib
import importlib.util
import multiprocessing
import pkgutil
import sys
from collections.abc import Callable, Iterator, Mapping
from functools import cache, lru_cache, partial
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

from baselines import strategies
from baselines.experiments import PROCESS_STARTED_NS
from baselines.strategies import loading

PACKAGES = ("entropy_explore_env", "baselines", "training")
"""Packages whose modules count; those of a strategy from elsewhere do, too."""
_TABLE = (strategies.__name__, f"{strategies.__name__}.table")
_INSTALLED = ("site-packages", "dist-packages")


class CodeChangedError(RuntimeError):
    """Code was edited while the results that it makes were being computed."""


def code_digest(*modules: str, strategy: str | None = None) -> str:
    """Digest of some modules, of a strategy, and of all modules of ours that they import.

    Other strategies are not part of it: where the modules import the table of strategies, the named one
    counts. Of a learned policy its weights count, and what runs it. A package's `__init__` counts where it is
    imported by name.

    Args:
        modules: Names of modules.
        strategy: Name of a strategy.

    Raises:
        CodeChangedError: In a worker process: a file was edited after the process started, so that what it
            imported may not be what the file says.
    """
    files: dict[str, Path] = {}
    for module in modules:
        files |= imported(module, skipped=_TABLE)
    hasher = hashlib.sha256()
    if strategy is not None and strategies.is_learned(strategy):
        policies = strategies.learned_policies()
        files |= imported(policies.__name__, skipped=_TABLE)
        for file in policies.policy_files(strategy):
            hasher.update(file.read_bytes())
    elif strategy is not None:
        files |= imported(strategies.strategy_module(strategy))
        maker = strategies.scripted_maker(strategies.resolved(strategy))
        if maker is None:
            files |= imported(loading.__name__)  # with the driver of rules that are functions
        hasher.update(repr(strategy.rpartition(":")[2] if maker is None else _described(maker)).encode())
    for name, file in sorted(files.items()):
        hasher.update(f"{name} {_module(file).digest}\n".encode())
    return hasher.hexdigest()


def _described(maker: Callable[..., Any]) -> tuple[Any, ...]:
    """Which class or function makes a strategy, and with which settings."""
    if isinstance(maker, partial):
        return (*_described(maker.func), maker.args, sorted(maker.keywords.items()))
    return (maker.__module__, maker.__qualname__)


class _Import(NamedTuple):
    """An import statement: dots before the module, the module, and what is taken from it."""

    level: int
    module: str
    names: tuple[str, ...]


class _Module(NamedTuple):
    """A module's meaning, and what it imports."""

    digest: str
    imports: tuple[_Import, ...]


@cache
def _module(file: Path) -> _Module:
    """A module as this process has it, or would import it."""
    in_worker = multiprocessing.parent_process() is not None
    if in_worker and file.stat().st_mtime_ns > PROCESS_STARTED_NS:
        raise CodeChangedError(f"{file} was edited after this process had started")
    tree = ast.parse(file.read_text(encoding="utf-8"))
    imports = tuple(_imports(tree))
    return _Module(hashlib.sha256(meaning(tree).encode()).hexdigest(), imports)


def meaning(tree: ast.Module) -> str:
    """A syntax tree as text; docstrings and other text that stands alone are taken out of the tree."""
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        if isinstance(body, list):
            node.body = [part for part in body if not _is_text(part)]  # type: ignore[attr-defined]
    return ast.dump(tree)


def _is_text(part: ast.AST) -> bool:
    if not isinstance(part, ast.Expr) or not isinstance(part.value, ast.Constant):
        return False
    return isinstance(part.value.value, str)


def _imports(tree: ast.Module) -> Iterator[_Import]:
    """What a module imports anywhere in it."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (_Import(0, alias.name, ()) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield _Import(node.level, node.module or "", tuple(alias.name for alias in node.names))


@lru_cache(maxsize=256)
def imported(source: str | Path, skipped: tuple[str, ...] = ()) -> Mapping[str, Path]:
    """A module and all modules of ours that it imports, however far away.

    Args:
        source: The module's name, or its file. Where it is none of ours, the modules of its package count as
            well, or those beside its file.
        skipped: Names of modules that are left out, with what only they import.

    Returns:
        Name → file.
    """
    home = _home(source)
    if isinstance(source, Path):
        found, waiting = {source.name: source}, list(_named(source.name, source))
    else:
        found, waiting = dict[str, Path](), [source]
    while waiting:
        name = waiting.pop()
        file = None if name in found or name in skipped else _located(name, home)
        if file is not None:
            found[name] = file
            waiting += _named(name, file)
    return MappingProxyType(found)


def _named(module: str, file: Path) -> Iterator[str]:
    """Names that a module imports; of `from a import b` both a and a.b, which may be no module."""
    package = module if file.name == "__init__.py" else module.rpartition(".")[0]
    for each in _module(file).imports:
        above = package.split(".")[: package.count(".") + 2 - each.level] if each.level else []
        name = ".".join(part for part in (*above, each.module) if part)
        yield name
        yield from (f"{name}.{taken}" for taken in each.names)


class _Home(NamedTuple):
    """Where modules that are none of ours count: a folder, and the package in it; None = any module."""

    folder: Path
    package: str | None


def _home(source: str | Path) -> _Home | None:
    """Whose modules count with a source; None = no more than PACKAGES."""
    if isinstance(source, str) and source.split(".")[0] in PACKAGES:
        return None
    file = source if isinstance(source, Path) else _file_of(source)
    assert file is not None, source
    name = "" if isinstance(source, Path) else source
    depth = name.count(".") + (file.name == "__init__.py")
    if depth == 0 and file.parent.name in _INSTALLED:
        return None
    return _Home(file.parents[depth], name.split(".")[0] if depth else None)


def _located(name: str, home: _Home | None) -> Path | None:
    """The file of a module whose code counts; None for any other name."""
    top = name.split(".")[0]
    if top in PACKAGES:
        return _file_of(name)
    if home is None or home.package not in (None, top):
        return None
    place = home.folder.joinpath(*name.split("."))
    files = (place.with_suffix(".py"), place / "__init__.py")
    return next((file for file in files if name and file.is_file()), None)


def modules_of(package: str) -> tuple[str, ...]:
    """Names of the modules that lie in a package."""
    file = _file_of(package)
    assert file is not None, package
    return tuple(f"{package}.{each.name}" for each in pkgutil.iter_modules([str(file.parent)]))


@cache
def _file_of(name: str) -> Path | None:
    """Source file of a module; None = there is no such module, or it has no Python source."""
    loaded = getattr(sys.modules.get(name), "__file__", None)
    if loaded is None:
        try:
            spec = importlib.util.find_spec(name)
        except (ImportError, ValueError):  # its parent is no package; `__main__` has no spec
            return None
        loaded = None if spec is None else spec.origin
    return Path(loaded) if loaded is not None and loaded.endswith(".py") else None
