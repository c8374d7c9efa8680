"""Teams that share batches of different width, and summaries of different frequency, as cells."""

from __future__ import annotations

from typing import Any, NamedTuple

from baselines.experiments.cells import Cell
from baselines.papers.sujan.summaries.mission import SharedMaps
from entropy_explore_env.scenario import with_settings
from entropy_explore_env.scenarios import find_scenario


class Task(NamedTuple):
    """What is explored."""

    strategy: str
    settings: dict[str, Any]
    moment_s: float
    """When the maps are compared, besides at the end: before the first mission of any channel ends."""


TASKS = {
    "office": Task("nearest-frontier", {}, 200.0),
    "occlusions": Task("nearest-frontier", {"robots": 3}, 800.0),
    "terrain": Task("gradient", {"ending": {"sigma_end": 0.1}}, 300.0),
}
"""Scenario → task; teams of three. Terrain is mapped less well than by default: missions are shorter."""
BURSTS = (2, 4, 8, 16, 32, 64)
"""Most measurements of a batch; I_min as the scenarios have it."""
EVERY_S = (5.0, 20.0, 60.0)
"""From one summary to the next one."""


def batch_id(task: str, burst: int) -> str:
    """Name of a cell of Rocha04's batches."""
    return f"{task}-batches-{burst}"


def summary_id(task: str, every_s: float) -> str:
    """Name of a cell of summaries."""
    return f"{task}-summaries-{every_s:g}"


def experiment(worlds: int) -> list[Cell]:
    """All cells, a mission a world; the worlds and starts are the same in all cells of a scenario."""
    cells = []
    for task in TASKS:
        cells += [_cell(task, batch_id(task, burst), {"burst": burst}, worlds) for burst in BURSTS]
        for every_s in EVERY_S:
            channel = {"content": "summaries", "summary_every_s": every_s}
            cells.append(_cell(task, summary_id(task, every_s), channel, worlds))
    return cells


def _cell(task: str, name: str, channel: dict[str, Any], worlds: int) -> Cell:
    strategy, settings, moment_s = TASKS[task]
    base = with_settings(find_scenario(task), settings)
    scenario = with_settings(base, {"channel": channel, "track_truth": True})
    return Cell(name, scenario, strategy, worlds, SharedMaps(moment_s))
