"""Figures 3-8 of Rocha04, each with the numbers that it shows."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from baselines.cli.figures import COLOURS
from baselines.experiments.outcome import Record
from baselines.experiments.statistics import mean_interval
from baselines.papers.rocha04.claims import PAPER_T_MISSION_S, Records, times
from baselines.papers.rocha04.sweep import (
    ALTERNATIVES,
    BURSTS,
    I_MINS,
    STANDARD,
    TEAMS,
    alternative_id,
    team_id,
)

_LABELS = {
    "random": "random walk",
    "gradient-plane": "motion plane",
    "planned-rate": "planned-rate (ours)",
}


def _middle(cell: list[Record]) -> Record:
    """The mission with the median time of a cell."""
    return sorted(cell, key=lambda record: (record["t_mission_s"], record["seed"]))[len(cell) // 2]


def figure_3(records: Records) -> tuple[Figure, dict[str, list[object]]]:
    """Entropy along the mission of one robot, halves marked; the median mission."""
    record = _middle(records["single"])
    series = record["series"]
    figure = Figure(figsize=(6.4, 3.8), layout="constrained")
    axes = figure.subplots()
    axes.plot(series["time_s"], np.asarray(series["entropy_bits"]) / 1000, color=COLOURS[0])
    middle = 0.5 * (record["entropy_start_bits"] + record["entropy_threshold_bits"]) / 1000
    for time_s, level in (
        (record["half_s"], middle),
        (record["t_mission_s"], record["entropy_threshold_bits"] / 1000),
    ):
        axes.plot(
            [time_s, time_s], [record["entropy_threshold_bits"] / 1000, level], "--", color="0.5", linewidth=1
        )
        axes.plot([0, time_s], [level, level], "--", color="0.5", linewidth=1)
        axes.annotate(
            f" {time_s:,.0f} s " if level > 0 else f"{time_s:,.0f} s  ",
            (time_s, level),
            fontsize=8,
            va="bottom",
            ha="right" if level < 0 else "left",
        )
    ratio = record["t_mission_s"] / record["half_s"]
    axes.set(
        xlabel="simulated time (s)",
        ylabel="entropy (1000 bits)",
        title=f"Fig. 3: one robot, median mission (seed {record['seed']}); ratio {ratio:.1f}, paper 7.45",
    )
    return figure, {"time_s": series["time_s"], "entropy_bits": series["entropy_bits"]}


def figure_4(records: Records) -> tuple[Figure, dict[str, list[object]]]:
    """Entropy for team sizes, burst 64, I_min 0.3219; the median mission of each."""
    figure = Figure(figsize=(6.4, 3.8), layout="constrained")
    axes = figure.subplots()
    table: dict[str, list[object]] = {"robots": [], "time_s": [], "entropy_bits": []}
    for robots in (1, *TEAMS):
        record = _middle(records[team_id(robots, *STANDARD)])
        series = record["series"]
        received = record["measurements"] / robots
        label = f"{robots} robot{'s' if robots > 1 else ''}, {received:,.0f} own measurements each"
        axes.plot(
            series["time_s"],
            np.asarray(series["entropy_bits"]) / 1000,
            color=COLOURS[robots - 1],
            label=label,
        )
        table["robots"] += [robots] * len(series["time_s"])
        table["time_s"] += series["time_s"]
        table["entropy_bits"] += series["entropy_bits"]
    axes.legend(frameon=False)
    axes.set(
        xlabel="simulated time (s)",
        ylabel="entropy of the best map (1000 bits)",
        title="Fig. 4: team sizes, burst 64, I_min 0.3219; median missions",
    )
    return figure, table


def _lines(what: str) -> list[tuple[str, int, float]]:
    """Label, burst and I_min of the lines of a figure over burst or I_min."""
    if what == "burst":
        return [(f"burst {burst}", burst, STANDARD[1]) for burst in BURSTS]
    return [(f"I_min {i_min_bits}", STANDARD[0], i_min_bits) for i_min_bits in I_MINS]


def figure_time(records: Records, what: str) -> tuple[Figure, dict[str, list[object]]]:
    """Mean mission time over team size, with 95 % intervals."""
    figure = Figure(figsize=(6.4, 3.8), layout="constrained")
    axes = figure.subplots()
    table: dict[str, list[object]] = {name: [] for name in ("line", "robots", "mean_s", "low_s", "high_s")}
    for number, (label, burst, i_min_bits) in enumerate(_lines(what)):
        points = [mean_interval(times(records, team_id(robots, burst, i_min_bits))) for robots in (1, *TEAMS)]
        mean, low, high = (np.asarray(column) for column in zip(*points, strict=True))
        robots = np.asarray([1, *TEAMS]) + 0.05 * (number - 1)
        axes.errorbar(
            robots, mean, [mean - low, high - mean], marker="o", capsize=3, color=COLOURS[number], label=label
        )
        table["line"] += [label] * len(points)
        table["robots"] += [1, *TEAMS]
        for name, column in (("mean_s", mean), ("low_s", low), ("high_s", high)):
            table[name] += column.round(2).tolist()
    for alternative, marker, shift in zip(ALTERNATIVES, "xd^", (-0.1, 0.1, 0.15), strict=True):
        points = [
            mean_interval(times(records, alternative_id(robots, alternative))) for robots in (1, *TEAMS)
        ]
        mean, low, high = (np.asarray(column) for column in zip(*points, strict=True))
        axes.errorbar(
            np.asarray([1, *TEAMS]) + shift,
            mean,
            [mean - low, high - mean],
            linestyle=":",
            marker=marker,
            capsize=3,
            color={"random": "0.4", "gradient-plane": "0.65"}.get(alternative, "0.1"),
            label=f"{_LABELS[alternative]}, 64, 0.3219",
        )
    axes.plot([1], [PAPER_T_MISSION_S], "k*", label="the paper's mean of 10 starts")
    axes.set(
        xlabel="robots",
        ylabel="mission time (s)",
        xticks=[1, *TEAMS],
        ylim=(0, None),
        title=f"Fig. {5 if what == 'burst' else 6}: mean mission time, 95 % intervals",
    )
    axes.legend(frameon=False)
    return figure, table


def figure_shared(records: Records, what: str) -> tuple[Figure, dict[str, list[object]]]:
    """Measurements shared so far along the mission of two robots; the median mission of each line."""
    figure = Figure(figsize=(6.4, 3.8), layout="constrained")
    axes = figure.subplots()
    table: dict[str, list[object]] = {"line": [], "time_s": [], "shared_measurements": []}
    for number, (label, burst, i_min_bits) in enumerate(_lines(what)):
        series = _middle(records[team_id(2, burst, i_min_bits)])["series"]
        axes.plot(series["time_s"], series["shared_measurements"], color=COLOURS[number], label=label)
        table["line"] += [label] * len(series["time_s"])
        table["time_s"] += series["time_s"]
        table["shared_measurements"] += series["shared_measurements"]
    other = "I_min 0.3219" if what == "burst" else "burst 64"
    axes.set(
        xlabel="simulated time (s)",
        ylabel="measurements sent by the team",
        title=f"Fig. {7 if what == 'burst' else 8}: shared measurements, 2 robots, {other}; median missions",
    )
    axes.legend(frameon=False)
    return figure, table
