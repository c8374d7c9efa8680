"""The strategies `nearest-frontier` (Yamauchi 1998) and `coordinated-frontier` (Burgard et al. 2005).

They share the candidates of `per-time-visibility`, and go to none from which nothing unexplored can be seen.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from baselines.strategies.frontier import Exploring, FrontierStrategy
from entropy_explore_env.validation import check_not_negative


@dataclass(frozen=True)
class Nearest:
    """The candidate with the shortest way (Yamauchi 1998)."""

    def __call__(
        self, seen: np.ndarray, seconds: np.ndarray, edges: np.ndarray, taken: np.ndarray
    ) -> np.ndarray:
        """See `Value`."""
        del seen, seconds, taken
        return -edges


@dataclass(frozen=True)
class Coordinated:
    """Utility less cost, U - β·way; U falls near the frontiers of others (Burgard et al. 2005, eqs. 5-7).

    U = 1 - Σ P(d), with P(d) = 1 - d/range within the range of a frontier that another robot goes to.

    Attributes:
        beta: β, a voxel edge of way; the paper finds 0.01 … 50 alike.

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


nearest_frontier = partial(FrontierStrategy, Exploring(metric=Nearest(), promises=False))
"""Uncoordinated: nobody heeds where others go."""
coordinated_frontier = partial(FrontierStrategy, Exploring(metric=Coordinated()))
"""Coordinated by what is announced."""
