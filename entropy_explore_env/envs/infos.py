"""What infos say of a robot after a step."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from entropy_explore_env.missions.faults import failing
from entropy_explore_env.missions.localization import pose_errors
from entropy_explore_env.missions.records import MissionEnd
from entropy_explore_env.missions.simulation import Missions
from entropy_explore_env.reports.metrics import mission_figures
from entropy_explore_env.robots.motion import MoveEnd

_MOVE_ENDS = list(MoveEnd)

END_FIGURES = ("t_mission_s", "bits_gained_per_bit_sent")
"""Figures that infos hold by themselves, as numbers that loggers of episodes can show:
Stable-Baselines3's Monitor and VecMonitor by `info_keywords=END_FIGURES`."""
_NOT_YET: dict[str, float] = dict.fromkeys(END_FIGURES, 0.0)
"""Not NaN, which differs from itself: to checkers of environments it looks like chance."""


def end_figures(figures: Mapping[str, Any]) -> dict[str, float]:
    """Return the END_FIGURES out of a mission's figures; NaN where one is not defined."""
    return {name: math.nan if figures[name] is None else float(figures[name]) for name in END_FIGURES}


def robot_infos(missions: Missions, mission: int) -> list[dict[str, Any]]:
    """Return an info for each robot of a mission: numbers with the same names at all times.

    Keys: `deciding` (whether its next action counts), `time_s`, `world_number` (the world's, which `reset`
    takes as its option `world`; -1 where no recipe made it), `entropy_bits`, `own_bits` and
    `received_bits` (taken from its map in this step), `move_end` and `end` (a MoveEnd and a
    MissionEnd, which print as their names), the two of END_FIGURES (0 until the mission is over), and
    `action_mask` where actions are numbers. Where the mission ends by what the team has seen also
    `seen_share`, of all that can be seen. Where the scenario has faults also `stopped`, `blind` and `silent`:
    whether the robot fails so now. Where robots drift also `pose_error_m` and `pose_error_rad`: how far off
    the robot's estimate of its pose was when it last scanned or decided under way; nothing acts on it.

    Args:
        missions: The missions.
        mission: Which.
    """
    clock = missions.state.missions[mission]
    robots = missions.state.robots[mission]
    time_s, end = float(clock["time_s"]), missions.over(mission)
    at_end = _NOT_YET
    if end is not MissionEnd.RUNNING:
        at_end = end_figures(mission_figures(missions, mission, floor=False))
    world_number = int(missions.world_numbers[mission])
    infos: list[dict[str, Any]] = [
        {
            "deciding": deciding,
            "time_s": time_s,
            "world_number": world_number,
            "entropy_bits": entropy_bits,
            "own_bits": own_bits,
            "received_bits": received_bits,
            "move_end": MoveEnd.UNDER_WAY if under_way else _MOVE_ENDS[move_end],
            "end": end,
            **at_end,
        }
        for deciding, under_way, entropy_bits, own_bits, received_bits, move_end in zip(
            robots["deciding"].tolist(),
            robots["under_way"].tolist(),
            robots["entropy_bits"].tolist(),
            robots["own_bits"].tolist(),
            robots["received_bits"].tolist(),
            robots["move_end"].tolist(),
            strict=True,
        )
    ]
    if missions.scenario.ending.by_seen:
        seen_share = float(clock["explored_visible"] / max(clock["visible"], 1))
        for info in infos:
            info["seen_share"] = seen_share
    if missions.rules.faults is not None:
        for name, now in failing(missions.state.faults[mission], time_s).items():
            for info, failed in zip(infos, now.tolist(), strict=True):
                info[name] = failed
    if missions.rules.localization is not None:
        errors = pose_errors(missions.state.estimates[mission])
        for info, (off_m, off_rad) in zip(infos, errors, strict=True):
            info["pose_error_m"], info["pose_error_rad"] = off_m, off_rad
    if missions.scenario.action.by_number:
        for info, mask in zip(infos, missions.action_masks()[mission], strict=True):
            info["action_mask"] = mask
    return infos
