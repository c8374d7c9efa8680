"""What code a strategy's missions come from, as one digest: results of other code are not taken for ours."""

from __future__ import annotations

import ast
import hashlib
import importlib.util
from collections.abc import Callable, Iterator
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import entropy_explore_env
from baselines import strategies


def sources_digest(strategy: str, *modules: str) -> str:
    """Digest of the library, of a strategy with all that it imports of `baselines`, and of some modules.

    Other strategies are not part of it, so that a new one leaves the results of the old ones in place. Of a
    learned policy its weights count, and what runs it.

    Args:
        strategy: Its name.
        modules: Names of what else makes the results; of what they import, what lies in a package with them
            inside `baselines` counts.
    """
    files = {_file_of(name) for module in modules for name in _with_neighbours(module)}
    if strategies.is_learned(strategy):
        policies = strategies.learned_policies()
        files |= set(policies.policy_files(strategy))
        described: tuple[Any, ...] = (policies.__name__,)
    else:
        source = strategies.strategy_module(strategy)
        if isinstance(source, Path):
            modules_used = _imports(ast.parse(source.read_text()))
            files |= {source, *(_file_of(each) for name in modules_used for each in imported(name))}
        else:
            files |= {_file_of(name) for name in imported(source)}
        made_by = strategies.STRATEGIES.get(strategy)
        described = (strategy,) if made_by is None else _described(made_by)
    hasher = hashlib.sha256(_library_digest() + repr(described).encode())
    for file in sorted(files):
        hasher.update(file.read_bytes())
    return hasher.hexdigest()


def _with_neighbours(module: str) -> set[str]:
    """A module, and what it imports of a package inside `baselines` that it is part of."""
    package = module.rpartition(".")[0]
    beside = imported(module) if package.startswith("baselines.") else ()
    return {module, *(name for name in beside if name.startswith(package + "."))}


@lru_cache(maxsize=1)
def _library_digest() -> bytes:
    hasher = hashlib.sha256()
    for file in sorted(Path(entropy_explore_env.__file__).parent.rglob("*.py")):
        hasher.update(file.read_bytes())
    return hasher.digest()


def _described(made_by: Callable[..., Any]) -> tuple[Any, ...]:
    """Which class or function makes a strategy, and with which settings."""
    if isinstance(made_by, partial):
        return (*_described(made_by.func), made_by.args, sorted(made_by.keywords.items()))
    return (made_by.__module__, made_by.__qualname__)


def _file_of(module: str) -> Path:
    spec = importlib.util.find_spec(module)
    assert spec is not None and spec.origin is not None
    return Path(spec.origin)


@lru_cache(maxsize=64)
def imported(module: str) -> frozenset[str]:
    """A module and all modules of `baselines` that it imports, however far away."""
    found: set[str] = set()
    waiting = [module]
    while waiting:
        name = waiting.pop()
        if name not in found:
            found.add(name)
            waiting += _imports(ast.parse(_file_of(name).read_text()))
    return frozenset(found)


def _imports(tree: ast.Module) -> Iterator[str]:
    """Modules of `baselines` that a file names anywhere in it."""
    for node in ast.walk(tree):
        names: list[str] = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            names = [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
        for name in names:
            if name.split(".")[0] == "baselines" and _is_module(name):
                yield name


def _is_module(name: str) -> bool:
    """Whether a name is that of a module, not of something in one."""
    try:
        return importlib.util.find_spec(name) is not None
    except ModuleNotFoundError:  # its parent is no package
        return False
