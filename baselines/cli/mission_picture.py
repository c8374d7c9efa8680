"""The picture of a whole mission: curves over time, and the library's picture of its end, in print size."""

from __future__ import annotations

import io
from dataclasses import replace

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from PIL import Image

from baselines.cli.figures import COLOURS, DOTS_PER_INCH, STYLE, packed_png, png
from entropy_explore_env.errors import counted
from entropy_explore_env.reports.recording import Recorder
from entropy_explore_env.reports.rendering import Frame, draw_frame

_WIDTH, _HEIGHT, _CURVES_HEIGHT = 1280, 960, 400
"""Pixels of the mission's end, and height of the curves above it."""


def mission_picture(recorder: Recorder, end: Frame, title: str, strategy: str, truth: bool = False) -> bytes:
    """Draw entropy curves, what the team has sent, and the maps at the end with all robots' paths.

    Args:
        recorder: Record of a mission that has ended.
        end: Its last moment.
        title: The scenario and its world.
        strategy: Name of the strategy.
        truth: Whether the true world stands below.

    Returns:
        A PNG file.
    """
    missions = recorder.missions
    with mpl.rc_context(STYLE):
        size = (_WIDTH / DOTS_PER_INCH, _CURVES_HEIGHT / DOTS_PER_INCH)
        figure = Figure(figsize=size, layout="constrained")
        left, right = figure.subplots(1, 2)
        _draw_entropies(left, recorder)
        sent, label, of_what = _sent(recorder)
        right.step(recorder.series().time_s, sent, where="post", color="0.2")
        right.set(xlabel="simulated time (s)", ylabel=label, title=f"{of_what}, cumulative")
        what = f"{title}, {strategy}, {counted(missions.scenario.robots, 'robot')}, seed {missions.seeds[0]}"
        figure.suptitle(what, x=0.01, ha="left", fontsize=11)
        curves = np.asarray(Image.open(io.BytesIO(png(figure))).convert("RGB"))
    frames = [end, true_world(end, recorder)] if truth else [end]
    pictures = [draw_frame(frame, _WIDTH, _HEIGHT) for frame in frames]
    return packed_png(Image.fromarray(np.concatenate([curves, *pictures])))


def true_world(frame: Frame, recorder: Recorder) -> Frame:
    """Return a moment of a mission with the true world in place of the map, and the robots where they are."""
    truth = recorder.missions.state.truth[0].reshape(frame.coverage.shape)
    drifts = len(frame.true_m) > 0
    return replace(
        frame,
        title="the true world",
        coverage=truth,
        entropy_share=np.zeros_like(frame.entropy_share),
        positions_m=frame.true_m if drifts else frame.positions_m,
        covariances_m2=frame.covariances_m2[:0],
        true_m=frame.true_m[:0],
    )


def _sent(recorder: Recorder) -> tuple[np.ndarray, str, str]:
    """(T,) what the team has sent, the axis' label and what it is; scans of a robot that is alone."""
    scenario, series = recorder.missions.scenario, recorder.series()
    if scenario.robots == 1:
        return series.scans[:, 0], "scans", "Scans"
    if scenario.channel.content == "summaries":
        return series.bits_sent / 1000, "sent by the team (kbit)", "Summaries"
    return series.shared, "measurements sent by the team", "Shared measurements"


def _draw_entropies(axes: Axes, recorder: Recorder) -> None:
    """Draw the entropy of each robot's map over time, and the threshold that ends the mission."""
    robots, series = recorder.missions.scenario.robots, recorder.series()
    for robot in range(robots):
        axes.step(
            series.time_s,
            series.entropy_bits[:, robot] / 1000,
            where="post",
            color=COLOURS[robot % len(COLOURS)],
            linewidth=1.0 + 0.8 * (robots - 1 - robot),  # equal maps: all of the curves can be seen
            label=f"robot_{robot}",
        )
    threshold = float(recorder.missions.state.missions[0]["entropy_end_bits"]) / 1000
    axes.axhline(threshold, color="0.4", linewidth=1, linestyle="--", label="threshold")
    axes.set(xlabel="simulated time (s)", ylabel="entropy of the map (1000 bits)", title="Entropy")
    axes.legend(frameon=False, fontsize=8)
