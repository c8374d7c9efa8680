"""The strategies by name."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from types import MappingProxyType

from baselines.gradient import GradientStrategy
from baselines.information_rate import InformationRate, Weighing
from baselines.mutual_information import Coordination, MutualInformation
from baselines.random_walk import RandomWalk
from baselines.strategy import Strategy
from baselines.voronoi import Coverage, VoronoiCoverage
from entropy_explore_env.errors import SettingError

STRATEGIES: MappingProxyType[str, Callable[[], Strategy]] = MappingProxyType(
    {
        "random": RandomWalk,
        "gradient": GradientStrategy,
        "gradient-plane": partial(GradientStrategy, motion_plane=True),
        "mutual-information": MutualInformation,
        "ground-gradient": partial(MutualInformation, Coordination(coordinated=False)),
        "information-rate": InformationRate,
        "information-per-scan": partial(InformationRate, Weighing(per_scan=True, candidates=120)),
        "voronoi": VoronoiCoverage,
        "voronoi-gradient": partial(VoronoiCoverage, Coverage(control="gradient-search")),
        "voronoi-nearest": partial(
            VoronoiCoverage,
            Coverage(control="nearest", metric="length", known="deviation", tau=0.02, tau_floor=0.01),
        ),
    }
)
"""Name → a function that makes the strategy."""


def make_strategy(name: str) -> Strategy:
    """A new strategy.

    Raises:
        SettingError: None has this name.
    """
    if name not in STRATEGIES:
        raise SettingError("strategy", name, "one of " + ", ".join(STRATEGIES))
    return STRATEGIES[name]()
