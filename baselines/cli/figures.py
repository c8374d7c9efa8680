"""Figures of a mission: curves, and slices of the map with the robots' paths."""

from __future__ import annotations

import io
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from entropy_explore_env.reports.colours import robot_colour
from entropy_explore_env.reports.painting import entropy_share
from entropy_explore_env.reports.recording import Recorder
from entropy_explore_env.settings import Grid

COLOURS = tuple(tuple(level / 255 for level in robot_colour(robot)) for robot in range(8))
"""Of the robots, as in every other picture; colour-blind people can tell them apart."""


STYLE: Any = {"font.size": 9, "axes.spines.top": False, "axes.spines.right": False}
"""Of all figures: matplotlib's settings."""


def png(figure: Figure, dots_per_inch: int = 110) -> bytes:
    """The figure as the bytes of a PNG file, the same bytes for the same figure."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=dots_per_inch, metadata={"Software": None})
    return buffer.getvalue()


def mission_picture(recorder: Recorder, title: str, strategy: str, truth: bool = False) -> bytes:
    """Entropy curves, shared measurements, and slices of robot_0's map with all robots' paths.

    Args:
        recorder: Of a mission that has ended.
        title: What it was: the scenario and its world.
        strategy: Name of the strategy.
        truth: Whether the true world stands beside the map.

    Returns:
        A PNG file.
    """
    missions = recorder.missions
    robots = missions.scenario.robots
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(14.5, 7.2) if truth else (11, 7.2), layout="constrained")
        if truth:
            places = figure.subplot_mosaic("aaabbb;eeccww")
            curves, shared, above, covered = (places[name] for name in "abec")
            _true_slice(places["w"], recorder)
        else:
            curves, shared, above, covered = figure.subplots(2, 2).ravel()
        for robot in range(robots):
            colour = COLOURS[robot % len(COLOURS)]
            curves.step(
                recorder.time_s,
                recorder.entropy_bits[:, robot] / 1000,
                where="post",
                color=colour,
                linewidth=1.0 + 0.8 * (robots - 1 - robot),  # equal maps: all of the curves can be seen
                label=f"robot_{robot}",
            )
        threshold = float(missions.state.missions[0]["entropy_end_bits"]) / 1000
        curves.axhline(threshold, color="0.4", linewidth=1, linestyle="--", label="threshold")
        curves.set(xlabel="simulated time (s)", ylabel="entropy of the map (1000 bits)", title="Entropy")
        curves.legend(frameon=False, fontsize=8)
        alone = robots == 1  # it shares with nobody
        shared.step(recorder.time_s, recorder.scans if alone else recorder.shared, where="post", color="0.2")
        shared.set(
            xlabel="simulated time (s)",
            ylabel="scans" if alone else "measurements sent by the team",
            title="Scans, cumulative" if alone else "Shared measurements, cumulative",
        )
        _slice(figure, above, recorder, entropy=True)
        _slice(figure, covered, recorder, entropy=False)
        team = f"{robots} robot{'s' if robots > 1 else ''}"
        figure.suptitle(
            f"{title}, {strategy}, {team}, seed {missions.seeds[0]}", x=0.01, ha="left", fontsize=11
        )
        return png(figure)


def _slice(figure: Figure, axes: Axes, recorder: Recorder, entropy: bool) -> None:
    """The layer of the map from which the robots scanned most, and the paths over it."""
    missions, grid = recorder.missions, recorder.missions.grid
    layer = _busiest_layer(recorder.scan_positions_m, grid)
    share = entropy_share(missions, 0, 0)[:, :, layer]
    shown = share if entropy else np.ma.masked_where(share > 0.9, missions.mean[0, 0][:, :, layer])
    colours = mpl.colormaps["magma" if entropy else "Greys"].with_extremes(bad="#c9d6e8")
    image = axes.imshow(
        shown.T, origin="lower", extent=extent_of(grid), cmap=colours, vmin=0, vmax=1, aspect="equal"
    )
    _draw_paths(axes, recorder, edge="white" if entropy else "black")
    height_m = grid.centre_of(np.array([0, 0, layer]))[2]
    height = "" if grid.flat else f"z = {height_m:.2f} m; paths at all heights, "
    axes.set(xlabel="x (m)", ylabel="y (m)")
    axes.set_title(f"What robot_0 knows\n{height}○ start, □ end", fontsize=8)
    label = "share of the entropy left" if entropy else "coverage; blue: unknown"
    figure.colorbar(image, ax=axes, shrink=0.7, label=label)


def _true_slice(axes: Axes, recorder: Recorder) -> None:
    """The same layer of the true world, with the paths over it."""
    missions, grid = recorder.missions, recorder.missions.grid
    layer = _busiest_layer(recorder.scan_positions_m, grid)
    solid = missions.state.truth[0].reshape(grid.shape)[:, :, layer]
    axes.imshow(solid.T, origin="lower", extent=extent_of(grid), cmap="Greys", vmin=0, vmax=1, aspect="equal")
    _draw_paths(axes, recorder, edge="black")
    axes.set(xlabel="x (m)", ylabel="y (m)")
    height_m = grid.centre_of(np.array([0, 0, layer]))[2]
    height = "" if grid.flat else f"z = {height_m:.2f} m; "
    axes.set_title(f"The true world\n{height}black: solid", fontsize=8)


def _draw_paths(axes: Axes, recorder: Recorder, edge: str) -> None:
    """All robots' paths, with marks at start and end that have edges of a colour."""
    for robot, path_m in enumerate(recorder.paths_m):
        colour = COLOURS[robot % len(COLOURS)]
        axes.plot(path_m[:, 0], path_m[:, 1], color=colour, linewidth=0.9)
        axes.plot(*path_m[0, :2], marker="o", color=colour, markersize=5, markeredgecolor=edge)
        axes.plot(*path_m[-1, :2], marker="s", color=colour, markersize=5, markeredgecolor=edge)


def extent_of(grid: Grid) -> tuple[float, float, float, float]:
    """A workspace from above, in metres, as matplotlib's `imshow` wants it: left, right, bottom, top."""
    low, size = grid.origin_m, grid.size_m
    return float(low[0]), float(low[0] + size[0]), float(low[1]), float(low[1] + size[1])


def _busiest_layer(places_m: np.ndarray, grid: Grid) -> int:
    """Index along z of the layer with the most scans."""
    layers = grid.voxel_of(places_m.reshape(-1, 3))[:, 2]
    return int(np.bincount(np.clip(layers, 0, grid.shape[2] - 1)).argmax())
