"""Scenes of Explorers."""

from __future__ import annotations

import numpy as np
import pytest

from tests.explorer.hand_drawn import START, look, plan_by_hand


@pytest.fixture(scope="module")
def seen_from_start() -> np.ndarray:
    """Return the plan as far as it is seen from its start."""
    seen = np.full(plan_by_hand().shape, -1, np.int8)
    look(plan_by_hand(), seen, START)
    return seen
