"""The table of what there is to win, as the command `headroom` measured it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from baselines.experiments.statistics import Interval
from baselines.experiments.tables import markdown_table
from baselines.scoreboard.suites import team_name
from entropy_explore_env.errors import SettingError

_NAMES = {
    "clairvoyant": "clairvoyant over planner",
    "planned-rate": "`planned-rate` over planner",
    "restricted": "`planned-rate`, discrete actions, over planner",
}
"""Rows beside the planner's, and the heads of their columns."""


def shown(folder: Path) -> str:
    """What was written to a folder, as a Markdown table; nothing where nothing was.

    Raises:
        SettingError: Something else lies there.
    """
    files = sorted(folder.glob("*.json"))
    head = ["task", "starts", "clairvoyant at one decision of", "planner", *_NAMES.values()]
    return markdown_table(head, [table_row(file) for file in files]) if files else ""


def table_row(file: Path) -> list[str]:
    """The row of a file.

    Raises:
        SettingError: It is none that the command wrote.
    """
    try:
        found = json.loads(file.read_text())
        rows = {row["name"]: row for row in found["rows"]}
        cells = [team_name(found["scenario"], found["robots"]), str(found["missions"]), str(found["every"])]
        if found["horizon"] or found["divisor"] > 1:
            deep = f"{found['horizon']} decisions deep" if found["horizon"] else "to the end"
            cells[-1] += f", {deep}, drawing 1/{found['divisor']}"
        cells.append(f"{rows['planner']['median_s']:,.0f} s")
        return cells + [_ratio_text(rows.get(name), found["missions"]) for name in _NAMES]
    except (ValueError, KeyError, TypeError) as error:
        wanted = "a file that python -m training.policy_improvement.headroom wrote"
        raise SettingError("headroom", str(file), wanted) from error


def _ratio_text(row: dict[str, Any] | None, missions: int) -> str:
    """A row's ratio; where missions were cut off, and count with their time limit, how many were not."""
    if row is None:
        return "-"
    ratio = Interval(*(row[f"mean_ratio{end}"] for end in ("", "_low", "_high")))
    finished = row["finished"]
    return ratio.text() + ("" if finished == missions else f", {finished} of {missions} finished")
