"""Figures 2, 3, 4 and 6 of Bhattacharya 2010, redrawn."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy import ndimage

from baselines.experiments.experiment import Records
from baselines.experiments.plots import COLOURS, one_axes
from baselines.papers.bhattacharya.claims import exploring, first_floor
from baselines.papers.bhattacharya.measured import ROBOTS, SHAPE, split, unknown_region
from baselines.papers.bhattacharya.run import Run, start_cells, unpacked
from baselines.papers.bhattacharya.sweep import FLOORS, VARIANTS, all_runs, coverage_id, exploration_id
from entropy_explore_env.belief.paths.geodesic_cells import new_tessellation, tessellate
from entropy_explore_env.errors import counted

_PALE = 0.72
_BORDER = (0.12, 0.47, 0.71)


def _cell_picture(occupied: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Return (Y, X, 3) cells in pale colours of their robots, walls dark; row 0 at the bottom."""
    picture = np.full((*cells.shape, 3), 0.93)
    for robot in range(int(cells.max(initial=-1)) + 1):
        colour = np.array(COLOURS[robot % len(COLOURS)])
        picture[cells == robot] = _PALE + (1.0 - _PALE) * colour
    picture[occupied] = 0.25
    return picture.transpose(1, 0, 2)


def _tessellated(occupied: np.ndarray, places: list[int]) -> np.ndarray:
    space = new_tessellation(occupied.shape)
    tessellate(space, np.where(occupied, np.inf, 1.0).astype(np.float32), np.array(places))
    return space.cells[:, :, 0]


def _draw_paths(axes: Axes, places: np.ndarray, width: int) -> None:
    """Draw trajectories (T, A) of cells, start hollow, end filled."""
    for robot in range(places.shape[1]):
        x, y = places[:, robot] // width, places[:, robot] % width
        colour = COLOURS[robot % len(COLOURS)]
        axes.plot(x, y, color=colour, linewidth=1.0)
        axes.plot(x[0], y[0], marker="o", color="white", markeredgecolor=colour, markersize=4)
        axes.plot(x[-1], y[-1], marker="o", color=colour, markeredgecolor="black", markersize=5)


def _bare(axes: Axes, title: str) -> None:
    axes.set(xticks=[], yticks=[])
    axes.set_title(title, fontsize=8)
    axes.spines[:].set_visible(True)


def _run(cell: str) -> Run:
    """Return the first run of a cell."""
    return next(run for run in all_runs(1, 1, 1) if run.cell == cell)


def figure_2(records: Records) -> Figure:
    """Draw geodesic cells: three robots on 200 × 200 cells, five in the office, at random places (fig. 2)."""
    del records
    office = _run(coverage_id("gradient", "cluster"))
    clutter = replace(office, world="bhattacharya-cluttered", shape=(200, 200), cell_m=0.1, robots=3, seed=0)
    figure = Figure(figsize=(7.2, 3.6), layout="constrained")
    for axes, run in zip(figure.subplots(1, 2), (clutter, office), strict=True):
        occupied = run.plan()
        places = start_cells(occupied, "random", run.robots, 0)
        cells = _tessellated(occupied, places)
        axes.imshow(_cell_picture(occupied[:, :, 0], cells), origin="lower", interpolation="nearest")
        _draw_paths(axes, np.array([places]), occupied.shape[1])
        _bare(axes, f"{run.shape[0]} × {run.shape[1]} cells, {counted(run.robots, 'robot')}")
    figure.suptitle("Fig. 2: geodesic cells", x=0.01, ha="left")
    return figure


def figure_3(records: Records) -> Figure:
    """Draw cells and paths along the convergence, a row a control (fig. 3)."""
    moments, names = 4, {"gradient": "gradient search", "projected-guarded": "projected centroid, guarded"}
    cells = {name: coverage_id(control, "cluster") for control, name in names.items()}
    rows = [(name, _run(cell), records[cell][0]) for name, cell in cells.items()]
    figure = Figure(figsize=(9.6, 2.9 * len(rows)), layout="constrained")
    axes = figure.subplots(len(rows), moments, squeeze=False)
    for line, (name, run, record) in zip(axes, rows, strict=True):
        occupied, places = run.plan(), np.array(record["places"])
        for picture, share in zip(line, np.linspace(0.0, 1.0, moments) ** 2, strict=True):
            last = round(share * (len(places) - 1))
            cells = _tessellated(occupied, places[last].tolist())
            picture.imshow(_cell_picture(occupied[:, :, 0], cells), origin="lower", interpolation="nearest")
            _draw_paths(picture, places[: last + 1], occupied.shape[1])
            _bare(picture, f"{name}, iteration {last}")
    figure.suptitle("Fig. 3: five robots cover a known office", x=0.01, ha="left")
    return figure


def figure_4(records: Records) -> Figure:
    """Draw the boundary between two robots by length and by entropy."""
    del records
    figure = Figure(figsize=(9.6, 3.0), layout="constrained")
    region = unknown_region("band")[:, :, 0]
    for axes, (title, eta) in zip(
        figure.subplots(1, 2),
        (("plain geodesic cells", None), ("entropy-weighted, η = 0.01", 0.01)),
        strict=True,
    ):
        found = split("band", eta)
        picture = _cell_picture(np.zeros(SHAPE[:2], bool), found.cells)
        picture[region.T] *= 0.75
        axes.imshow(picture, origin="lower", interpolation="nearest")
        axes.contour(found.cells.T, levels=[0.5], colors="black", linewidths=1.2)
        for robot, (x, y) in enumerate(ROBOTS):
            axes.plot(x, y, marker="o", color=COLOURS[robot], markeredgecolor="black")
        _bare(axes, f"{title}: unexplored areas {found.ratio:.2f} : 1")
    figure.suptitle("Fig. 4: an unknown band nearer to the second robot (darker)", x=0.01, ha="left")
    return figure


def figure_6(records: Records, variant: str, settings: str) -> Figure:
    """Draw entropy, cells and paths along an exploration; green = uncertain, dark = believed occupied."""
    floor = first_floor(records, variant)
    cell = exploration_id(floor, variant, FLOORS[floor].middle)
    run, record = _run(cell), records[cell][0]
    maps = unpacked(record["maps"])
    team = f"{run.shape[0]} × {run.shape[1]} cells, {counted(run.robots, 'robot')}"
    title = f"{team}, range {run.rules.range_cells:g}; {settings}"
    moments = sum(name.startswith("entropy_") for name in maps)
    figure = Figure(figsize=(10.2, 2.9 * math.ceil(moments / 3)), layout="constrained")
    places, width = np.array(record["places"]), run.shape[1]
    all_axes = figure.subplots(math.ceil(moments / 3), 3, squeeze=False).ravel()
    for number, axes in zip(range(moments), all_axes, strict=False):
        entropy = maps[f"entropy_{number}"].astype(float) / 255.0
        cells, iteration = maps[f"cells_{number}"], int(maps[f"iteration_{number}"])
        picture = np.ones((*entropy.shape, 3))
        uncertain = np.clip((entropy - 0.3) / 0.7, 0.0, 1.0)
        picture -= uncertain[..., None] * (0.45, 0.1, 0.45)
        picture[cells < 0] = 0.55
        picture[maps[f"occupied_{number}"]] = 0.1
        picture[_borders(cells)] = _BORDER
        axes.imshow(picture.transpose(1, 0, 2), origin="lower", interpolation="nearest")
        _draw_paths(axes, places[:iteration], width)
        _bare(axes, f"iteration {iteration}")
    for axes in all_axes[moments:]:
        axes.set_visible(False)
    figure.suptitle(f"Fig. 6: {title}", x=0.01, ha="left")
    return figure


def _borders(cells: np.ndarray) -> np.ndarray:
    """Return (X, Y) bool, where two robots' cells meet, drawn wide enough to be seen; walls are no border."""
    border = np.zeros(cells.shape, bool)
    for axis in range(2):
        here, there = np.moveaxis(cells, axis, 0)[:-1], np.moveaxis(cells, axis, 0)[1:]
        np.moveaxis(border, axis, 0)[:-1] |= (here != there) & (here >= 0) & (there >= 0)
    wide = np.asarray(ndimage.binary_dilation(border, iterations=max(len(cells) // 330, 1)), bool)
    return wide & (cells >= 0)


def figure_progress(records: Records) -> Figure:
    """Draw uncertain cells that can be reached, along explorations."""
    figure, axes = one_axes(
        xlabel="iteration",
        ylabel="uncertain cells in reach (1000)",
        title="Exploration of the first small plan",
    )
    for number, name in enumerate(("paper", *VARIANTS)):
        series = exploring(records, "small", name, FLOORS["small"].middle)[0]["series"]
        line = {"linestyle": "-" if number < len(COLOURS) else ":", "color": COLOURS[number % len(COLOURS)]}
        axes.plot(series["iteration"], np.array(series["uncertain"]) / 1000.0, label=name, **line)
    axes.legend(frameon=False, fontsize=7)
    return figure
