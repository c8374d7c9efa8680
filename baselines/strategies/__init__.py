"""The strategies by name: those of the package, learned policies, and classes from outside."""

from __future__ import annotations

import importlib
from collections import Counter
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from types import MappingProxyType, ModuleType

from baselines.strategies.loading import entry_points, make_referenced, module_of
from baselines.strategies.protocol import Strategy
from baselines.strategies.table import ALIASES, CLIFF_STRATEGIES, STRATEGIES
from entropy_explore_env.command import home_path
from entropy_explore_env.errors import MissingExtraError, SettingError, did_you_mean
from entropy_explore_env.explorer.planned_rate import PlannedRate
from entropy_explore_env.planner.weights import read_weights

_RECOMMENDED = MappingProxyType({"cliff": "cliff-next-best-view"})
"""Named scenario → what we recommend in it, where that is another one than elsewhere."""

_LEARNED = "training.policy"
"""Makes strategies of learned policies. It is looked up when one is asked for, so that strategies need
neither trainers nor networks."""
_PRETRAINED = "pretrained:"
_GONE = MappingProxyType(
    {"pretrained:volumes": "planned-rate, its equal: its missions took 1.00 of the time; this policy is gone"}
)
"""Former name → what is allowed in its place."""


def make_strategy(name: str) -> Strategy:
    """Make a new strategy.

    Args:
        name: One of STRATEGIES or ALIASES; `pretrained:NAME`, a policy that comes with the project; the
            folder of a policy that was trained; a file of planner weights, `weights.json`; `module:Class` or
            `path/to/file.py:Class`; or a name that an installed package declares (see `loading`).

    Raises:
        SettingError: No strategy has this name, or its class cannot be made.
        MissingExtraError: A policy was asked for, and what runs it is not installed.
    """
    name = resolved(name)
    if name in _GONE:
        raise SettingError("strategy", name, _GONE[name])
    maker = scripted_maker(name)
    if maker is not None:
        return maker()
    if is_learned(name):
        return learned_policies().make_policy_strategy(name)
    return make_referenced(_reference(name))


def scripted_maker(name: str) -> Callable[[], Strategy] | None:
    """Return the factory of the scripted strategy with this name, or None for an unknown name.

    Raises:
        SettingError: It names a file of planner weights that cannot be used.
    """
    if name.endswith(".json"):
        return partial(PlannedRate, read_weights(Path(name)))
    return STRATEGIES.get(name) or CLIFF_STRATEGIES.get(name)


def recommended(scenario: str) -> str:
    """Return the name of the strategy that we recommend in a named scenario."""
    return _RECOMMENDED.get(scenario, "best")


def resolved(name: str) -> str:
    """Return the name that records and tables hold of a strategy that is asked for by this name."""
    return ALIASES.get(name, str(home_path(name)) if name.startswith("~") else name)


def shown_name(name: str) -> str:
    """Return a strategy's short name: of `module:Class` and `file.py:Class` only the class."""
    return name if name.startswith(_PRETRAINED) else name.rpartition(":")[2]


def shown_names(names: Iterable[str]) -> dict[str, str]:
    """Return the strategies' names in a table: by `shown_name`, in full where two short names are equal."""
    short = {name: shown_name(name) for name in names}
    alike = Counter(short.values())
    return {name: shown if alike[shown] == 1 else name for name, shown in short.items()}


def strategy_module(name: str) -> str | Path:
    """Return the module that defines a scripted strategy, or the file that does.

    Args:
        name: As for `make_strategy`, but for learned policies.

    Raises:
        SettingError: No strategy has this name.
    """
    name = resolved(name)
    made_by = scripted_maker(name)
    if made_by is not None:
        while isinstance(made_by, partial):
            made_by = made_by.func
        return made_by.__module__
    return module_of(_reference(name))


def _reference(name: str) -> str:
    """Return `module:Class` or `file.py:Class` of a strategy from outside the package."""
    if ":" in name:
        return name
    declared = entry_points()
    if name in declared:
        return declared[name]
    known = [*STRATEGIES, *CLIFF_STRATEGIES, *ALIASES, *declared]
    others = f"{_PRETRAINED}room, a policy's folder, weights.json, module:Class or file.py:Class"
    if len(Path(name).parts) > 1:
        raise SettingError("strategy", name, f"a strategy's name, {others}; there is no such folder")
    raise SettingError("strategy", name, f"one of {', '.join(known)}, {others}" + did_you_mean(name, known))


def is_learned(name: str) -> bool:
    """Return whether a name means a learned policy."""
    return scripted_maker(resolved(name)) is None and (name.startswith(_PRETRAINED) or Path(name).is_dir())


def learned_policies() -> ModuleType:
    """Return the module that knows learned policies.

    Raises:
        MissingExtraError: What runs them is not installed.
    """
    try:
        return importlib.import_module(_LEARNED)
    except ModuleNotFoundError as error:
        raise MissingExtraError(error.name or "torch", "training") from None
