"""The picture of a whole mission: the library's picture of its end, with curves in print quality."""

from __future__ import annotations

import io
from dataclasses import replace

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from PIL import Image

from baselines.experiments.plots import COLOURS, DOTS_PER_INCH, STYLE, packed_png, png
from entropy_explore_env.errors import counted
from entropy_explore_env.reports.recording import Recorder
from entropy_explore_env.reports.rendering import Frame, draw_frame, layout_of

_WIDTH, _HEIGHT = 1110, 830
_LEAST_CURVES = 210
"""Height of curves in pixels; where maps leave less room, the picture is higher."""
_NARROW = 560
"""Width in pixels up to which curves stand one above the other."""


def mission_picture(recorder: Recorder, end: Frame, title: str, strategy: str, truth: bool = False) -> bytes:
    """Draw the entropy curves of a mission, what the team has sent, and its end with all robots' paths.

    The title says the scenario and its world. With `truth` the true world stands below.

    Returns:
        A PNG file.
    """
    missions = recorder.missions
    what = f"{title}, {strategy}, {counted(missions.scenario.robots, 'robot')}, seed {missions.seeds[0]}"
    end = replace(end, title=f"{what}: belief of robot_0")
    picture = draw_frame(end, _WIDTH, _HEIGHT)
    room = layout_of(end, _WIDTH, _HEIGHT).room
    height = max(_HEIGHT - room.top, _LEAST_CURVES)
    picture = np.pad(picture, ((0, room.top + height - _HEIGHT), (0, 0), (0, 0)), constant_values=255)
    picture[room.top :, room.left :] = _curves(recorder, _WIDTH - room.left, height)
    pictures = [picture, draw_frame(true_world(end, recorder), _WIDTH, _HEIGHT)] if truth else [picture]
    return packed_png(Image.fromarray(np.concatenate(pictures)))


def _curves(recorder: Recorder, width: int, height: int) -> np.ndarray:
    """Draw entropies and what was sent, (height, width, 3) uint8."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(width / DOTS_PER_INCH, height / DOTS_PER_INCH), layout="constrained")
        rows = 2 if width <= _NARROW else 1
        first, second = figure.subplots(rows, 3 - rows).ravel()
        _draw_entropies(first, recorder)
        sent, label = _sent(recorder)
        second.step(recorder.series().time_s, sent, where="post", color="0.2")
        second.set(xlabel="time (s)", ylabel=label)
        drawn = Image.open(io.BytesIO(png(figure))).convert("RGB").resize((width, height))
    return np.asarray(drawn)


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


def _sent(recorder: Recorder) -> tuple[np.ndarray, str]:
    """Return (T,) what the team has sent so far, and the axis' label; scans of a robot that is alone."""
    scenario, series = recorder.missions.scenario, recorder.series()
    if scenario.robots == 1:
        return series.scans[:, 0], "scans"
    if scenario.channel.content == "summaries":
        return series.bits_sent / 1000, "sent (kbit)"
    return series.shared, "measurements sent"


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
        )
    threshold = float(recorder.missions.state.missions[0]["entropy_end_bits"]) / 1000
    axes.axhline(threshold, color="0.4", linewidth=1, linestyle="--", label="threshold")
    axes.set(xlabel="time (s)", ylabel="entropy (kbit)")
    small = {"handlelength": 1.2, "handletextpad": 0.4, "borderpad": 0.0}
    axes.legend(loc="upper right", frameon=False, fontsize=8, **small)  # entropy falls: no curve is there
