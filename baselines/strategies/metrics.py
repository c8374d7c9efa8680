"""Metrics by which robots choose frontier candidates: settings of `per-time-visibility`.

Nearest and Coordinated are the metrics of Yamauchi 1998 and of Burgard et al. 2005. All else is as in
per-time visibility: few candidates, one a block; those from which nothing unexplored can be seen are ignored;
a robot drives to its candidate before it chooses again. So they compare metrics, and are not the rules of
those papers as their authors run them: those are `nearest-frontier` and `coordinated-frontier`.

A metric gives the values (K,) of K options from four arrays (K,): V·(height factor) in points' size;
seconds of the drives, and of the scans at their stops; lengths of the paths in voxel edges; shares ≥ 0 of a
frontier's utility that robots take which go near it (Burgard 2005). It is never greater for less V, or for a
longer path.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from entropy_explore_env.errors import SettingError
from entropy_explore_env.frontiers.frontier_map import FrontierConfig
from entropy_explore_env.settings.validation import check, check_choice, check_kind, check_not_negative


@dataclass(frozen=True)
class Metric:
    """V/t, or V - βt; or (V + bonus)/t, a finishing rule of ours.

    Attributes:
        beta: β; None = V/t.
        bonus: Value of any frontier in addition to V, in V's units: slivers nearby are then explored in
            passing instead of at the end. 0 = the paper's metric.
    """

    beta: float | None = None
    bonus: float = 0.0

    def __post_init__(self) -> None:
        """Check both."""
        if self.beta is not None:
            check(self, "beta", "None, or a number ≥ 0", lambda v: 0.0 <= v < math.inf)
        check_not_negative(self, "bonus")

    def __call__(
        self, seen: np.ndarray, seconds: np.ndarray, edges: np.ndarray, taken: np.ndarray
    ) -> np.ndarray:
        """Return the values."""
        worth = seen + self.bonus
        return worth / seconds if self.beta is None else worth - self.beta * seconds


@dataclass(frozen=True)
class Nearest:
    """The candidate with the shortest path (Yamauchi 1998)."""

    def __call__(
        self, seen: np.ndarray, seconds: np.ndarray, edges: np.ndarray, taken: np.ndarray
    ) -> np.ndarray:
        """Return the values."""
        return -edges


@dataclass(frozen=True)
class Coordinated:
    """Utility minus cost, U - β·length; U falls near others' frontiers (Burgard et al. 2005, eqs. 5-7).

    U = 1 - Σ P(d), with P(d) = 1 - d/range within the range of a frontier that another robot goes to.

    Attributes:
        beta: β, cost of a voxel edge of path; the paper finds 0.01 … 50 alike.
    """

    beta: float = 0.01

    def __post_init__(self) -> None:
        """Check β."""
        check_not_negative(self, "beta")

    def __call__(
        self, seen: np.ndarray, seconds: np.ndarray, edges: np.ndarray, taken: np.ndarray
    ) -> np.ndarray:
        """Return the values."""
        return 1.0 - taken - self.beta * edges


Value = Metric | Nearest | Coordinated
Allocation = Literal["asynchronous", "synchronous"]


@dataclass(frozen=True)
class ExplorationConfig:
    """How robots choose frontiers.

    Attributes:
        metric: The values of candidates.
        allocation: Whether robots choose when they stop, or all together.
        promises: Whether points that teammates announced to see have less weight.
        frontiers: Where candidates lie and what is seen from them.
        once: Whether no finer σ counts as explored where no candidate is left: robots wait then.
    """

    metric: Value = field(default_factory=Metric)
    allocation: Allocation = "asynchronous"
    promises: bool = True
    frontiers: FrontierConfig = field(default_factory=FrontierConfig)
    once: bool = False

    def __post_init__(self) -> None:
        """Check every field."""
        if not isinstance(self.metric, Value):
            raise SettingError("ExplorationConfig.metric", self.metric, "a Metric, Nearest or Coordinated")
        check_choice(self, "allocation")
        check_kind(self, "promises", bool)
        check_kind(self, "frontiers", FrontierConfig)
        check_kind(self, "once", bool)
