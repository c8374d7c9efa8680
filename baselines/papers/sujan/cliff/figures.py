"""Figures 24-27 of Sujan: columns over steps, expected and obtained ones, top views, interest left."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from baselines.cli.figures import COLOURS
from baselines.experiments.mission import run_mission, scripted_env
from baselines.experiments.statistics import mean_interval
from baselines.papers.sujan.cliff.claims import FEW, MORE, Records, looks_of, new_columns
from baselines.papers.sujan.cliff.mission import known_columns, plateau_of
from baselines.papers.sujan.cliff.sweep import METHODS, STEPS, cell_id, scenario_of, start_of
from baselines.strategies import make_strategy
from baselines.strategies.next_best_view.plateau_rule import PlateauRule
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv

_EVERY = 5
"""Steps between the rows of a table."""
_SHOWN = ((1, STEPS), (3, MORE), (5, FEW))
"""Method and steps of each top view of fig. 25."""


def figure_columns(records: Records) -> tuple[Figure, dict[str, list[object]]]:
    """Fig. 24: new columns over steps, means of all worlds with 95 % intervals."""
    figure = Figure(figsize=(7.0, 4.2), layout="constrained")
    axes, table = figure.subplots(), _table("method", "step", "mean", "low", "high")
    for number, (method, strategy) in enumerate(METHODS.items()):
        rows = new_columns(records, method)
        mean, low, high = _curve(rows)
        axes.plot(mean, color=COLOURS[number], label=f"{method} {strategy}")
        axes.fill_between(np.arange(len(mean)), low, high, color=COLOURS[number], alpha=0.18, linewidth=0)
        at = np.arange(0, rows.shape[1], _EVERY)
        _extend(table, method=[method] * len(at), step=at, mean=mean[at], low=low[at], high=high[at])
    axes.set(xlabel="steps after the first looks", ylabel="new columns", xlim=(0, None), ylim=(0, None))
    axes.legend(frameon=False)
    axes.set_title(f"Fig. 24: means of {len(records[cell_id(5)])} worlds")
    return figure, table


def figure_looks(records: Records) -> tuple[Figure, dict[str, list[object]]]:
    """Figs. 26 and 31: new columns that looks were expected to show, and that they showed."""
    figure = Figure(figsize=(9.0, 3.4), layout="constrained")
    table = _table("method", "look", "expected", "obtained")
    for axes, method in zip(figure.subplots(1, 3, sharey=True), (3, 4, 5), strict=True):
        curves = {}
        for field, colour in (("expected", COLOURS[0]), ("obtained", COLOURS[1])):
            mean, low, high = _curve(looks_of(records, method, field, MORE))
            looks, curves[field] = np.arange(1, len(mean) + 1), mean
            axes.plot(looks, mean, color=colour, label=field)
            axes.fill_between(looks, low, high, color=colour, alpha=0.18, linewidth=0)
        axes.set(title=f"method {method}", xlabel="look", ylim=(0, None))
        _extend(table, method=[method] * len(looks), look=looks, **curves)
    figure.axes[0].set_ylabel("new columns")
    figure.axes[0].legend(frameon=False)
    return figure, table


def figure_views() -> Figure:
    """Figs. 25 and 27: mapped columns of world 0 from above, and the interest that method 5 has left."""
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
    """A mission in world 0 after some steps."""
    scenario = scenario_of(steps)
    env = scripted_env(scenario)
    strategy = make_strategy(METHODS[method])
    assert isinstance(strategy, PlateauRule)
    run_mission(env, strategy, 0, options={"world": 0, "starts": [start_of(scenario)]})
    return env, strategy


def _curve(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mean of each column of (N, S) rows, and its interval."""
    mean, low, high = zip(*(mean_interval(column) for column in rows.T), strict=True)
    return np.array(mean).round(3), np.array(low).round(3), np.array(high).round(3)


def _table(*names: str) -> dict[str, list[object]]:
    return {name: [] for name in names}


def _extend(table: dict[str, list[object]], **columns: object) -> None:
    for name, values in columns.items():
        table[name].extend(np.asarray(values).tolist())
