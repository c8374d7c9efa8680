"""Settings of `per-time-visibility`, and the metrics by which its robots choose frontier candidates.

    per-time       V/t, or V - βt; or (V + bonus)/t, a finishing rule of ours
    nearest        the shortest path (Yamauchi 1998)
    coordinated    1 - Σ P(d) - β·length, with P(d) = 1 - d/range within the range of a frontier that another
                   robot goes to, and β = 0.01 (Burgard et al. 2005, eqs. 5-7, who find 0.01 … 50 alike)

All else is as in per-time visibility: few candidates, one a block; those from which nothing unexplored can be
seen are ignored; a robot drives to its candidate before it chooses again. So they compare metrics, and are
not the rules of those papers as their authors run them: those are `nearest-frontier` and
`coordinated-frontier`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from entropy_explore_env.frontiers.frontier_map import FrontierConfig
from entropy_explore_env.settings.validation import check, check_choice, check_kind, check_not_negative

Metric = Literal["per-time", "nearest", "coordinated"]
Allocation = Literal["asynchronous", "synchronous"]
_COORDINATED_BETA = 0.01


@dataclass(frozen=True)
class ExplorationConfig:
    """How robots choose frontiers.

    Attributes:
        metric: The values of candidates: see the top of the file.
        beta: β of `per-time`; None = V/t.
        bonus: Value of any frontier in addition to V of `per-time`, in V's units: slivers nearby are then
            explored in passing instead of at the end. 0 = the paper's metric.
        allocation: Whether robots choose when they stop, or all together.
        promises: Whether points that teammates announced to see have less weight.
        frontiers: Where candidates lie and what is seen from them.
        once: Whether no finer σ counts as explored where no candidate is left: robots wait then.
    """

    metric: Metric = "per-time"
    beta: float | None = None
    bonus: float = 0.0
    allocation: Allocation = "asynchronous"
    promises: bool = True
    frontiers: FrontierConfig = field(default_factory=FrontierConfig)
    once: bool = False

    def __post_init__(self) -> None:
        """Check every field."""
        check_choice(self, "metric")
        if self.beta is not None:
            check(self, "beta", "None, or a number ≥ 0", lambda v: 0.0 <= v < math.inf)
        check_not_negative(self, "bonus")
        check_choice(self, "allocation")
        check_kind(self, "promises", bool)
        check_kind(self, "frontiers", FrontierConfig)
        check_kind(self, "once", bool)

    def values(
        self, seen: np.ndarray, seconds: np.ndarray, edges: np.ndarray, taken: np.ndarray
    ) -> np.ndarray:
        """Return the values (K,) of candidates: never greater for less V, or for a longer path.

        Args:
            seen: (K,) V·(height factor) in points' size.
            seconds: (K,) of the drives, and of the scans at their stops.
            edges: (K,) lengths of the paths in voxel edges.
            taken: (K,) Σ P(d) ≥ 0.
        """
        if self.metric == "nearest":
            return -edges
        if self.metric == "coordinated":
            return 1.0 - taken - _COORDINATED_BETA * edges
        worth = seen + self.bonus
        return worth / seconds if self.beta is None else worth - self.beta * seconds
