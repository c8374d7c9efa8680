"""A workspace with nothing in it but its walls (Rocha04's room)."""

from __future__ import annotations

import numpy as np

from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.worlds.world import World


def empty(grid: Grid, rng: np.random.Generator) -> World:
    """Return a workspace with nothing in it but its walls; nothing is drawn.

    Args:
        grid: The workspace.
        rng: Not used.
    """
    del rng
    return World(grid, np.zeros(grid.shape, bool), "empty")
