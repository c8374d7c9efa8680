"""Plans from files, explored by the methods of Sawhney's experiment: mission times and computing time.

Real plans have what drawn ones lack: racks, clutter, and gaps that no robot gets through.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from baselines.experiments.outcome import Record
from baselines.experiments.statistics import mean_interval
from baselines.experiments.tables import markdown_table

TEAM, STARTS = 3, 5
METHODS = ("ptv", "beta-1", "beta-10", "beta-40", "finish", "nearest", "coordinated")
_MARK = "map-"


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
