"""Bhattacharya's strategy in this package's missions: flying teams (e), both channels at equal bits (f)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from baselines.experiments.claims import Claim
from baselines.experiments.rows import Record
from baselines.experiments.statistics import ratio_interval
from baselines.experiments.tables import markdown_table
from baselines.experiments.trials import Cell
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.scenarios import find_scenario

FLYING = ("voronoi", "voronoi-nearest", "gradient", "planned-rate")
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
RIVALS = {
    "phases-64-once": "utility-64",
    "phases-32-twice": "utility-64",
    "phases-16-four-times": "utility-64",
    "phases-all-once": "utility-all",
}
"""Which settings send as many measurements a scan at once."""

Records = Mapping[str, Sequence[Record]]


def flying_id(world: str, strategy: str) -> str:
    """Name of a cell of (e)."""
    return f"flying-{world}-{strategy}"


def channel_id(channel: str, loss: float) -> str:
    """Name of a cell of (f)."""
    return f"channel-{channel}-loss-{loss:g}"


def mission_cells(seeds: int, corridor: Path | None) -> list[Cell]:
    """All cells.

    Args:
        seeds: Missions of each flying team; four times as many of each channel.
        corridor: An OctoMap of a real corridor; None = without it.
    """
    cave = with_settings(
        find_scenario("cave"), {"robots": 4, "time_limit_s": FLYING_LIMIT_S, "track_truth": True}
    )
    cells = [Cell(flying_id("cave", strategy), cave, strategy, seeds) for strategy in FLYING]
    if corridor is not None:
        changes = {"world": str(corridor), "robots": 4, "time_limit_s": FLYING_LIMIT_S, "track_truth": True}
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


def channel_claims(missions: Records) -> list[Claim]:
    """Selection by utility beside the broadcast in phases, at as many bits a scan; paired by seed."""
    claims = []
    for loss in LOSSES:
        for phases, utility in RIVALS.items():
            ours, theirs = missions[channel_id(utility, loss)], missions[channel_id(phases, loss)]
            where = f"(f) loss {loss:g}, {utility} beside {phases}"
            ratio = ratio_interval(_utilities(ours), _utilities(theirs))
            text = f"{where}: sending at once brings more entropy a bit; ratio"
            claims.append(Claim(f"utility-{phases}-{loss:g}", text, None, *ratio, ratio.low > 1.0))
            ratio = ratio_interval(_times(ours), _times(theirs))
            text = f"{where}: sending at once maps faster; t ratio"
            claims.append(Claim(f"time-{phases}-{loss:g}", text, None, *ratio, ratio.high < 1.0))
    return claims


def channel_table(missions: Records) -> str:
    """Return a table of both schemes: means for each share of messages that is lost."""
    rows = []
    for channel in CHANNELS:
        both = [missions[channel_id(channel, loss)] for loss in LOSSES]
        times = [f"{np.mean(_times(found)):,.0f}" for found in both]
        rows.append([channel, *times, *(f"{np.mean(_utilities(found)):.3f}" for found in both)])
    heads = [f"{what}, loss {loss:g}" for what in ("mean t (s)", "utility") for loss in LOSSES]
    return markdown_table(["channel", *heads], rows)


def flying_table(missions: Records) -> str:
    """Return a table of flying teams, world by world; a sentence if there are none."""
    rows = []
    for world, strategy in product(("cave", "corridor"), FLYING):
        if found := missions.get(flying_id(world, strategy), []):
            explored = [100.0 * record["joint"]["explored"] for record in found]
            rows.append([world, strategy, f"{np.mean(_times(found)):,.0f}", f"{np.mean(explored):.1f}"])
    head = ["world", "strategy", "mean t (s)", "explored (%)"]
    return markdown_table(head, rows) if rows else "None were run."


def _times(found: Sequence[Record]) -> list[float]:
    return [r["t_mission_s"] for r in found]


def _utilities(found: Sequence[Record]) -> list[float]:
    """Bits taken from the hearers' maps, for each bit sent."""
    return [r["bits_gained_per_bit_sent"] or 0.0 for r in found]
