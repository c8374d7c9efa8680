"""Figures 7, 9 and 24-27 of Sujan; the samples of fig. 7, 60 × 60 cells, half unknown, are ours."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from baselines.experiments.experiment import Records
from baselines.experiments.mission import run_mission, scripted_env
from baselines.experiments.plots import COLOURS, mean_band, one_axes
from baselines.experiments.tables import markdown_table
from baselines.papers.sujan.cliff_mission import (
    FEW,
    METHODS,
    MORE,
    STEPS,
    cell_id,
    known_columns,
    looks_of,
    new_columns,
    plateau_of,
    scenario_of,
    start_of,
)
from baselines.strategies import make_strategy
from baselines.strategies.next_best_view.edge import Edge, find_edge
from baselines.strategies.next_best_view.ground_map import WHEEL_M
from baselines.strategies.next_best_view.plateau_rule import PlateauRule
from entropy_explore_env.belief.elevation import completed
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.settings.scenarios import CLIFF
from entropy_explore_env.worlds.load import make_world

_SHOWN = ((1, STEPS), (3, MORE), (5, FEW))
"""Method and steps of each top view of fig. 25."""
_CELLS = 60


def figure_columns(records: Records) -> Figure:
    """Draw new columns over steps, means of all worlds with intervals: fig. 24."""
    figure, axes = one_axes(
        xlabel="steps after the first looks",
        ylabel="new columns",
        title=f"Fig. 24: means of {len(records[cell_id(5)])} worlds",
    )
    for number, (method, strategy) in enumerate(METHODS.items()):
        rows = new_columns(records, method)
        mean_band(axes, np.arange(rows.shape[1]), rows, color=COLOURS[number], label=f"{method} {strategy}")
    axes.set(xlim=(0, None), ylim=(0, None))
    axes.legend(frameon=False)
    return figure


def figure_looks(records: Records) -> Figure:
    """Draw new columns that looks were expected to show, and that they showed: figs. 26 and 31."""
    figure = Figure(figsize=(9.0, 3.4), layout="constrained")
    for axes, method in zip(figure.subplots(1, 3, sharey=True), (3, 4, 5), strict=True):
        for field, colour in (("expected", COLOURS[0]), ("obtained", COLOURS[1])):
            rows = looks_of(records, method, field, MORE)
            mean_band(axes, np.arange(1, rows.shape[1] + 1), rows, color=colour, label=field)
        axes.set(title=f"method {method}", xlabel="look")
    figure.axes[0].set(ylabel="new columns", ylim=(0, None))
    figure.axes[0].legend(frameon=False)
    return figure


def figure_views(records: Records) -> Figure:
    """Draw mapped columns of world 0 from above, and the interest left by method 5: figs. 25 and 27."""
    del records
    figure = Figure(figsize=(9.0, 6.6), layout="constrained")
    panels = figure.subplots(2, 2).ravel()
    interest = plateau = unreadable = np.zeros((0, 0))
    for axes, (method, steps) in zip(panels, _SHOWN, strict=False):
        env, strategy = _played(method, steps)
        world = env.missions.worlds[0]
        assert world is not None and world.unreadable is not None
        layers = np.where(known_columns(env), world.occupied.sum(axis=2), np.nan)
        top_m = float(world.occupied.sum(axis=2).max() * world.grid.voxel_size_m)
        heights_m = world.grid.voxel_size_m * layers
        drawn = axes.imshow(heights_m.T, origin="lower", cmap="viridis", vmin=0.0, vmax=top_m)
        figure.colorbar(drawn, ax=axes, shrink=0.8, label="height (m)")
        plateau, unreadable = plateau_of(world.occupied), np.asarray(world.unreadable.any(axis=2))
        _outline(axes, plateau, unreadable)
        axes.set(title=f"method {method} after {steps} steps", xticks=[], yticks=[])
        interest = strategy.ground_of(0).interest
    shown = panels[-1].imshow(interest.T, origin="lower", cmap="magma", vmin=0.0, vmax=1.0)
    _outline(panels[-1], plateau, unreadable)
    panels[-1].set(title=f"interest left after {FEW} steps of method 5", xticks=[], yticks=[])
    figure.colorbar(shown, ax=panels[-1], shrink=0.8, label="interest")
    return figure


def _outline(axes: Axes, plateau: np.ndarray, unreadable: np.ndarray) -> None:
    """Draw the edge of the plateau, and where the ground is unreadable."""
    axes.contour(plateau.T, [0.5], colors="black", linewidths=1.0)
    axes.contour(unreadable.T, [0.5], colors="red", linewidths=1.0, linestyles="dotted")


def _played(method: int, steps: int) -> tuple[EntropyExploreEnv, PlateauRule]:
    """Return a mission in world 0 after some steps."""
    scenario = scenario_of(steps)
    env = scripted_env(scenario)
    strategy = make_strategy(METHODS[method])
    assert isinstance(strategy, PlateauRule)
    run_mission(env, strategy, 0, options={"world": 0, "starts": [start_of(scenario)]})
    return env, strategy


class Sample(NamedTuple):
    """A surface of which some is known."""

    name: str
    height_m: np.ndarray
    """(X, Y)."""
    known: np.ndarray
    """(X, Y) bool."""

    @property
    def error_m(self) -> tuple[float, float]:
        """Root mean square and largest error of the completed heights where they are unknown."""
        errors = (completed(self.height_m, self.known) - self.height_m)[~self.known]
        return float(np.sqrt((errors**2).mean())), float(np.abs(errors).max())


def samples() -> tuple[Sample, Sample]:
    """Return both samples of fig. 7."""
    x, y = np.indices((_CELLS, _CELLS)) / _CELLS
    waves = np.sin(2.0 * np.pi * x) * np.cos(2.0 * np.pi * y)
    step = np.where(x < 0.5, 1.0, 0.0)
    rng = np.random.default_rng(0)
    return (
        Sample("sinusoidal surface, half unknown at random", waves, rng.random(waves.shape) < 0.5),
        Sample("step surface, the half for y > ½ unknown", step, y <= 0.5),
    )


def figure_completion(records: Records) -> Figure:
    """Draw true heights, what is known of them, and what is completed: fig. 7."""
    del records
    figure = Figure(figsize=(9.0, 6.0), layout="constrained")
    for row, sample in zip(figure.subplots(2, 3), samples(), strict=True):
        shown = sample.height_m, np.where(sample.known, sample.height_m, np.nan)
        for axes, values, title in zip(
            row,
            (*shown, completed(sample.height_m, sample.known)),
            ("true", "known", "completed"),
            strict=True,
        ):
            low, high = sample.height_m.min(), sample.height_m.max()
            axes.imshow(values.T, origin="lower", vmin=low, vmax=high, cmap="viridis")
            axes.set(title=title, xticks=[], yticks=[])
        row[0].set_ylabel(sample.name.split(",")[0])
    return figure


def edge_of_world(number: int) -> tuple[np.ndarray, Edge]:
    """Return heights (X, Y) in voxel edges of a world of `cliff`, and the edge of its plateau."""
    heights = make_world(CLIFF, number).occupied.sum(axis=2).astype(np.float64)
    wheel = WHEEL_M / CLIFF.grid.voxel_size_m
    return heights, find_edge(heights, (16, 48), wheel, wheel, wheel)


def figure_edge(records: Records) -> Figure:
    """Draw ground with rocks of the Viking sites' sizes, the plateau's border and polygon: fig. 9."""
    del records
    figure = Figure(figsize=(9.0, 3.2), layout="constrained")
    for number, axes in enumerate(figure.subplots(1, 3)):
        draw_edge(axes, *edge_of_world(number))
        axes.set(title=f"world {number}", xticks=[], yticks=[])
    return figure


def draw_edge(axes: Axes, heights: np.ndarray, edge: Edge) -> None:
    """Draw heights from above with the polygon of an edge."""
    x, y = heights.shape
    axes.imshow(heights.T, origin="lower", extent=(0, x, 0, y), cmap="viridis")
    axes.plot(*edge.border.T, color="white", linewidth=0.8)
    axes.plot(*edge.polygon.T, color="red", marker="o", markersize=3, linewidth=1.2)


def samples_table(records: Records) -> str:
    """Return a table of the errors of completed heights on the samples of fig. 7."""
    del records
    rows = []
    for sample in samples():
        errors = [f"{error / float(np.ptp(sample.height_m)):.3f}" for error in sample.error_m]
        rows.append([sample.name, f"{(~sample.known).mean():.0%}", *errors])
    return markdown_table(["sample of fig. 7", "unknown", "rms error / range", "largest / range"], rows)


def edge_corners(records: Records) -> str:
    """Return how many border points of the plateaus of worlds 0-2 are corners of their polygons."""
    del records
    edges = [edge_of_world(number)[1] for number in range(3)]
    return ", ".join(f"{len(edge.polygon) - 1} of {len(edge.border) - 1}" for edge in edges)


FIGURES = {
    "figure-7": figure_completion,
    "figure-9": figure_edge,
    "figure-24": figure_columns,
    "figure-25": figure_views,
    "figure-26": figure_looks,
}
"""Name → what draws it from records."""
