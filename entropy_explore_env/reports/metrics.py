"""Figures of one mission, as every table and every JSON object shows them."""

from __future__ import annotations

from typing import Any

from entropy_explore_env.missions.missions import Missions
from entropy_explore_env.missions.state import COUNTED, MissionEnd


def mission_figures(missions: Missions, mission: int) -> dict[str, Any]:
    """What a mission came to.

    Entropies are those of the best-informed robot's map; counts are sums over the team.

    Args:
        missions: The missions.
        mission: Which.

    Returns:
        `scenario`, `world`, `robots`, `seed`, `finished`, `end_reason`, `t_mission_s`, `scans`,
        `measurements`, `shared_measurements`, `bits_sent`, `bits_received`, `messages_lost`,
        `entropy_start_bits`, `entropy_threshold_bits`, `entropy_end_bits`, `distance_m`,
        `blocked_moves`, and `per_robot`: a list of the robots' own counts.
    """
    clock, robots = missions.state.missions[mission], missions.state.robots[mission]
    end = missions.over(mission)
    world = missions.worlds[mission]
    return {
        "scenario": missions.scenario.name,
        "world": missions.scenario.world if world is None else world.name,
        "robots": missions.scenario.robots,
        "seed": missions.seeds[mission],
        "finished": end is MissionEnd.MAPPED,
        "end_reason": end.name,
        "t_mission_s": float(clock["time_s"]),
        "scans": int(robots["scans"].sum()),
        "measurements": int(robots["measurements"].sum()),
        "shared_measurements": int(robots["measurements_sent"].sum()),
        "bits_sent": int(robots["bits_sent"].sum()),
        "bits_received": int(robots["bits_received"].sum()),
        "messages_lost": int(robots["messages_lost"].sum()),
        "entropy_start_bits": float(clock["entropy_start_bits"]),
        "entropy_threshold_bits": float(clock["entropy_end_bits"]),
        "entropy_end_bits": float(robots["entropy_bits"].min()),
        "distance_m": float(robots["distance_m"].sum()),
        "blocked_moves": int(robots["blocked_moves"].sum()),
        "per_robot": [{name: robot[name].item() for name in COUNTED} for robot in robots],
    }
