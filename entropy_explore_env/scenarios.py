"""The named scenarios: one frozen Scenario each."""

from __future__ import annotations

import math
from types import MappingProxyType

from entropy_explore_env.config import Channel, Grid, RangeSensor, Robot, Scenario
from entropy_explore_env.errors import SettingError

_ROOM_GRID = Grid((41, 41, 17), 0.25, (-0.125, -0.125, -0.125))
"""Voxel centres on 0, 0.25, …, 10 m: 28,577 voxels, as Rocha04's H(0) and H_th ask for."""

ROOM = Scenario(
    name="room",
    grid=_ROOM_GRID,
    world="empty",
    robot=Robot(turn_rate_rad_s=math.inf),
)
"""Rocha04's room, tables 1-2: 10 × 10 × 4 m, empty. Its turn rate is unlimited and its scan takes
0.5 s, neither of which the paper gives; the walls stand on the outer faces of the outer voxels."""

ROOM_FURNISHED = Scenario(name="room-furnished", grid=_ROOM_GRID, world="furnished")
"""The same room with boxes on its floor, drawn from the seed; robots turn at π/2 rad/s."""

BOX = Scenario(
    name="box-7x11x5",
    grid=Grid((7, 11, 5), 0.5),
    world="empty",
    robots=2,
    robot=Robot(reach_m=1.0, max_speed_m_s=0.5, acceleration_m_s2=0.5),
    sensor=RangeSensor((math.pi / 6, math.pi / 12), math.pi / 36),
    channel=Channel(burst=8, i_min_bits=0.1),
)
"""A tiny box of 3.5 × 5.5 × 2.5 m with no two edges equal, for tests and examples."""

SCENARIOS = MappingProxyType({scenario.name: scenario for scenario in (ROOM, ROOM_FURNISHED, BOX)})
"""Name → Scenario."""


def find_scenario(scenario: str | Scenario) -> Scenario:
    """The scenario with a name; a Scenario is given back as it is.

    Raises:
        SettingError: No scenario has this name.
    """
    if isinstance(scenario, Scenario):
        return scenario
    if not isinstance(scenario, str) or scenario not in SCENARIOS:
        raise SettingError("scenario", scenario, "one of " + ", ".join(SCENARIOS))
    return SCENARIOS[scenario]
