"""Figures 3-8 of Rocha04."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from baselines.experiments.experiment import Records, sample
from baselines.experiments.plots import COLOURS, interval_line, one_axes
from baselines.experiments.rows import Record
from baselines.experiments.statistics import mean_interval
from baselines.papers.rocha04.claims import PAPER_T_MISSION_S
from baselines.papers.rocha04.sweep import BURSTS, I_MINS, STANDARD, TEAMS, alternative_id, team_id
from entropy_explore_env.errors import counted

_ALTERNATIVES = {
    "random": ("random walk", "x", "0.4", -0.1),
    "gradient-plane": ("motion plane", "d", "0.65", 0.1),
    "planned-rate": ("planned-rate (ours)", "^", "0.1", 0.15),
}
"""Strategy → label, marker, colour and shift along the axis."""


def _middle(cell: list[Record]) -> Record:
    """Return the mission with the median time of a cell."""
    return sorted(cell, key=lambda record: (record["t_mission_s"], record["seed"]))[len(cell) // 2]


def figure_3(records: Records) -> Figure:
    """Draw entropy along the mission of one robot, halves marked; the median mission."""
    record = _middle(records["single"])
    end = record["entropy_threshold_bits"] / 1000
    figure, axes = one_axes(xlabel="simulated time (s)", ylabel="entropy (1000 bits)")
    axes.plot(
        record["series"]["time_s"], np.asarray(record["series"]["entropy_bits"]) / 1000, color=COLOURS[0]
    )
    middle = 0.5 * (record["entropy_start_bits"] / 1000 + end)
    for time_s, level in ((record["half_s"], middle), (record["t_mission_s"], end)):
        axes.plot([time_s, time_s], [end, level], "--", color="0.5", linewidth=1)
        axes.plot([0, time_s], [level, level], "--", color="0.5", linewidth=1)
        side = "left" if level > 0 else "right"
        place = {"xytext": (4 if side == "left" else -14, 3), "textcoords": "offset points"}
        axes.annotate(f"{time_s:,.0f} s", (time_s, level), fontsize=8, va="bottom", ha=side, **place)
    ratio = record["t_mission_s"] / record["half_s"]
    axes.set(
        title=f"Fig. 3: one robot, median mission (seed {record['seed']}); ratio {ratio:.1f}, paper 7.45"
    )
    return figure


def figure_4(records: Records) -> Figure:
    """Draw entropy for team sizes, burst 64, I_min 0.3219; the median mission of each."""
    figure, axes = one_axes(
        xlabel="simulated time (s)",
        ylabel="entropy of the best map (1000 bits)",
        title="Fig. 4: team sizes, burst 64, I_min 0.3219; median missions",
    )
    for robots in (1, *TEAMS):
        record = _middle(records[team_id(robots, *STANDARD)])
        bits = np.asarray(record["series"]["entropy_bits"]) / 1000
        team = counted(robots, "robot")
        label = f"{team}, {record['measurements'] / robots:,.0f} own measurements each"
        axes.plot(record["series"]["time_s"], bits, color=COLOURS[robots - 1], label=label)
    axes.legend(frameon=False)
    return figure


def _lines(what: str) -> list[tuple[str, int, float]]:
    """Return label, burst and I_min of the lines of a figure over burst or I_min."""
    if what == "burst":
        return [(f"burst {burst}", burst, STANDARD[1]) for burst in BURSTS]
    return [(f"I_min {i_min_bits}", STANDARD[0], i_min_bits) for i_min_bits in I_MINS]


def figure_time(records: Records, what: str) -> Figure:
    """Draw the mean mission time over team size."""
    figure, axes = one_axes(
        xlabel="robots",
        ylabel="mission time (s)",
        xticks=[1, *TEAMS],
        title=f"Fig. {5 if what == 'burst' else 6}: mean mission time, 95 % intervals",
    )
    sizes = np.array([1, *TEAMS])
    for number, (label, burst, i_min_bits) in enumerate(_lines(what)):
        points = [mean_interval(sample(records, team_id(robots, burst, i_min_bits))) for robots in sizes]
        interval_line(axes, sizes + 0.05 * (number - 1), points, color=COLOURS[number], label=label)
    for strategy, (label, marker, colour, shift) in _ALTERNATIVES.items():
        points = [mean_interval(sample(records, alternative_id(robots, strategy))) for robots in sizes]
        style = {"linestyle": ":", "marker": marker, "color": colour, "label": f"{label}, 64, 0.3219"}
        interval_line(axes, sizes + shift, points, **style)
    axes.plot([1], [PAPER_T_MISSION_S], "k*", label="the paper's mean of 10 starts")
    axes.set(ylim=(0, None))
    axes.legend(frameon=False)
    return figure


def figure_shared(records: Records, what: str) -> Figure:
    """Draw measurements shared so far along the mission of two robots; the median mission of each line."""
    other = "I_min 0.3219" if what == "burst" else "burst 64"
    figure, axes = one_axes(
        xlabel="simulated time (s)",
        ylabel="measurements sent by the team",
        title=f"Fig. {7 if what == 'burst' else 8}: shared measurements, 2 robots, {other}; median missions",
    )
    for number, (label, burst, i_min_bits) in enumerate(_lines(what)):
        series = _middle(records[team_id(2, burst, i_min_bits)])["series"]
        axes.plot(series["time_s"], series["shared_measurements"], color=COLOURS[number], label=label)
    axes.legend(frameon=False)
    return figure
