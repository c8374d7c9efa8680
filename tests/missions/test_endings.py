"""When maps end a mission: one of them, or all."""

from __future__ import annotations

import numpy as np
import pytest

from entropy_explore_env.missions.records import MissionEnd
from tests.reference.scenes import free_box, started


@pytest.mark.parametrize(
    ("termination", "complete", "end"),
    [
        ("any", [False, False], MissionEnd.RUNNING),
        ("any", [False, True], MissionEnd.MAPPED),
        ("all", [False, True], MissionEnd.RUNNING),
        ("all", [True, True], MissionEnd.MAPPED),
        ("shared", [True, False], MissionEnd.RUNNING),
        ("shared", [True, True], MissionEnd.MAPPED),
    ],
)
def test_a_mission_ends_at_the_first_event_at_which_enough_maps_are_complete(termination, complete, end):
    missions = started(free_box(robots=2, channel={"burst": 0}, ending={"termination": termination}))
    enough_bits = missions.state.missions[0]["entropy_end_bits"]
    missions.state.robots["entropy_bits"][0] = np.where(complete, enough_bits, enough_bits + 1e6)
    missions.step(np.zeros((1, 2, 5)), np.zeros((1, 2), np.int64))
    assert missions.over(0) is end
