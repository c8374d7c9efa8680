"""The picture of a whole mission: curves over time, and maps with the robots' paths."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.colors import Normalize, PowerNorm
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patheffects import withStroke
from matplotlib.ticker import MaxNLocator

from baselines.cli.figures import COLOURS, STYLE, png
from entropy_explore_env.belief.elevation import elevation_map
from entropy_explore_env.errors import counted
from entropy_explore_env.picture_text import base_m
from entropy_explore_env.reports.painting import entropy_share
from entropy_explore_env.reports.projection import projections
from entropy_explore_env.reports.recording import Recorder, believed_poses_now, stopped_now
from entropy_explore_env.reports.rendering import estimate_outline
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.robot_kind import RobotKind

_UNKNOWN = "#c9d6e8"
_UNKNOWN_ABOVE = 0.9
"""A voxel counts as unknown while more than this share of its entropy is left."""
_HEIGHTS = "viridis"
"""Colours of heights: dark is low. None of them is like that of unknown columns."""
_LEAST_EXPONENT = 0.3
"""Of the scale of heights; see `_scale_of`."""
_MARK_SIZE = 5


class _Map(NamedTuple):
    """A map of the workspace from above, and of a volume also from the side."""

    values: np.ma.MaskedArray[Any, Any]
    """(X, Y); what is unknown is masked."""
    title: str
    label: str | None
    """Text at its colour bar; None: it has no colour bar."""
    colours: str
    """Name of matplotlib's colours."""
    scale: Normalize
    """Maps values to shares of the way from the first colour to the last."""
    edge: str
    """Colour of the edges of marks, which stands out on it."""
    side: np.ma.MaskedArray[Any, Any] | None = None
    """(X, Z), the same from the side."""


_COLUMN_INCHES, _WIDE_INCHES = 5.5, 4.8
"""Width of a map's column, of two and of three columns."""
_CURVES_INCHES, _LEGEND_INCHES = 3.3, 0.5
_MAP_INCHES, _SIDE_INCHES = (1.6, 6.0), (0.9, 2.5)
"""Least and largest height of a map from above, and of one from the side."""
_AROUND_MAP_INCHES = 0.8
"""Title and ticks of a map."""


def mission_picture(recorder: Recorder, title: str, strategy: str, truth: bool = False) -> bytes:
    """Draw entropy curves, shared measurements, and robot_0's map with all robots' paths.

    A plan is drawn as it is, a volume from above and from the side, projected along the line of sight. Ground
    below open sky, as that of terrains and cliffs, is seen from above, by its heights. Where robots drift,
    the map is that of the frame in which they believe to be; the paths are those that they truly drove, and
    each robot's estimate stands beside its true place, with an ellipse of two standard deviations.

    Args:
        recorder: Record of a mission that has ended.
        title: The scenario and its world.
        strategy: Name of the strategy.
        truth: Whether the true world stands beside the map.

    Returns:
        A PNG file.
    """
    missions = recorder.missions
    robots = missions.scenario.robots
    maps = _maps(recorder)[: 3 if truth else 2]
    with mpl.rc_context(STYLE):
        figure, places = _page(missions.grid, len(maps), maps[0].side is not None)
        _draw_entropies(places["entropy"], recorder)
        sent, label, of_what = _sent(recorder)
        places["sent"].step(recorder.time_s, sent, where="post", color="0.2")
        places["sent"].set(xlabel="simulated time (s)", ylabel=label, title=f"{of_what}, cumulative")
        for number, shown in enumerate(maps):
            for up in (1,) if shown.side is None else (1, 2):
                _draw_map(figure, places[f"{number}-{up}"], shown, recorder, number < 2, up)
        marks = _legend(recorder)
        figure.legend(handles=marks, loc="outside lower left", ncols=len(marks), frameon=False, fontsize=8)
        what = f"{title}, {strategy}, {counted(robots, 'robot')}, seed {missions.seeds[0]}"
        figure.suptitle(what, x=0.01, ha="left", fontsize=11)
        return png(figure)


def _page(grid: Grid, maps: int, sides: bool) -> tuple[Figure, dict[str, Axes]]:
    """Return a figure as high as its maps need, and its axes `entropy`, `sent`, `0-1`, `0-2`, … by name."""
    column = _COLUMN_INCHES if maps == 2 else _WIDE_INCHES
    length, width, height = grid.size_m
    above = float(np.clip(0.8 * column * width / length, *_MAP_INCHES)) + _AROUND_MAP_INCHES
    side = float(np.clip(0.8 * column * height / length, *_SIDE_INCHES)) + _AROUND_MAP_INCHES
    heights = [_CURVES_INCHES, above, *([side] if sides else [])]
    rows = [[name for name in ("entropy", "sent") for _ in range(3)]]
    rows += [
        [f"{number}-{up}" for number in range(maps) for _ in range(6 // maps)]
        for up in ((1, 2) if sides else (1,))
    ]
    figure = Figure(figsize=(maps * column, sum(heights) + _LEGEND_INCHES), layout="constrained")
    return figure, figure.subplot_mosaic(rows, height_ratios=heights)  # type: ignore[return-value]


def _sent(recorder: Recorder) -> tuple[np.ndarray, str, str]:
    """(T,) what the team has sent, the axis' label and what it is; scans of a robot that is alone."""
    scenario = recorder.missions.scenario
    if scenario.robots == 1:
        return recorder.scans, "scans", "Scans"
    if scenario.channel.content == "summaries":
        return recorder.bits_sent / 1000, "sent by the team (kbit)", "Summaries"
    return recorder.shared, "measurements sent by the team", "Shared measurements"


def _draw_entropies(axes: Axes, recorder: Recorder) -> None:
    """Draw the entropy of each robot's map over time, and the threshold that ends the mission."""
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
    """Return what is left of the entropy of robot_0's map, what its map shows, and the true world."""
    missions, grid = recorder.missions, recorder.missions.grid
    solid = missions.state.truth[0].reshape(grid.shape) > 0.5
    heights = _open_ground(solid)
    if heights is not None:
        return _maps_from_above(recorder, grid.origin_m[2] + grid.voxel_size_m * heights)
    views = projections(entropy_share(missions, 0, 0), missions.mean[0, 0])
    worlds = projections(np.zeros(grid.shape, np.float32), solid.astype(np.float32))
    left = [np.ma.masked_array(view.entropy) for view in views]
    known, true = ([np.ma.masked_less(view.coverage, 0.0) for view in each] for each in (views, worlds))
    where = "" if grid.flat else ", from above and from the side"
    unit = Normalize(0.0, 1.0)
    described = (
        (left, "What robot_0 has left", "share of the entropy left", "magma", "white"),
        (known, "What robot_0 knows", "coverage; blue: unknown", "Greys", "black"),
        (true, "The true world, black: solid", None, "Greys", "black"),
    )
    first, second, third = (
        _Map(values[0], title + where, label, colours, unit, edge, None if grid.flat else values[1])
        for values, title, label, colours, edge in described
    )
    return first, second, third


def _maps_from_above(recorder: Recorder, true_m: np.ndarray) -> tuple[_Map, _Map, _Map]:
    """Return the same three maps of ground whose true heights (X, Y) are given, in metres."""
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


def _draw_map(figure: Figure, axes: Axes, shown: _Map, recorder: Recorder, believed: bool, up: int) -> None:
    """Draw a map with the paths over it.

    Args:
        figure: The figure.
        axes: Where to draw.
        shown: The map.
        recorder: Record of the mission.
        believed: Whether to show where robots that drift believe to be.
        up: The axis that points upwards: 1 = y, from above; 2 = z, from the side.
    """
    grid = recorder.missions.grid
    values = shown.values if up == 1 or shown.side is None else shown.side
    low_m, high_m = np.asarray(grid.origin_m), np.asarray(grid.origin_m) + grid.size_m
    image = axes.imshow(
        values.T,
        origin="lower",
        extent=(low_m[0], high_m[0], low_m[up], high_m[up]),
        cmap=mpl.colormaps[shown.colours].with_extremes(bad=_UNKNOWN),
        norm=shown.scale,
        aspect="equal" if up == 1 else "auto",
    )
    for axis, name, number in ((axes.xaxis, "x", 0), (axes.yaxis, "yz"[up - 1], up)):
        _write_metres(axis, name, low_m[number])
    if up == 1:
        axes.set_title(shown.title, fontsize=8)
        if shown.label is not None:
            figure.colorbar(image, ax=axes, shrink=0.7, label=shown.label)
    over = [0, up]
    axes.plot(*recorder.missions.state.fiducials[0][:, over].T, **_mark("^", "white", "black"))
    drifts = recorder.missions.estimates is not None
    stopped = stopped_now(recorder.missions, 0)
    for robot, path_m in enumerate(recorder.paths_m):
        colour = COLOURS[robot % len(COLOURS)]
        thin = [withStroke(linewidth=1.7, foreground=shown.edge)]
        axes.plot(*path_m[:, over].T, color=colour, linewidth=0.9, path_effects=thin)
        axes.plot(*path_m[0, over], **_mark("o", colour, shown.edge))
        end = ("D", "none") if drifts else (_end_of(recorder, robot), colour)
        axes.plot(*path_m[-1, over], **_mark(*end, shown.edge))
        if stopped[robot]:
            axes.plot(*path_m[-1, over], **{**_mark("x", colour, "red"), "markersize": 2 * _MARK_SIZE})
    if believed:
        _draw_estimates(axes, recorder, shown.edge, up)


def _write_metres(axis: Axis, name: str, low_m: float) -> None:
    """Label an axis in metres; far from the frame's origin, relative to a round number."""
    from_m = base_m(low_m)
    axis.set_major_locator(MaxNLocator(6))
    axis.set_major_formatter(lambda metres, _: f"{metres - from_m:g}")
    axis.set_label_text(f"{name} (m)" if from_m == 0.0 else f"{name} - {from_m:,.0f} (m)")


_ENDS = ("s", "v", "P", "*")
"""Marks of where robots ended, by their kinds."""


def _end_of(recorder: Recorder, robot: int) -> str:
    kinds = recorder.missions.scenario.kinds
    return _ENDS[robot % len(kinds) % len(_ENDS)]


def _draw_estimates(axes: Axes, recorder: Recorder, edge: str, up: int) -> None:
    """Draw where robots believe to be, with an ellipse and a line to the true place, where they drift."""
    missions = recorder.missions
    if missions.estimates is None:
        return
    stroke = [withStroke(linewidth=3.0, foreground=edge)]
    for robot, pose in enumerate(believed_poses_now(missions, 0)):
        colour = COLOURS[robot % len(COLOURS)]
        outline = estimate_outline(pose[:3], missions.estimates[0][robot]["covariance"][:3, :3], up)
        to_truth = np.stack([pose[:3], recorder.paths_m[robot][-1]])
        axes.plot(*pose[[0, up]], **_mark(_end_of(recorder, robot), "none", edge))
        for line in (outline, to_truth):  # over the marks, which are hollow: an ellipse may be smaller
            axes.plot(*line[:, [0, up]].T, color=colour, linewidth=1.5, path_effects=stroke)


def _legend(recorder: Recorder) -> list[Line2D]:
    """Return what the marks on the maps mean."""
    missions = recorder.missions
    drifts, kinds = missions.estimates is not None, missions.scenario.kinds
    ends = "end: where it believes to be, with an ellipse of 2 σ" if drifts else "end"
    meanings = {"o": "start"}
    for number in range(min(len(kinds), len(_ENDS))):
        meanings[_ENDS[number]] = ends if len(kinds) == 1 else f"{ends}, {_kind_name(kinds, number)}"
    if drifts:
        meanings["D"] = "where it truly is"
    if stopped_now(missions, 0).any():
        meanings["x"] = "stopped by a fault"
    if missions.state.fiducials.shape[1]:
        meanings["^"] = "fiducial"
    inside = "none" if drifts else "white"
    edges = {"x": "red"}
    return [
        Line2D([], [], label=text, **_mark(mark, inside, edges.get(mark, "black")))
        for mark, text in meanings.items()
    ]


def _kind_name(kinds: Sequence[RobotKind], number: int) -> str:
    """Return a name that tells a kind of robot from the others: its motion, numbered if others share it."""
    motions = [kind.robot.motion for kind in kinds]
    said = {"free": "flying robot", "planar": "ground robot"}[motions[number]]
    return said if motions.count(motions[number]) == 1 else f"{said} of kind {number}"


def _mark(marker: str, colour: Any, edge: str) -> dict[str, Any]:  # noqa: ANN401 - any of matplotlib's colours
    """How a mark is drawn."""
    return {
        "marker": marker,
        "markerfacecolor": colour,
        "markeredgecolor": edge,
        "markersize": _MARK_SIZE,
        "linestyle": "",
    }
