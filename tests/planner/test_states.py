"""The one transition between a planner's states, by hand."""

import math

import pytest

from entropy_explore_env.planner.states import PlannerState, next_state
from entropy_explore_env.planner.thresholds import DEPLETED_SCANS


@pytest.mark.parametrize(
    ("low_gain_scans", "leaves", "best_bits", "gives_way", "state"),
    [
        (0, False, math.inf, False, PlannerState.EXPLORING),
        (DEPLETED_SCANS - 1, True, 1.0, False, PlannerState.LEAVING),
        (DEPLETED_SCANS, True, 1.0, False, PlannerState.DEPLETED),
        (DEPLETED_SCANS, True, 1e-6, False, PlannerState.WANDERING),
        (0, False, 1.0, True, PlannerState.WANDERING),
    ],
)
def test_what_is_most_urgent_decides(low_gain_scans, leaves, best_bits, gives_way, state):
    assert next_state(low_gain_scans, leaves, best_bits, gives_way) == state
