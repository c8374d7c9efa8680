"""The results page of a head-to-head, with its tables and figures beside it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl

from baselines.cli.figures import STYLE, png
from baselines.experiments.tables import csv_table, markdown_table
from baselines.head_to_head.cells import BASELINE
from baselines.head_to_head.figures import profile_figure, time_figure
from baselines.head_to_head.rows import (
    MARKS,
    REFERENCES,
    Results,
    Row,
    clock_rows,
    failed_rows,
    mission_rows,
    overall_rows,
    scenario_rows,
)
from entropy_explore_env.scenario import Scenario
from entropy_explore_env.writing import write_atomically

PAGE = "head-to-head.md"
FILES = "head-to-head"
_DIGITS = 6
"""Significant digits of the CSV tables."""


def write_page(folder: Path, results: Results, command: str) -> Path:
    """Write the page, and beside it the folder `head-to-head` with tables (CSV) and figures (PNG).

    All but `timing.csv` depends on the missions alone: whatever was stopped and started again, the
    bytes are the same.

    Args:
        folder: Where.
        results: Of the experiment.
        command: What made them.

    Returns:
        Path of the page.
    """
    beside = folder / FILES
    scenarios, overall = scenario_rows(results), overall_rows(results)
    with mpl.rc_context(STYLE):
        profiles, shares = profile_figure(results)
        write_atomically(beside / "profiles.png", png(profiles))
        write_atomically(beside / "times.png", png(time_figure(results, scenarios)))
    tables = {
        "overall": overall,
        "scenarios": scenarios,
        "missions": mission_rows(results),
        "profiles": shares,
        "timing": clock_rows(results),
    }
    for name, rows in tables.items():
        write_atomically(beside / f"{name}.csv", csv_rows(rows))
    text = "\n\n".join(part.strip() for part in _parts(results, scenarios, overall, command)) + "\n"
    write_atomically(folder / PAGE, text)
    return folder / PAGE


def csv_rows(rows: Sequence[Row]) -> str:
    """Rows of equal keys as CSV; nothing where there is no figure."""
    return csv_table({name: [_cell(row[name]) for row in rows] for name in rows[0]})


def _cell(value: object) -> object:
    if value is None:
        return ""
    return f"{value:.{_DIGITS}g}" if isinstance(value, float) else value


def _parts(results: Results, scenarios: list[Row], overall: list[Row], command: str) -> list[str]:
    """The page from top to bottom."""
    seeds = results.entries.seeds
    parts = [
        "# Strategies head to head",
        f"Written by `{command}`: every strategy with the same {seeds} seed{'s' if seeds > 1 else ''} "
        "(worlds, starts and noise) in every scenario and team size.",
        _READING,
        "## All scenarios",
        _overall_table(overall),
        f"![Share of missions mapped over time]({FILES}/profiles.png)",
        "Performance profiles: the share of missions that were mapped within a multiple of the time that "
        f"`{BASELINE}` took with the same seed; missions cut off never are. Bands hold 95 %.",
        f"![Mission times]({FILES}/times.png)",
        "Mission times, interquartile means with 95 % intervals.",
    ]
    for name, scenario in results.entries.scenarios.items():
        rows = [row for row in scenarios if row["scenario"] == name]
        parts += [f"## {name}", _about(scenario), _scenario_table(rows)]
    failed = failed_rows(results)
    if failed:
        parts += ["## Missions that failed", _failed_table(failed)]
    return [*parts, _FILES]


_READING = f"""- A mission's time ends when the best map of the team reaches the entropy that the scenario
  asks for. A mission that the time limit cuts off, or that fails, counts with the limit.
- Relative time: over the time of `{BASELINE}` with the same seed; below 1 is faster. Where the walk
  itself is cut off, the true ratio is smaller.
- Figures are interquartile means, of the middle half of the missions; scans and what stands right of them
  over missions that did not fail. Intervals (…) hold 95 %: a bootstrap over seeds, within each scenario.
- Faster than: the probability that a mission beats one of the other strategy in the same scenario, ties
  ½, mean over scenarios. The measures are those of Agarwal et al., *Deep Reinforcement Learning at the
  Edge of the Statistical Precipice* (NeurIPS 2021).
- 50 / 90 / 99 %: when the best map had lost that share of the bits asked for. Scans over floor: the
  team's scans over the fewest that could map the world. Overlap: share of measurements that brought their
  own robot less than I_min. Balance: coefficient of variation of the bits that the robots gained."""

_FILES = f"""## Files

[`overall.csv`]({FILES}/overall.csv), [`scenarios.csv`]({FILES}/scenarios.csv),
[`missions.csv`]({FILES}/missions.csv) (a line a mission), [`profiles.csv`]({FILES}/profiles.csv), and
[`timing.csv`]({FILES}/timing.csv): milliseconds a decision and seconds a mission on the clock; it alone
differs from run to run."""


def _overall_table(rows: list[Row]) -> str:
    references = [reference for reference in REFERENCES if f"faster_than_{reference}" in rows[0]]
    head = ["robots", "strategy", "mapped", "relative time", "relative time to 90 %"]
    shown = [
        [
            row["robots"],
            f"`{row['strategy']}`",
            f"{row['mapped']:.0%}",
            ranged(row, "relative_time", ".2f"),
            ranged(row, "relative_t90", ".2f"),
            *(ranged(row, f"faster_than_{reference}", ".2f") for reference in references),
        ]
        for row in rows
    ]
    return markdown_table([*head, *(f"faster than `{reference}`" for reference in references)], shown)


def _scenario_table(rows: list[Row]) -> str:
    shown = [
        [
            row["robots"],
            f"`{row['strategy']}`",
            f"{row['mapped']} of {row['missions']}" + (f", {row['failed']} failed" if row["failed"] else ""),
            ranged(row, "time_s", ",.0f"),
            ranged(row, "relative_time", ".2f"),
            " / ".join(_reached(row, mark) for mark in MARKS),
            *(
                "-" if row[figure] is None else f"{row[figure]:{form}}"
                for figure, (_, form) in _FIGURES.items()
            ),
        ]
        for row in rows
    ]
    head = ["robots", "strategy", "mapped", "time (s)", "relative time", "50 / 90 / 99 % (s)"]
    return markdown_table([*head, *(label for label, _ in _FIGURES.values())], shown)


def _reached(row: Row, mark: str) -> str:
    """When a share of the bits was there; what the middle half of the missions never reached has no time."""
    return "-" if row[mark] >= row["time_limit_s"] else f"{row[mark]:,.0f}"


_FIGURES = {
    "scans_over_floor": ("scans over floor", ".1f"),
    "distance_m": ("driven (m)", ",.0f"),
    "bits_gained_per_bit_sent": ("bits gained per bit sent", ".2f"),
    "overlap": ("overlap", ".0%"),
    "balance": ("balance", ".2f"),
    "explored": ("explored", ".0%"),
    "error": ("map error", ".3f"),
}
"""Figure → its head and form on the page."""


def ranged(row: Row, name: str, form: str) -> str:
    """A figure and its interval."""
    if row[name] is None:
        return "-"
    low, high = row[f"{name}_low"], row[f"{name}_high"]
    return f"{row[name]:{form}} ({low:{form}} … {high:{form}})"


def _failed_table(rows: list[Row]) -> str:
    shown = [
        [
            row["scenario"],
            row["robots"],
            f"`{row['strategy']}`",
            ", ".join(map(str, row["seeds"])),
            _plain(row["reason"]),
        ]
        for row in rows
    ]
    return markdown_table(["scenario", "robots", "strategy", "seeds", "reason"], shown)


def _plain(text: str) -> str:
    """As it is, whatever Markdown would make of it."""
    return "".join(f"\\{sign}" if sign in r"\`*_{}[]<>()#!|~" else sign for sign in text)


def _about(scenario: Scenario) -> str:
    """What kind of mission a scenario is."""
    grid, file = scenario.grid, Path(scenario.world)
    shape = " × ".join(map(str, grid.shape if not grid.flat else grid.shape[:2]))
    kind = "ground" if scenario.planar else "flying"
    world = f"World file `{file.name}`" if file.is_file() else f"World `{scenario.world}`"
    return (
        f"{world}, {shape} voxels of {grid.voxel_size_m:g} m, {kind} robots, "
        f"time limit {scenario.ending.time_limit_s:,.0f} s."
    )
