"""A picture of a mission in the suites' warehouse: `python -m baselines.scoreboard.picture FILE`.

Three moments side by side: what the team knows together, and where its robots have driven.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from baselines.cli.arguments import Positional, parse, run_command
from baselines.cli.figures import COLOURS, STYLE, extent_of, png
from baselines.experiments.mission import run_mission, scripted
from baselines.scoreboard.suites import find_suite
from baselines.strategies import make_strategy
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.reports.metrics import joint_figures
from entropy_explore_env.reports.recording import DrivenPaths
from entropy_explore_env.writing import write_atomically

_TASK = "warehouse, 4 robots"
_MOMENTS = (0.3, 0.65)
"""Shares of what can be seen at which a picture is drawn; another one at the end."""
_KNOWN_SIGMA = 0.5
_UNKNOWN, _FREE, _WALL = (0.80, 0.84, 0.89), (1.0, 1.0, 1.0), (0.13, 0.15, 0.19)


@dataclass
class Args:
    """Draw a mission of four robots in the warehouse."""

    file: Positional[Path] = Path("results/warehouse.png")
    """PNG to write."""
    strategy: str = "best"
    """How robots choose viewpoints; as in baselines.run."""
    seed: int = 3
    """Of the starts and every other draw."""


class Moment(NamedTuple):
    """What is drawn of a moment."""

    title: str
    colours: np.ndarray
    """(X, Y, 3) of what the team knows together."""
    paths_m: list[np.ndarray]
    """(N, 3) of each robot, places at which it turned."""


class Watch:
    """Notes a mission at some moments.

    Attributes:
        moments: Those so far.
    """

    def __init__(self, env: EntropyExploreEnv) -> None:
        """The mission has not begun."""
        self.moments: list[Moment] = []
        self._paths = DrivenPaths(env.scenario.robots)

    def __call__(self, env: EntropyExploreEnv) -> None:
        """Note where robots are, and the map where a moment has come."""
        self._paths.update(env.missions)
        if len(self.moments) < len(_MOMENTS) and seen_share(env) >= _MOMENTS[len(self.moments)]:
            self.note(env)

    def note(self, env: EntropyExploreEnv) -> None:
        """Keep this moment."""
        time_s = float(env.missions.state.missions[0]["time_s"])
        title = f"{time_s:.0f} s: {seen_share(env):.0%} seen"
        self.moments.append(Moment(title, known_colours(env), self._paths.to_now(env.missions)))


def seen_share(env: EntropyExploreEnv) -> float:
    """The share of what can be seen that the team has seen."""
    return joint_figures(env.missions, 0)["explored"] or 0.0


def known_colours(env: EntropyExploreEnv) -> np.ndarray:
    """(X, Y, 3) what the team knows together, by its joint map."""
    state, shape = env.missions.state, env.scenario.grid.shape
    mean = state.joint_mean[0].reshape(shape)[:, :, 0]
    precision = state.joint_precision[0].reshape(shape)[:, :, 0]
    colours = np.where((mean > 0.5)[..., None], _WALL, _FREE)
    return np.where((precision < _KNOWN_SIGMA**-2)[..., None], _UNKNOWN, colours)


def picture(watch: Watch, env: EntropyExploreEnv, title: str) -> Figure:
    """The moments side by side."""
    size_m = env.scenario.grid.size_m
    count = len(watch.moments)
    figure = Figure(figsize=(3.0 * count + 0.2, 3.0 * size_m[1] / size_m[0] + 0.55), layout="constrained")
    panels = figure.subplots(1, count, squeeze=False)[0]
    for axes, (words, colours, paths_m) in zip(panels, watch.moments, strict=True):
        extent = extent_of(env.scenario.grid)
        axes.imshow(colours.swapaxes(0, 1), origin="lower", extent=extent, interpolation="nearest")
        for robot, path_m in enumerate(paths_m):
            _draw_path(axes, path_m, robot)
        axes.set_title(words, fontsize=11)
        axes.set_xticks([])
        axes.set_yticks([])
        for side in axes.spines.values():
            side.set_visible(True)
            side.set_color("0.6")
    figure.suptitle(title, fontsize=12)
    return figure


def _draw_path(axes: Axes, path_m: np.ndarray, robot: int) -> None:
    """Where a robot drove: a ring where it began, a disc where it is."""
    colour = COLOURS[robot % len(COLOURS)]
    axes.plot(path_m[:, 0], path_m[:, 1], color=colour, linewidth=1.7, solid_joinstyle="round")
    axes.plot(*path_m[0, :2], "o", markersize=6, mfc="white", mec=colour, mew=1.6)
    axes.plot(*path_m[-1, :2], "o", markersize=8, color=colour, mec="white", mew=1.0)


def main(words: Sequence[str]) -> int:
    """Run the command."""
    args = parse(Args, words, description=__doc__)
    (task,) = (task for task in find_suite("teams", False, ()).tasks if task.name == _TASK)
    env = EntropyExploreEnv(scripted(task.scenario))
    watch = Watch(env)
    run_mission(env, make_strategy(args.strategy), args.seed, watch)
    watch.note(env)
    size = " × ".join(f"{length_m:.0f}" for length_m in env.scenario.grid.size_m[:2])
    title = f"Four robots with the strategy {args.strategy} in Nav2's warehouse, {size} m"
    with mpl.rc_context(STYLE):
        write_atomically(args.file, png(picture(watch, env, title)))
    print(f"written: {args.file}", file=sys.stderr)
    return 0


if __name__ == "__main__":
    raise SystemExit(run_command(main))
