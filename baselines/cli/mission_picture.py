"""The picture of a whole mission: curves over time, and maps with the robots' paths."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize, PowerNorm
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patheffects import withStroke

from baselines.cli.figures import COLOURS, STYLE, extent_of, png
from entropy_explore_env.belief.elevation import elevation_map
from entropy_explore_env.errors import counted
from entropy_explore_env.reports.painting import entropy_share
from entropy_explore_env.reports.recording import Recorder, believed_poses_now
from entropy_explore_env.reports.rendering import estimate_outline
from entropy_explore_env.settings.grid import Grid

_UNKNOWN = "#c9d6e8"
_UNKNOWN_ABOVE = 0.9
"""A voxel counts as unknown while more than this share of its entropy is left."""
_HEIGHTS = "viridis"
"""Colours of heights: dark is low. None of them is like that of unknown columns."""
_LEAST_EXPONENT = 0.3
"""Of the scale of heights; see `_scale_of`."""
_MARK_SIZE = 5


class _Map(NamedTuple):
    """A map of the workspace from above."""

    values: np.ma.MaskedArray[Any, Any]
    """(X, Y); what is unknown is masked."""
    title: str
    label: str | None
    """Of its colour bar; None = it has none."""
    colours: str
    """Name of matplotlib's."""
    scale: Normalize
    """From values to shares of the way from the first colour to the last."""
    edge: str
    """Colour of the edges of marks, which stand out on it."""


def mission_picture(recorder: Recorder, title: str, strategy: str, truth: bool = False) -> bytes:
    """Entropy curves, shared measurements, and robot_0's map with all robots' paths.

    Of a plan the map is drawn as it is, of a volume the layer from which the robots scanned most. Ground
    below open sky, as that of terrains and cliffs, is seen from above: heights of the ground in place of
    coverage. Where robots drift, the map is that of the frame in which they believe to be; the paths are
    those that they truly drove, and each robot's estimate stands beside its true place, with an ellipse of
    two standard deviations.

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
    known, coverage, true_world = _maps(recorder)
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(14.5, 7.4) if truth else (11, 7.4), layout="constrained")
        if truth:
            places = figure.subplot_mosaic("aaabbb;eeccww")
            curves, shared, above, covered = (places[name] for name in "abec")
            _draw_map(figure, places["w"], true_world, recorder, believed=False)
        else:
            curves, shared, above, covered = figure.subplots(2, 2).ravel()
        _draw_entropies(curves, recorder)
        sent, label, of_what = _sent(recorder)
        shared.step(recorder.time_s, sent, where="post", color="0.2")
        shared.set(xlabel="simulated time (s)", ylabel=label, title=f"{of_what}, cumulative")
        _draw_map(figure, above, known, recorder, believed=True)
        _draw_map(figure, covered, coverage, recorder, believed=True)
        marks = _legend(recorder)
        figure.legend(handles=marks, loc="outside lower left", ncols=len(marks), frameon=False, fontsize=8)
        what = f"{title}, {strategy}, {counted(robots, 'robot')}, seed {missions.seeds[0]}"
        figure.suptitle(what, x=0.01, ha="left", fontsize=11)
        return png(figure)


def _sent(recorder: Recorder) -> tuple[np.ndarray, str, str]:
    """(T,) what the team has sent, the axis' label and what it is; scans of a robot that is alone."""
    scenario = recorder.missions.scenario
    if scenario.robots == 1:
        return recorder.scans, "scans", "Scans"
    if scenario.channel.content == "summaries":
        return recorder.bits_sent / 1000, "sent by the team (kbit)", "Summaries"
    return recorder.shared, "measurements sent by the team", "Shared measurements"


def _draw_entropies(axes: Axes, recorder: Recorder) -> None:
    """The entropy of each robot's map over time, and the threshold that ends the mission."""
    robots = recorder.missions.scenario.robots
    for robot in range(robots):
        axes.step(
            recorder.time_s,
            recorder.entropy_bits[:, robot] / 1000,
            where="post",
            color=COLOURS[robot % len(COLOURS)],
            linewidth=1.0 + 0.8 * (robots - 1 - robot),  # equal maps: all of the curves can be seen
            label=f"robot_{robot}",
        )
    threshold = float(recorder.missions.state.missions[0]["entropy_end_bits"]) / 1000
    axes.axhline(threshold, color="0.4", linewidth=1, linestyle="--", label="threshold")
    axes.set(xlabel="simulated time (s)", ylabel="entropy of the map (1000 bits)", title="Entropy")
    axes.legend(frameon=False, fontsize=8)


def _maps(recorder: Recorder) -> tuple[_Map, _Map, _Map]:
    """What is left of the entropy of robot_0's map, what its map shows, and the true world."""
    missions, grid = recorder.missions, recorder.missions.grid
    solid = missions.state.truth[0].reshape(grid.shape) > 0.5
    heights = _open_ground(solid)
    if heights is not None:
        return _maps_from_above(recorder, grid.origin_m[2] + grid.voxel_size_m * heights)
    layer = _busiest_layer(recorder.scan_positions_m, grid)
    height_m = grid.centre_of(np.array([0, 0, layer]))[2]
    where = "" if grid.flat else f"\nlayer at z = {height_m:.2f} m, paths at all heights"
    share = entropy_share(missions, 0, 0)[:, :, layer]
    cover = np.ma.masked_where(share > _UNKNOWN_ABOVE, missions.mean[0, 0][:, :, layer])
    left, knows, unit = f"What robot_0 has left{where}", f"What robot_0 knows{where}", Normalize(0.0, 1.0)
    return (
        _Map(np.ma.masked_array(share), left, "share of the entropy left", "magma", unit, "white"),
        _Map(cover, knows, "coverage; blue: unknown", "Greys", unit, "black"),
        _Map(
            np.ma.masked_array(solid[:, :, layer]),
            f"The true world, black: solid{where}",
            None,
            "Greys",
            unit,
            "black",
        ),
    )


def _maps_from_above(recorder: Recorder, true_m: np.ndarray) -> tuple[_Map, _Map, _Map]:
    """The same three maps of ground whose true heights (X, Y) are given, in metres."""
    missions = recorder.missions
    scenario, grid = missions.scenario, missions.grid
    share = np.ma.masked_array(entropy_share(missions, 0, 0).mean(axis=2))
    mean, precision = missions.mean[0, 0], missions.precision[0, 0]
    ground = elevation_map(mean, precision, grid, scenario.sigma_prior, scenario.sensor.sigma_min)
    believed_m = np.ma.masked_where(~ground.known, ground.height_m)
    scale = _scale_of(true_m)
    knows, label = "What robot_0 knows, from above", "height of the ground (m)"
    left = "What robot_0 has left, from above\nmean over each column"
    return (
        _Map(share, left, "share of the entropy left", "magma", Normalize(0.0, 1.0), "white"),
        _Map(believed_m, f"{knows}\nblue: unknown", label, _HEIGHTS, scale, "black"),
        _Map(np.ma.masked_array(true_m), "The true world, from above", label, _HEIGHTS, scale, "black"),
    )


def _scale_of(heights_m: np.ndarray) -> Normalize:
    """Half of the columns get the darker half of the colours: low ground below a cliff shows its rocks.

    Shares of the range are raised to a power; 1 at most, so that heights that are spread evenly stay so.
    """
    low, high = float(heights_m.min()), float(heights_m.max())
    middle = (float(np.median(heights_m)) - low) / max(high - low, 1e-9)
    exponent = math.log(0.5) / math.log(min(max(middle, 1e-9), 0.5))
    return PowerNorm(max(exponent, _LEAST_EXPONENT), low, high)


def _open_ground(solid: np.ndarray) -> np.ndarray | None:
    """(X, Y) layers of ground, where a volume is ground below open sky: nothing solid above anything free.

    None where it is not, and where the tops of most columns are no ground: empty, or walls to the roof.
    """
    layers = solid.shape[2]
    heights = solid.sum(axis=2)
    overhangs = (solid[:, :, 1:] & ~solid[:, :, :-1]).any()
    ground = float(((heights > 0) & (heights < layers)).mean()) > 0.5
    return heights if ground and not overhangs else None


def _draw_map(figure: Figure, axes: Axes, shown: _Map, recorder: Recorder, believed: bool) -> None:
    """A map with the paths over it, and where robots are `believed` to be where they drift."""
    image = axes.imshow(
        shown.values.T,
        origin="lower",
        extent=extent_of(recorder.missions.grid),
        cmap=mpl.colormaps[shown.colours].with_extremes(bad=_UNKNOWN),
        norm=shown.scale,
        aspect="equal",
    )
    axes.set(xlabel="x (m)", ylabel="y (m)")
    axes.set_title(shown.title, fontsize=8)
    if shown.label is not None:
        figure.colorbar(image, ax=axes, shrink=0.7, label=shown.label)
    fiducials_m = recorder.missions.state.fiducials[0]
    axes.plot(*fiducials_m[:, :2].T, **_mark("^", "white", "black"))
    drifts = recorder.missions.estimates is not None
    end = _mark("D", "none", shown.edge) if drifts else None
    for robot, path_m in enumerate(recorder.paths_m):
        colour = COLOURS[robot % len(COLOURS)]
        thin = [withStroke(linewidth=1.7, foreground=shown.edge)]
        axes.plot(path_m[:, 0], path_m[:, 1], color=colour, linewidth=0.9, path_effects=thin)
        axes.plot(*path_m[0, :2], **_mark("o", colour, shown.edge))
        axes.plot(*path_m[-1, :2], **(end or _mark("s", colour, shown.edge)))
    if believed:
        _draw_estimates(axes, recorder, shown.edge)


def _draw_estimates(axes: Axes, recorder: Recorder, edge: str) -> None:
    """Where robots believe to be, with an ellipse and a line to the true place, if they do not know it."""
    missions = recorder.missions
    if missions.estimates is None:
        return
    stroke = [withStroke(linewidth=3.0, foreground=edge)]
    for robot, pose in enumerate(believed_poses_now(missions, 0)):
        colour = COLOURS[robot % len(COLOURS)]
        outline = estimate_outline(pose[:3], missions.estimates[0][robot]["covariance"][:3, :3], up=1)
        to_truth = np.stack([pose[:3], recorder.paths_m[robot][-1]])
        axes.plot(*pose[:2], **_mark("s", "none", edge))
        for line in (outline, to_truth):  # over the marks, which are hollow: an ellipse may be smaller
            axes.plot(*line[:, :2].T, color=colour, linewidth=1.5, path_effects=stroke)


def _legend(recorder: Recorder) -> list[Line2D]:
    """What the marks on the maps mean."""
    drifts = recorder.missions.estimates is not None
    meanings = {"o": "start", "s": "end"}
    if drifts:
        meanings |= {"s": "end: where it believes to be, with an ellipse of 2 σ", "D": "where it truly is"}
    if recorder.missions.state.fiducials.shape[1]:
        meanings["^"] = "fiducial"
    inside = "none" if drifts else "white"
    return [Line2D([], [], label=text, **_mark(mark, inside, "black")) for mark, text in meanings.items()]


def _mark(marker: str, colour: Any, edge: str) -> dict[str, Any]:  # noqa: ANN401 - any of matplotlib's colours
    """How a mark is drawn."""
    return {
        "marker": marker,
        "markerfacecolor": colour,
        "markeredgecolor": edge,
        "markersize": _MARK_SIZE,
        "linestyle": "",
    }


def _busiest_layer(places_m: np.ndarray, grid: Grid) -> int:
    """Index along z of the layer with the most scans."""
    layers = grid.voxel_of(places_m.reshape(-1, 3))[:, 2]
    return int(np.bincount(np.clip(layers, 0, grid.shape[2] - 1)).argmax())
