"""The experiment as cells: every team strategy, every fault, team sizes, the same seeds in each.

The robot that is lost stops at half the median time of the missions in which nothing fails: those run first.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np

from baselines.experiments.cells import Cell
from baselines.experiments.mission import figures_record
from baselines.experiments.outcome import Record
from entropy_explore_env.errors import SettingError
from entropy_explore_env.scenario import Scenario, with_settings
from entropy_explore_env.scenarios import find_scenario

Records = dict[str, list[Record]]

STRATEGIES = (
    "planned-rate",
    "mutual-information",
    "per-time-visibility",
    "coordinated-frontier",
    "assigned-frontier",
    "voronoi",
)
"""Those that use where teammates are, or what they announce; not their variants."""
LOSSES = (0.0, 0.3, 0.6, 0.9)
RANGE_M = 3.0
"""A few voxels' sight, and a third of the room."""
NOTHING_FAILS, ISOLATED, LOST, LOST_ISOLATED = "loss-0", "isolated", "lost", "lost-isolated"
_ALONE = {"burst": 0, "announcements": False}
"""The same robots, each on its own: nobody says anything."""


def loss_name(loss: float) -> str:
    """Name of the condition with this probability of losing a message."""
    return f"loss-{round(100 * loss)}"


CHANNELS: Mapping[str, dict[str, Any]] = MappingProxyType(
    {
        **{loss_name(loss): {"loss_probability": loss} for loss in LOSSES},
        "burst-0": {"burst": 0},
        "range": {"range_m": RANGE_M},
        "sight": {"reach": "line_of_sight"},
        ISOLATED: _ALONE,
    }
)
"""Name → settings of the channel, where no robot is lost."""
TEXTS: Mapping[str, str] = MappingProxyType(
    {
        **{loss_name(loss): f"{loss:.0%} of messages lost" for loss in LOSSES},
        NOTHING_FAILS: "nothing fails",
        "burst-0": "only announcements",
        "range": f"range {RANGE_M:g} m",
        "sight": "line of sight",
        ISOLATED: "isolated",
        LOST: "one robot lost",
        LOST_ISOLATED: "isolated, one lost",
    }
)
"""Name of a condition → as people read it."""


@dataclass(frozen=True)
class Experiment:
    """What is compared.

    Attributes:
        teams: Name of a scenario and size of the team, at least 2, in the order of the page.
        strategies: Names of strategies.
        seeds: Missions of each cell.
        time_limit_s: Of every mission, simulated.
    """

    teams: tuple[tuple[str, int], ...]
    strategies: tuple[str, ...]
    seeds: int
    time_limit_s: float

    def first_cells(self) -> list[Cell]:
        """All in which no robot is lost."""
        return [
            self._cell(scenario, robots, strategy, name, {"channel": channel})
            for scenario, robots in self.teams
            for name, channel in CHANNELS.items()
            for strategy in self.strategies
        ]

    def lost_cells(self, records: Records) -> list[Cell]:
        """Those in which the last robot stops for good; `records` are those of the first cells."""
        cells = []
        for scenario, robots in self.teams:
            for strategy in self.strategies:
                whole = times(records, cell_id(scenario, robots, strategy, NOTHING_FAILS))
                at_s = round(0.5 * float(np.median(whole)), 1)
                faults = {"stop": {"at_s": at_s, "robots": (robots - 1,)}}
                for name, channel in ((LOST, {}), (LOST_ISOLATED, _ALONE)):
                    settings = {"channel": channel, "faults": faults}
                    cells.append(self._cell(scenario, robots, strategy, name, settings))
        return cells

    def _cell(self, scenario: str, robots: int, strategy: str, name: str, settings: dict[str, Any]) -> Cell:
        task, group = self._task(scenario, robots, settings), f"{scenario}-{robots}/{strategy}"
        cell = cell_id(scenario, robots, strategy, name)
        return Cell(cell, task, strategy, self.seeds, figures_record, group=group)

    def _task(self, name: str, robots: int, settings: dict[str, Any]) -> Scenario:
        shared = {"robots": robots, "time_limit_s": self.time_limit_s}
        return with_settings(find_scenario(name), {**shared, **settings})


def checked(experiment: Experiment) -> Experiment:
    """The experiment, if it can be run.

    Raises:
        SettingError: A scenario is unknown, or a team has fewer than two robots.
    """
    for name, robots in experiment.teams:
        find_scenario(name)
        if robots < 2:
            raise SettingError("robots", robots, "team sizes of at least 2")
    return experiment


def cell_id(scenario: str, robots: int, strategy: str, condition: str) -> str:
    """Name of a cell."""
    return f"{scenario}-{robots}/{strategy}/{condition}"


def times(records: Records, cell: str) -> np.ndarray:
    """(N,) mission times of a cell in seconds, by seed; a mission that was cut off counts with its limit.

    So do missions in which all robots stopped, or that failed: see `time_of`.
    """
    return np.asarray([time_of(record) for record in records[cell]])


def time_of(record: Record) -> float:
    """Seconds of one mission; NaN of one that raised an error or never ended."""
    return float("nan") if "failed" in record else float(record["t_mission_s"])


def conditions(lost: bool = True) -> Sequence[str]:
    """All conditions, in the order of the page."""
    return [*CHANNELS, *((LOST, LOST_ISOLATED) if lost else ())]
