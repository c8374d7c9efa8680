"""Bhattacharya's strategy in this package's missions: flying teams (e), both channels at equal bits (f)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from baselines.experiment import Cell
from entropy_explore_env.config import with_settings
from entropy_explore_env.scenarios import find_scenario

FLYING = ("voronoi", "voronoi-nearest", "gradient", "information-rate")
FLYING_LIMIT_S = 600.0

CHANNELS: dict[str, dict[str, Any]] = {
    "utility-64": {"burst": 64},
    "phases-64-once": {"burst": 64, "phase_s": 10.0},
    "phases-32-twice": {"burst": 32, "phase_s": 10.0, "repeats": 2},
    "phases-16-four-times": {"burst": 16, "phase_s": 10.0, "repeats": 4},
    "utility-all": {"burst": 180},
    "phases-all-once": {"burst": 180, "phase_s": 10.0},
}
"""Channel settings; I_min = 0, so that the first four send 64 measurements a scan each, the others 180."""
LOSSES = (0.0, 0.5)


def flying_id(world: str, strategy: str) -> str:
    """Name of a cell of (e)."""
    return f"flying-{world}-{strategy}"


def channel_id(channel: str, loss: float) -> str:
    """Name of a cell of (f)."""
    return f"channel-{channel}-loss-{loss:g}"


def mission_cells(seeds: int, corridor: Path | None) -> list[Cell]:
    """All cells.

    Args:
        seeds: Missions of each.
        corridor: An OctoMap of a real corridor; None = without it.
    """
    cave = with_settings(find_scenario("cave"), {"robots": 4, "time_limit_s": FLYING_LIMIT_S, "scored": True})
    cells = [Cell(flying_id("cave", strategy), cave, strategy, seeds) for strategy in FLYING]
    if corridor is not None:
        changes = {"world": str(corridor), "robots": 4, "time_limit_s": FLYING_LIMIT_S, "scored": True}
        robot = {"navigator": "planned", "reach_m": 3.0, "max_speed_m_s": 0.5, "acceleration_m_s2": 0.5}
        sensor = find_scenario("office-3d").sensor
        real = with_settings(find_scenario("room"), {**changes, "robot": robot, "sensor": sensor})
        cells += [Cell(flying_id("corridor", strategy), real, strategy, seeds) for strategy in FLYING]
    office = find_scenario("office")
    for name, channel in CHANNELS.items():
        for loss in LOSSES:
            settings = {**channel, "i_min_bits": 0.0, "loss_probability": loss}
            scenario = with_settings(office, {"channel": settings, "time_limit_s": 1200.0})
            cells.append(Cell(channel_id(name, loss), scenario, "voronoi-nearest", 4 * seeds))
    return cells
