"""Plans from files, explored by the methods of Sawhney's experiment: who is how fast, and what it costs.

Real plans have what drawn ones lack: racks, clutter, and gaps that no robot gets through.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from baselines.experiments.mission import Record
from baselines.experiments.statistics import mean_interval
from baselines.experiments.tables import markdown_table
from baselines.papers.sawhney.mission import Run
from baselines.strategies.frontier import ExplorationConfig
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.scenario import Scenario

TEAM, STARTS = 3, 5
METHODS = ("ptv", "beta-1", "beta-10", "beta-40", "finish", "nearest", "coordinated")
_MARK = "map-"


@dataclass(frozen=True)
class MapRun:
    """Runs a mission in the plan of a file.

    Attributes:
        exploring: Of the robots.
        world: The file.
    """

    exploring: ExplorationConfig
    world: str

    def __call__(self, env: EntropyExploreEnv, strategy: str, seed: int) -> Record:
        """Run the mission: what `Run` gives, and `clock_s`, seconds of computing."""
        there, began = _in_plan(env.scenario, self.world), time.process_time()
        record = Run(self.exploring)(there, strategy, seed)
        return {**record, "clock_s": round(time.process_time() - began, 3)}


@lru_cache(maxsize=1)
def _in_plan(scenario: Scenario, world: str) -> EntropyExploreEnv:
    """An environment in the plan, kept for the next mission."""
    return EntropyExploreEnv(scenario, world={"path": world})


def map_world(file: Path) -> str:
    """Name of the world of a file."""
    return _MARK + file.stem


def maps_table(records: Mapping[str, Sequence[Record]], ends: Mapping[str, str]) -> str:
    """Mean times of every method in the plans of files with intervals, as Markdown; empty without such plans.

    Args:
        records: Cell id → records.
        ends: Name of a time in a record → its heading.
    """
    rows = []
    for cell, found in records.items():
        world, _, method = cell.split("/")
        if world.startswith(_MARK):
            times = [
                "{:,.0f} s ({:,.0f} … {:,.0f})".format(*mean_interval([record[end] for record in found]))
                for end in ends
            ]
            explored = np.mean([record["explored"] for record in found])
            clock_s = np.median([record["clock_s"] for record in found])  # of the first one compiling is part
            rows.append([world[len(_MARK) :], f"`{method}`", *times, f"{explored:.2%}", f"{clock_s:.1f} s"])
    return markdown_table(["plan", "method", *ends.values(), "explored", "computing"], rows) if rows else ""
