"""Maps of three scenarios as cells: which strategy makes them, and of how many scans."""

from __future__ import annotations

from baselines.experiments.cells import Cell
from baselines.papers.sujan.sharing.mission import record_summaries
from entropy_explore_env.scenario import with_settings
from entropy_explore_env.scenarios import find_scenario

MAKERS = {"occlusions": "nearest-frontier", "office": "nearest-frontier", "terrain": "random"}
"""Scenario → what one robot maps it by."""
SCANS = 60


def experiment(worlds: int) -> list[Cell]:
    """All cells; a mission a world."""
    settings = {"robots": 1, "ending": {"max_cycles": SCANS, "time_limit_s": 1e6}}
    return [
        Cell(name, with_settings(find_scenario(name), settings), strategy, worlds, record_summaries)
        for name, strategy in MAKERS.items()
    ]
