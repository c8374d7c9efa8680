"""Figures 7 and 9 of Sujan: completion of unknown heights on two samples, and the polygon of an edge.

The paper says "sinusoidal surface with random unknown cells" and "step surface with half unknown cells"; the
sizes are ours, 60 × 60 cells, and so is the share of unknown cells of the first, a half.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from baselines.strategies.next_best_view.edge import Edge, find_edge
from baselines.strategies.next_best_view.ground_map import WHEEL_M
from entropy_explore_env.belief.elevation import completed
from entropy_explore_env.scenarios import CLIFF
from entropy_explore_env.worlds.load import make_world

_CELLS = 60


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
    """Both samples of fig. 7."""
    x, y = np.indices((_CELLS, _CELLS)) / _CELLS
    waves = np.sin(2.0 * np.pi * x) * np.cos(2.0 * np.pi * y)
    step = np.where(x < 0.5, 1.0, 0.0)
    rng = np.random.default_rng(0)
    return (
        Sample("sinusoidal surface, half unknown at random", waves, rng.random(waves.shape) < 0.5),
        Sample("step surface, the half for y > ½ unknown", step, y <= 0.5),
    )


def figure_completion() -> Figure:
    """Fig. 7: the true heights, what is known of them, and what is completed."""
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
    """Heights (X, Y) in voxel edges of a world of `cliff`, and the edge of its plateau."""
    heights = make_world(CLIFF, number).occupied.sum(axis=2).astype(np.float64)
    wheel = WHEEL_M / CLIFF.grid.voxel_size_m
    return heights, find_edge(heights, (16, 48), wheel, wheel, wheel)


def figure_edge(worlds: int = 3) -> Figure:
    """Fig. 9: ground with rocks of the Viking sites' sizes, the border of its plateau, and the polygon."""
    figure = Figure(figsize=(9.0, 3.2), layout="constrained")
    for number, axes in enumerate(np.atleast_1d(figure.subplots(1, worlds))):
        draw_edge(axes, *edge_of_world(number))
        axes.set(title=f"world {number}", xticks=[], yticks=[])
    return figure


def draw_edge(axes: Axes, heights: np.ndarray, edge: Edge) -> None:
    """Draw heights from above with the polygon of an edge."""
    x, y = heights.shape
    axes.imshow(heights.T, origin="lower", extent=(0, x, 0, y), cmap="viridis")
    axes.plot(*edge.border.T, color="white", linewidth=0.8)
    axes.plot(*edge.polygon.T, color="red", marker="o", markersize=3, linewidth=1.2)
