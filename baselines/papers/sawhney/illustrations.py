"""Figs. 1-5, 7, 9, 11 and 12 of Sawhney 2009: what metrics choose, the worlds, missions as they went."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import LightSource, to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from baselines.cli.figures import COLOURS, extent_of
from baselines.experiments.cells import Cell
from baselines.experiments.mission import scripted
from baselines.papers.sawhney.mission import Run, explore_until_done
from baselines.papers.sawhney.sweep import PLANS, POINT, TERRAINS, world_cell
from baselines.strategies.allocation import seconds_of
from baselines.strategies.metrics import Metric, Options
from baselines.strategies.rules.per_time_visibility import PerTimeVisibility
from entropy_explore_env.belief.paths.search import new_search
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.frontiers.frontier_map import Chart
from entropy_explore_env.frontiers.knowledge import voxel_of
from entropy_explore_env.frontiers.path_lengths import KnownPaths
from entropy_explore_env.frontiers.terrain_frontiers import PATCH_M
from entropy_explore_env.missions.view import RobotView
from entropy_explore_env.reports.recording import DrivenPaths
from entropy_explore_env.settings import Grid

TEAM = 3
"""Robots in figs. 7 and 9, as there."""
PAPER_BETA = 25
"""Of fig. 11."""
_MARKS = (0.15, 0.45, 0.75, 1.0)
"""Explored shares that are drawn; the last one is the end."""
_EXAMPLE_T, _EXAMPLE_V = range(1, 11), range(2, 21, 2)
_FIRST = 10
"""So many of the options are what a metric goes for (sect. 2)."""
_UNKNOWN, _FREE, _WALL, _EDGE, _EXPECTED = "#c3c7cf", "#ffffff", "#27408b", "#e02020", "#f5d90a"
_PLAN_KEY = {"unexplored": _UNKNOWN, "free": _FREE, "wall": _WALL, "frontier": _EDGE}
_TERRAIN_KEY = {
    "unexplored": "0.5",
    "explored": "#7fb966",
    "expected to be seen from where robots go": _EXPECTED,
    "frontier": _EDGE,
}
"""Name → colour."""


class Shown(NamedTuple):
    """A true world in a picture."""

    grid: Grid
    occupied: np.ndarray
    """(X, Y, Z) bool"""
    ceiling: np.ndarray | None
    """(X, Y) int32"""


OptionMeans = tuple[str, float, float, float]
"""A metric, and the means of V, t and V/t of the options that it goes for first."""


@dataclass(frozen=True)
class Snapshot:
    """A mission at a moment: what robot 0 knew when it last chose, and where all have been."""

    time_s: float
    share: float
    chart: Chart
    expected: np.ndarray
    """(X, Y) bool, what robots driving to viewpoints, or about to, expect to see."""
    paths_m: list[np.ndarray]
    finished: bool
    """Whether no frontier was left."""


def pictures(parts: Sequence[str], dem: Path | None) -> tuple[dict[str, Figure], list[OptionMeans]]:
    """The figures of some parts (`plans`, `terrains`) by name, and the means of fig. 1."""
    drawn, means = {"worlds": figure_worlds(dem)}, list[OptionMeans]()
    if "plans" in parts:
        drawn["options"], means = figure_options()
        team = world_cell("office", TEAM, "ptv")
        drawn["plan-mission"] = figure_plan(team, f"Fig. 7: {TEAM} robots in `office`, V/t")
        other = Metric(PAPER_BETA * POINT["plans"])
        ways = [("V/t", "ptv"), (f"V - {PAPER_BETA}t", other)]
        drawn["ways"] = figure_paths([(name, world_cell("cluttered", 1, method)) for name, method in ways])
    if "terrains" in parts:
        team = world_cell("terrain", TEAM, "ptv")
        drawn["terrain-mission"] = figure_terrain(team, f"Fig. 9: {TEAM} UAVs over `terrain`, V/t")
        drawn["section"] = figure_section(world_cell("terrain", 1, "ptv"))
    return drawn, means


def example_options() -> tuple[np.ndarray, np.ndarray]:
    """The options of the paper's fig. 1: (K,) t and (K,) V."""
    times, seen = zip(*itertools.product(_EXAMPLE_T, _EXAMPLE_V), strict=True)
    return np.array(times, float), np.array(seen, float)


def first_options(metric: Metric, seconds: np.ndarray, seen: np.ndarray) -> np.ndarray:
    """The first ten options by a metric; of equals the one with less t."""
    value = metric(Options(seen, seconds, seconds, np.zeros(len(seen))))
    return np.lexsort((seconds, -value))[:_FIRST]


def figure_options() -> tuple[Figure, list[OptionMeans]]:
    """Fig. 1: what metrics choose first of the paper's options, and of those in one of our missions.

    Returns:
        The figure, and of the paper's options for each metric the means of V, t and V/t of the first ten.
    """
    metrics = [("V - 2t", Metric(2.0)), ("V - 20t", Metric(20.0)), ("V/t", Metric())]
    figure, means = Figure(figsize=(11.0, 3.0), layout="constrained"), []
    axes = figure.subplots(1, 4)
    seconds, seen = example_options()
    for panel, (name, metric) in zip(axes, metrics, strict=False):
        first = first_options(metric, seconds, seen)
        means.append(
            (name, *(float(np.mean(x)) for x in (seen[first], seconds[first], (seen / seconds)[first])))
        )
        _draw_options(panel, seconds, seen, [(name, first)])
        panel.set(title=f"{name}: mean V/t {means[-1][3]:.3g}", xlabel="t", ylabel="V", yticks=_EXAMPLE_V)
    seconds, seen = _options_on_the_way()
    chosen = [
        (f"V - βt, β = {beta}", first_options(Metric(beta * POINT["plans"]), seconds, seen))
        for beta in (1, 40)
    ]
    _draw_options(axes[3], seconds, seen, [*chosen, ("V/t", first_options(Metric(), seconds, seen))])
    axes[3].set(title="ours: hybrid, half explored", xlabel="t (s)", ylabel="V (m²)")
    figure.legend(*axes[3].get_legend_handles_labels(), loc="outside lower right", ncols=3, frameon=False)
    for panel in axes:
        panel.title.set_size(9)
    figure.suptitle("Fig. 1: the first ten options of each metric", fontsize=10)
    return figure, means


def _draw_options(
    axes: Axes, seconds: np.ndarray, seen: np.ndarray, chosen: Sequence[tuple[str, np.ndarray]]
) -> None:
    axes.plot(seconds, seen, ".", color="0.75", markersize=5)
    for number, (name, first) in enumerate(chosen):
        size = 9 - 3 * number if len(chosen) > 1 else 7  # around each other where metrics agree
        style: dict[str, Any] = {"color": COLOURS[number], "markersize": size, "linewidth": 0.7}
        style |= {"markerfacecolor": "none", "markeredgewidth": 1.3} if len(chosen) > 1 else {}
        axes.plot(seconds[first], seen[first], "o-", label=name, **style)


def _options_on_the_way() -> tuple[np.ndarray, np.ndarray]:
    """T and V of what one robot could choose in `hybrid` when half of it was explored."""
    found: list[tuple[np.ndarray, np.ndarray]] = []
    cell = world_cell("hybrid", 1, "ptv")
    explorer = PerTimeVisibility(_run(cell).exploring)

    latest = list[RobotView]()

    def look(share: float, views: Sequence[RobotView], _: Sequence[np.ndarray]) -> None:
        latest[:] = views
        if share >= 0.5 and not found:
            found.append(_options(explorer, views[0]))

    explore_until_done(_environment(cell), explorer, 0, look)
    return found[0] if found else _options(explorer, latest[0])


def _options(explorer: PerTimeVisibility, view: RobotView) -> tuple[np.ndarray, np.ndarray]:
    """T and V of what a robot that has chosen before can choose now; no promises count."""
    cells, scenario = explorer.cells_of(view.robot), view.scenario
    paths = KnownPaths(scenario, view.kind, cells, new_search(scenario.grid.voxels))
    paths.start(voxel_of(view, view.pose))
    paths.extend(math.inf)
    slots, voxels = cells.listed()
    edges = paths.lengths_to(voxels)
    reached = np.isfinite(edges)
    seen = cells.count(slots[reached], voxels[reached]) * cells.point
    return seconds_of(scenario, view.robot, edges[reached]), seen


def snapshots(cell: Cell, seed: int, marks: Sequence[float] = _MARKS) -> list[Snapshot]:
    """A mission of a cell when shares but for the last were explored, as far as they were, and its end."""
    env, explorer = _environment(cell), PerTimeVisibility(_run(cell).exploring)
    driven, taken, grid = DrivenPaths(cell.scenario.robots), list[Snapshot](), cell.scenario.grid

    def snap(time_s: float, share: float, targets: Sequence[np.ndarray]) -> None:
        candidates, finished = explorer.cells_of(0), all(explorer.idle)
        expected = np.zeros(grid.shape[:2], bool)
        for target in () if finished else targets:
            expected |= candidates.expected(grid.in_grid_units(target)[:3])
        paths_m = driven.to_now(env.missions)
        taken.append(Snapshot(time_s, share, candidates.chart(), expected, paths_m, finished))

    def look(share: float, views: Sequence[RobotView], chosen: Sequence[np.ndarray]) -> None:
        driven.update(env.missions)
        if len(taken) < len(marks) - 1 and share >= marks[len(taken)]:
            targets = list(env.missions.state.robots[0]["target"])
            for view, viewpoint in zip(views, chosen, strict=True):
                targets[view.robot] = viewpoint
            snap(views[0].time_s, share, targets)

    times_s, shares = explore_until_done(env, explorer, seed, look)
    driven.update(env.missions)
    snap(times_s[-1], shares[-1], list(env.missions.state.robots[0]["target"]))
    return taken


def figure_plan(cell: Cell, title: str) -> Figure:
    """Fig. 7: a mission in a plan; frontiers red, walls blue."""
    grid, taken = cell.scenario.grid, snapshots(cell, 0)
    figure, panels = _panels(len(taken), grid.size_m)
    for axes, now in zip(panels, taken, strict=True):
        _show(axes, _plan_colours(now.chart), cell.scenario.grid, now.paths_m)
        axes.set_title(f"{now.time_s:.0f} s, {now.share:.0%} explored", fontsize=8)
    figure.suptitle(title, fontsize=10)
    _explain(figure, _PLAN_KEY)
    return figure


def _plan_colours(chart: Chart) -> np.ndarray:
    """(X, Y, 3) unknown grey, free white, walls blue, frontiers red."""
    picture = np.full((*chart.mapped.shape, 3), to_rgb(_UNKNOWN))
    for where, colour in ((chart.mapped, _FREE), (chart.covered, _WALL), (chart.edge, _EDGE)):
        picture[where] = to_rgb(colour)
    return picture


def figure_terrain(cell: Cell, title: str) -> Figure:
    """Fig. 9: a mission over terrain; unexplored grey, explored green, expected yellow, frontiers red."""
    grid, taken = cell.scenario.grid, snapshots(cell, 0)
    figure, panels = _panels(len(taken), grid.size_m)
    world = _world_of(cell)
    heights = ground_of(world)
    grey = _shaded(heights, "gray", grid.voxel_size_m)
    green = _shaded(heights, "summer", grid.voxel_size_m)
    for axes, now in zip(panels, taken, strict=True):
        picture = np.where(now.chart.mapped[..., None], green, 0.25 + 0.5 * grey)
        picture[now.expected & ~now.chart.mapped] = to_rgb(_EXPECTED)
        picture[now.chart.edge] = to_rgb(_EDGE)
        _show(axes, picture, grid, now.paths_m)
        axes.set_title(f"{now.time_s:.0f} s, {now.share:.0%} explored", fontsize=8)
    figure.suptitle(title, fontsize=10)
    _explain(figure, _TERRAIN_KEY)
    return figure


def figure_paths(cells: Sequence[tuple[str, Cell]]) -> Figure:
    """Figs. 11 and 12: paths of one robot by several metrics in the same plan, to 95 % and to the end."""
    figure, panels = _panels(2 * len(cells), cells[0][1].scenario.grid.size_m)
    for number, (name, cell) in enumerate(cells):
        for axes, now in zip(panels[number :: len(cells)], snapshots(cell, 0, (0.95, 1.0)), strict=False):
            _show(axes, _plan_colours(now.chart), cell.scenario.grid, now.paths_m)
            length_m = float(np.linalg.norm(np.diff(now.paths_m[0], axis=0), axis=1).sum())
            until = "no frontier" if now.finished else f"{now.share:.0%}"
            axes.set_title(f"{name}, to {until}: {now.time_s:.0f} s, {length_m:.0f} m", fontsize=8)
    figure.suptitle("Figs. 11-12: the way of one robot", fontsize=10)
    _explain(figure, _PLAN_KEY)
    return figure


def figure_worlds(dem: Path | None) -> Figure:
    """Fig. 5: the worlds, those of seed 0."""
    worlds = [*PLANS, *TERRAINS, *(("dem",) if dem is not None else ())]
    figure = Figure(figsize=(10.5, 5.0), layout="constrained")
    panels = figure.subplots(2, 4).ravel()
    for axes in panels[len(worlds) :]:
        axes.set_axis_off()
    for axes, name in zip(panels, worlds, strict=False):
        cell = world_cell(name, 1, "ptv", dem)
        world = _world_of(cell)
        if name in PLANS:
            picture = np.where(world.occupied[:, :, 0, None], to_rgb(_WALL), (1.0, 1.0, 1.0))
        else:
            picture = _shaded(ground_of(world), "gist_earth", world.grid.voxel_size_m)
        _show(axes, picture, world.grid)
        axes.set_title(name, fontsize=9)
    figure.suptitle("Fig. 5: the worlds (seed 0), metres", fontsize=10)
    return figure


def figure_section(cell: Cell) -> Figure:
    """Figs. 2-4: a section along x through a UAV: ground and surface, what is known, seen and assumed."""
    now, world = snapshots(cell, 0, (0.2, 1.0))[0], _world_of(cell)
    grid, edge = world.grid, world.grid.voxel_size_m
    reach_m = cell.scenario.sensor.max_range_m
    x, y, z = (int(i) for i in grid.voxel_of(now.paths_m[0][-1]))
    across = grid.centre_of(np.stack([np.arange(grid.shape[0]), *np.zeros((2, grid.shape[0]))], -1))[:, 0]
    ground, known = edge * ground_of(world)[:, y], edge * now.chart.ground[:, y]
    patch = round(PATCH_M / edge)
    near = now.chart.ground[max(x - patch, 0) : x + patch + 1, max(y - patch, 0) : y + patch + 1]
    average = edge * float(np.nanmean(near))
    assumed = np.maximum(1.0 - np.abs(across - across[x]) / reach_m, 0.0) * average
    assumed[np.abs(across - across[x]) > reach_m] = np.nan
    assumed[~np.isnan(known)] = np.nan
    figure = Figure(figsize=(9.6, 3.8), layout="constrained")
    axes = figure.subplots()
    axes.fill_between(across, 0.0, ground, color="0.85", step="mid", label="ground")
    axes.step(across, known, where="mid", color="#1a7f37", linewidth=2.2, label="explored")
    axes.step(across, assumed, where="mid", color="#b08800", linestyle="--", label="assumed (sect. 3.4)")
    if world.ceiling is not None:
        surface = edge * world.ceiling[:, y]
        axes.step(across, surface, where="mid", color=COLOURS[0], linewidth=1.0, label="exposure surface")
    eye = edge * (z + 0.5)
    for column in np.flatnonzero(np.abs(across - across[x]) <= reach_m):
        between = slice(min(x, column), max(x, column) + 1)
        ends = sorted([(x, eye), (int(column), float(ground[column]))])
        line = np.linspace(ends[0][1], ends[1][1], abs(x - int(column)) + 1)
        within = np.hypot(across[column] - across[x], eye - ground[column]) <= reach_m
        if within and (line + 1e-9 >= ground[between]).all():
            axes.plot(
                [across[x], across[column]], [eye, ground[column]], color=COLOURS[1], linewidth=0.4, alpha=0.6
            )
    axes.plot(
        across[x], eye, "s", color=COLOURS[1], markeredgecolor="k", markersize=7, label="UAV, what it sees"
    )
    wide = across[[max(x - patch, 0), min(x + patch, len(across) - 1)]]
    axes.plot(wide, [average, average], "k", linewidth=1.2, label="z_av, mean ground nearby")
    for aside, low, name in ((-1.2, average, "z_f - z_av"), (1.2, 0.0, "z_f")):
        place, arrow = across[x] + aside, {"arrowstyle": "<->", "linewidth": 0.9, "shrinkA": 0, "shrinkB": 0}
        axes.annotate("", (place, low), (place, eye), arrowprops=arrow)
        axes.text(
            place + 0.4 * aside, max(low - 1.2, 5.0), name, fontsize=8, ha="right" if aside < 0 else "left"
        )
    axes.set(xlabel="x (m)", ylabel="height (m)", aspect="equal", xlim=(across[0], across[-1]))
    figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=3, frameon=False)
    figure.suptitle("Figs. 2-4: a section through a mission over `terrain`", fontsize=10)
    return figure


def ground_of(world: Shown) -> np.ndarray:
    """(X, Y) int, solid layers of a height field."""
    return world.occupied.sum(2)


def visible_area_m2(world: str) -> float:
    """Of the cells of a plan that can be seen from where robots can be, seed 0."""
    env = _environment(world_cell(world, 1, "ptv"))
    env.reset(seed=0)
    return float(env.missions.state.visible[0].sum()) * env.missions.grid.voxel_size_m**2


def _world_of(cell: Cell) -> Shown:
    """The world of a cell's mission of seed 0."""
    env = _environment(cell)
    env.reset(seed=0)
    world = env.missions.worlds[0]
    assert world is not None
    return Shown(world.grid, world.occupied, world.ceiling)


def _environment(cell: Cell) -> EntropyExploreEnv:
    return _run(cell).placed(EntropyExploreEnv(scripted(cell.scenario)))


def _run(cell: Cell) -> Run:
    assert isinstance(cell.record, Run)
    return cell.record


def _shaded(heights: np.ndarray, colours: str, edge_m: float) -> np.ndarray:
    """(X, Y, 3) a height field in light from the north-west."""
    light = LightSource(315, 45)
    span = max(float(np.ptp(heights)), 1.0)
    flat = mpl.colormaps[colours]((heights - heights.min()) / span)[..., :3]
    return light.shade_rgb(flat, heights.astype(float) * edge_m, blend_mode="soft", fraction=0.9)


def _explain(figure: Figure, key: Mapping[str, str]) -> None:
    """Below a figure, what its colours and marks are."""
    handles: list[Artist] = [
        Patch(facecolor=colour, edgecolor="0.5", linewidth=0.5, label=name) for name, colour in key.items()
    ]
    for marker, name in (("o", "start of a way"), ("s", "robot")):
        style: dict[str, Any] = {"color": "0.6", "markeredgecolor": "k", "linestyle": "none", "markersize": 4}
        handles.append(Line2D([], [], marker=marker, label=name, **style))
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), frameon=False, fontsize=7)


def _panels(count: int, size_m: np.ndarray, width: float = 2.7) -> tuple[Figure, Sequence[Axes]]:
    """A figure with panels side by side, as high as the world asks for."""
    figure = Figure(figsize=(width * count, width * float(size_m[1] / size_m[0]) + 0.9), layout="constrained")
    return figure, figure.subplots(1, count, squeeze=False)[0]


def _show(axes: Axes, picture: np.ndarray, grid: Grid, paths_m: Sequence[np.ndarray] = ()) -> None:
    """Draw (X, Y, 3) seen from above in metres, with paths over it."""
    axes.imshow(np.swapaxes(picture, 0, 1), origin="lower", extent=extent_of(grid), interpolation="nearest")
    for robot, path_m in enumerate(paths_m):
        colour = COLOURS[robot % len(COLOURS)]
        axes.plot(path_m[:, 0], path_m[:, 1], color=colour, linewidth=0.9)
        for place, marker in ((path_m[0], "o"), (path_m[-1], "s")):
            style: dict[str, Any] = {"color": colour, "markeredgecolor": "k", "markeredgewidth": 0.5}
            axes.plot(*place[:2], marker=marker, markersize=4, **style)
    axes.tick_params(labelsize=7)
    for side in ("top", "right"):
        axes.spines[side].set_visible(True)
