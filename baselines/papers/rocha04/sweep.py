"""The experiment of Rocha04 as cells: scenario, strategy and number of starts of each point."""

from __future__ import annotations

import math
from itertools import product
from typing import Any

from baselines.experiments.experiment import Amount
from baselines.experiments.trials import Cell, CellTrial, trials_of
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.settings.scenarios import ROOM

TEAMS = (2, 3, 4)
BURSTS = (32, 64, 128)
I_MINS = (0.6215, 0.3219, 0.0291)
STANDARD = (64, 0.3219)
"""burst and I_min of figure 4."""
ALTERNATIVES = ("random", "gradient-plane", "planned-rate")
"""Strategies compared with eqs. 33-34 for every team size: a random walk, the motion-plane rule, and ours."""

CHANGES: dict[str, tuple[str, dict[str, Any], str]] = {
    "scan-0": ("scan time 0.001 s instead of 0.5 s", {"sensor": {"scan_time_s": 0.001}}, "gradient"),
    "scan-1": ("scan time 1 s", {"sensor": {"scan_time_s": 1.0}}, "gradient"),
    "turn": (
        "turn rate π/2 rad/s instead of unlimited",
        {"robot": {"turn_rate_rad_s": math.pi / 2}},
        "gradient",
    ),
    "behind-0": ("rays update nothing behind the hit", {"sensor": {"voxels_behind": 0}}, "gradient"),
    "reach-1": ("search radius ξ of one voxel, 0.25 m", {"robot": {"reach_m": 0.25}}, "gradient"),
    "reach-4": ("search radius ξ of 1 m", {"robot": {"reach_m": 1.0}}, "gradient"),
    "furnished": ("boxes on the floor (the worlds of room-furnished)", {"world": "furnished"}, "gradient"),
    "plane-scan-0": (
        "motion plane and scan time 0.001 s (two changes)",
        {"sensor": {"scan_time_s": 0.001}},
        "gradient-plane",
    ),
}
"""Name → (what is changed, the settings, the strategy): one thing at a time (the last: two), one robot."""


def team_id(robots: int, burst: int, i_min_bits: float) -> str:
    """Return the name of the cell with this team; a robot alone shares nothing, whatever the channel."""
    return "single" if robots == 1 else f"team-{robots}-burst-{burst}-imin-{i_min_bits}"


def alternative_id(robots: int, strategy: str) -> str:
    """Return the name of the cell with another strategy and the settings of `team_id(robots, *STANDARD)`."""
    return f"single-{strategy}" if robots == 1 else f"team-{robots}-{strategy}"


def experiment(amount: Amount) -> list[CellTrial]:
    """Return all missions: quick, nothing is changed, and one robot has three times as many starts."""
    single, starts = with_settings(ROOM, {"robots": 1}), amount.seeds
    alone = 3 * starts if amount.quick else starts
    cells = [
        Cell("single", single, "gradient", alone),
        *(Cell(alternative_id(1, strategy), single, strategy, alone) for strategy in ALTERNATIVES),
    ]
    for robots in TEAMS:
        for burst, i_min_bits in product(BURSTS, I_MINS):
            scenario = _team(robots, burst, i_min_bits)
            cells.append(Cell(team_id(robots, burst, i_min_bits), scenario, "gradient", starts))
        for strategy in ALTERNATIVES:
            cells.append(Cell(alternative_id(robots, strategy), _team(robots, *STANDARD), strategy, starts))
    for name, (_, settings, strategy) in () if amount.quick else CHANGES.items():
        cells.append(Cell(f"change-{name}", with_settings(single, settings), strategy, alone))
    return trials_of(cells)


def _team(robots: int, burst: int, i_min_bits: float) -> Scenario:
    return with_settings(ROOM, {"robots": robots, "channel": {"burst": burst, "i_min_bits": i_min_bits}})
