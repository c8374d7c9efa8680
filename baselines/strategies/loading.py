"""Strategies from outside the package: classes and rules named by module or file, and entry points.

They are named `my_package.my_module:MyStrategy` or `path/to/file.py:MyStrategy`, or have a name that an
installed package declares in the entry-point group `entropy_explore_env.strategies`: docs/own_strategy.md.
"""

from __future__ import annotations

import hashlib
import importlib
import importlib.metadata
import importlib.util
import inspect
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

from baselines.strategies.protocol import Strategy
from entropy_explore_env.errors import EntropyExploreError, SettingError
from entropy_explore_env.planner.frontier_rule import PickRule

ENTRY_POINTS = "entropy_explore_env.strategies"
"""The group in which packages declare strategies."""
_FORM = "module:Class or path/to/file.py:Class"


def entry_points() -> dict[str, str]:
    """Return name → `module:Class` of the strategies that installed packages declare."""
    return {each.name: each.value for each in importlib.metadata.entry_points(group=ENTRY_POINTS)}


def module_of(name: str) -> str | Path:
    """Return where the class of a strategy is defined: a module's name, or the path of a file.

    Args:
        name: `module:Class` or `path/to/file.py:Class`.
    """
    source, _ = _split(name)
    return Path(source).resolve() if source.endswith(".py") else source


def make_referenced(name: str) -> Strategy:
    """Make a new strategy of a class named by its module or file.

    Args:
        name: `module:Class` or `path/to/file.py:Class`. A class, or a function without arguments, makes the
            strategy; a function of one argument is itself a rule, `pick(scene)`, that the driver follows.

    Raises:
        SettingError: There is no such module, file or class; it raises an error; what it makes is no
            Strategy. The message says which, in one line.
    """
    source, attribute = _split(name)
    module = _load(name, source)
    make = getattr(module, attribute, None)
    if make is None or not callable(make):
        defined = [
            each for each in vars(module).values() if getattr(each, "__module__", "") == module.__name__
        ]
        classes = sorted(each.__name__ for each in defined if isinstance(each, type) and not _missing(each))
        known = f", such as {', '.join(classes)}" if classes else "; no class there has reset and choose"
        raise SettingError("strategy", name, f"a class in {source}{known} ({attribute} is none)")
    if inspect.isfunction(make) and _takes_one(make):
        return PickRule(make)
    return _made(name, attribute, make)


def _split(name: str) -> tuple[str, str]:
    source, _, attribute = name.rpartition(":")
    if not source or not attribute.isidentifier():
        raise SettingError("strategy", name, _FORM)
    return source, attribute


def _load(name: str, source: str) -> ModuleType:
    """Import the module or the file that defines a strategy."""
    path = Path(source).resolve() if source.endswith(".py") else None
    if path is not None and not path.is_file():
        raise SettingError("strategy", name, f"{_FORM}; there is no file {source}")
    if path is None and not all(part.isidentifier() for part in source.split(".")):
        raise SettingError("strategy", name, f"{_FORM}; {source} is neither a module's name nor a .py file")
    try:
        return importlib.import_module(source) if path is None else _import_file(path)
    except EntropyExploreError:
        raise
    except ModuleNotFoundError as error:
        if error.name is not None and source.startswith(error.name):
            raise SettingError("strategy", name, f"{_FORM}; there is no module {error.name}") from None
        raise SettingError("strategy", name, f"code that can be imported ({error})") from error
    except Exception as error:
        raise SettingError("strategy", name, f"code that can be imported ({_said(error)})") from error


def _import_file(path: Path) -> ModuleType:
    """Import a file once a process, as a module of its own; its neighbours can be imported from it."""
    number = hashlib.sha256(str(path).encode()).hexdigest()[:8]
    module_name = f"strategy_file_{path.stem}_{number}"
    if module_name in sys.modules:
        return sys.modules[module_name]
    spec = importlib.util.spec_from_file_location(module_name, path)
    if spec is None or spec.loader is None:
        raise ImportError(f"{path.name} is no Python file")
    if str(path.parent) not in sys.path:
        sys.path.append(str(path.parent))
    module = importlib.util.module_from_spec(spec)
    sys.modules[module_name] = module
    try:
        spec.loader.exec_module(module)
    except BaseException:
        del sys.modules[module_name]
        raise
    return module


def _made(name: str, attribute: str, make: Callable[[], Any]) -> Strategy:
    """Call the class, and check that it makes a Strategy."""
    try:
        strategy = make()
    except EntropyExploreError:
        raise
    except Exception as error:
        allowed = f"a class that can be made without arguments; {attribute}() raised {_said(error)}"
        raise SettingError("strategy", name, allowed) from error
    if missing := _missing(strategy):
        allowed = f"a Strategy, with the methods reset and choose; {' and '.join(missing)} missing"
        raise SettingError("strategy", name, allowed)
    choose = getattr(strategy, "choose", None)
    if choose is not None and "views" in inspect.signature(choose).parameters:
        allowed = "a Strategy with choose(view), for one robot; choose_all(views) chooses for several at once"
        raise SettingError("strategy", name, allowed)
    return strategy


def _missing(thing: object) -> list[str]:
    """Return which methods of a Strategy a strategy, or its class, has not."""
    methods = {"reset": ("reset",), "choose": ("choose", "choose_all")}
    return [
        name
        for name, either in methods.items()
        if not any(callable(getattr(thing, method, None)) for method in either)
    ]


def _takes_one(function: Callable[..., Any]) -> bool:
    """Return whether a function needs exactly one positional argument."""
    parameters = inspect.signature(function).parameters.values()
    positional = (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)
    needed = [each for each in parameters if each.default is each.empty and each.kind in positional]
    return len(needed) == 1


def _said(error: BaseException) -> str:
    """Return an error's kind and message in one line."""
    return " ".join(f"{type(error).__name__}: {error}".split())
