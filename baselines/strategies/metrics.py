"""The strategies `nearest-candidate` and `coordinated-candidate`: per-time visibility with other metrics.

Their metrics are those of Yamauchi 1998 and of Burgard et al. 2005. All else is as in `per-time-visibility`:
few candidates, one a block; those from which nothing unexplored can be seen are ignored; a robot drives to
its candidate before it chooses again. So they are comparisons of metrics, not the rules of those papers as
their authors run them: those are `nearest-frontier` and `coordinated-frontier`, in `explorers`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from baselines.strategies.rules.per_time_visibility import ExplorationConfig, FrontierStrategy
from entropy_explore_env.validation import check_not_negative


@dataclass(frozen=True)
class Nearest:
    """The candidate with the shortest path (Yamauchi 1998)."""

    def __call__(
        self, seen: np.ndarray, seconds: np.ndarray, edges: np.ndarray, taken: np.ndarray
    ) -> np.ndarray:
        """See `Value`."""
        del seen, seconds, taken
        return -edges


@dataclass(frozen=True)
class Coordinated:
    """Utility minus cost, U - β·length; U falls near others' frontiers (Burgard et al. 2005, eqs. 5-7).

    U = 1 - Σ P(d), with P(d) = 1 - d/range within the range of a frontier that another robot goes to.

    Attributes:
        beta: β, cost of a voxel edge of path; the paper finds 0.01 … 50 alike.

    Raises:
        SettingError: β is no number ≥ 0.
    """

    beta: float = 0.01

    def __post_init__(self) -> None:
        """Check β."""
        check_not_negative(self, "beta")

    def __call__(
        self, seen: np.ndarray, seconds: np.ndarray, edges: np.ndarray, taken: np.ndarray
    ) -> np.ndarray:
        """See `Value`."""
        del seen, seconds
        return 1.0 - taken - self.beta * edges


nearest_candidate = partial(FrontierStrategy, ExplorationConfig(metric=Nearest(), promises=False))
"""Uncoordinated: where teammates go does not count."""
coordinated_candidate = partial(FrontierStrategy, ExplorationConfig(metric=Coordinated()))
"""Coordinated by what teammates announce."""
