"""Summaries of maps beside batches of measurements at equal bits a second, by teams of three."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure

from baselines.experiments.claims import Claim, above
from baselines.experiments.experiment import Amount, Experiment, Records
from baselines.experiments.mission import run_mission
from baselines.experiments.plots import COLOURS
from baselines.experiments.rows import Record
from baselines.experiments.statistics import interpolated_ratio_interval, mean_interval
from baselines.experiments.tables import markdown_table
from baselines.experiments.trials import Cell, CellTrial, trials_of
from baselines.strategies import make_strategy
from entropy_explore_env.belief.raycast import STOP_AT_COVERED
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.reports.metrics import mission_figures
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.scenarios import find_scenario


class Task(NamedTuple):
    """What is explored."""

    strategy: str
    settings: dict[str, Any]
    moment_s: float
    """When the maps are compared, besides at the end: before the first mission of any channel ends."""


TASKS = {
    "office": Task("nearest-frontier", {}, 200.0),
    "occlusions": Task("nearest-frontier", {"robots": 3}, 800.0),
    "terrain": Task("gradient", {"ending": {"sigma_end": 0.1}}, 300.0),
}
"""Scenario → task; teams of three. Terrain is mapped less well than by default: missions are shorter."""
BURSTS = (2, 4, 8, 16, 32, 64)
"""Most measurements of a batch; I_min as the scenarios have it."""
EVERY_S = (5.0, 20.0, 60.0)
"""From one summary to the next one."""
FIGURES = ("time", "error", "joint")
"""What is compared: see `figure_of`."""
GROUPS = {
    "time-": "maps in less time than batches of as many bits, a summary every 5, 20, 60 s; ratio",
    "error-": "robots' maps have a smaller error; ratio",
    "joint-": "the joint map has a smaller error; ratio",
}
"""Beginning of ids → what the claims are, on the page."""


@dataclass(frozen=True)
class SharedMaps:
    """Runs a mission and records its figures and its maps.

    Attributes:
        moment_s: When the maps are looked at, besides at the end.
    """

    moment_s: float

    def __call__(self, env: EntropyExploreEnv, strategy: str, seed: int) -> Record:
        """Run the mission.

        Returns:
            Its figures; `bits_per_s` that the team sent; and `moment` and `end`, each what `map_errors` says,
            the former None if the mission ended before.
        """
        moment: list[Record] = []

        def note(env: EntropyExploreEnv) -> None:
            if not moment and env.missions.state.missions["time_s"][0] >= self.moment_s:
                moment.append(map_errors(env))

        run_mission(env, make_strategy(strategy), seed, note)
        figures = mission_figures(env.missions, 0)
        return {
            **figures,
            "bits_per_s": figures["bits_sent"] / figures["t_mission_s"],
            "moment": moment[0] if moment else None,
            "end": map_errors(env),
        }


def map_errors(env: EntropyExploreEnv) -> Record:
    """Return how wrong the maps of a mission are now, over the voxels that can be seen; a voxel unknown is ½.

    Returns:
        `error`: mean |expected - true coverage| of the robots' own maps, mean over the team; `known`: share
        of the voxels that a robot measured or heard of, mean over the team; `wrong`: share of those on the
        wrong side of ½; `joint_error`: the first, of the map that fuses all measurements of the team.
    """
    missions = env.missions
    world = missions.worlds[0]
    if world is None:
        raise ValueError("the mission was never reset")
    visible = world.visible(missions.scenario)
    truth = world.occupied[visible].astype(float)
    mean = missions.mean[0][:, visible].astype(float)
    known = missions.precision[0][:, visible] > np.float32(missions.scenario.sigma_prior**-2)
    flipped = ((mean > STOP_AT_COVERED) != (truth > STOP_AT_COVERED)) & known
    joint = missions.state.joint_mean[0].reshape(world.grid.shape)[visible].astype(float)
    return {
        "error": round(float(np.abs(mean - truth).mean()), 6),
        "known": round(float(known.mean()), 6),
        "wrong": round(float(flipped.sum() / max(known.sum(), 1)), 6),
        "joint_error": round(float(np.abs(joint - truth).mean()), 6),
    }


def batch_id(task: str, burst: int) -> str:
    """Return the name of a cell of Rocha04's batches."""
    return f"{task}-batches-{burst}"


def summary_id(task: str, every_s: float) -> str:
    """Return the name of a cell of summaries."""
    return f"{task}-summaries-{every_s:g}"


def experiment(amount: Amount) -> list[CellTrial]:
    """Return all missions; the worlds and starts are the same in all cells of a scenario."""
    cells = []
    for task in TASKS:
        cells += [_cell(task, batch_id(task, burst), {"burst": burst}, amount.seeds) for burst in BURSTS]
        for every_s in EVERY_S:
            channel = {"content": "summaries", "summary_every_s": every_s}
            cells.append(_cell(task, summary_id(task, every_s), channel, amount.seeds))
    return trials_of(cells)


def _cell(task: str, name: str, channel: dict[str, Any], worlds: int) -> Cell:
    strategy, settings, moment_s = TASKS[task]
    base = with_settings(find_scenario(task), settings)
    scenario = with_settings(base, {"channel": channel, "track_truth": True})
    return Cell(name, scenario, strategy, worlds, SharedMaps(moment_s))


def all_claims(records: Records) -> list[Claim]:
    """Return every claim."""
    claims = []
    for task, every_s, figure in itertools.product(TASKS, EVERY_S, FIGURES):
        ours, batches = records[summary_id(task, every_s)], [records[batch_id(task, b)] for b in BURSTS]
        ratio = interpolated_ratio_interval(
            np.array([figure_of(each, figure) for each in batches]),
            np.array([figure_of(each, "bits") for each in batches]),
            figure_of(ours, figure),
            figure_of(ours, "bits"),
        )
        claims.append(above(f"{figure}-{task}-{every_s:g}", ratio, claim="batches over summaries"))
    return claims


def figure_of(records: list[Record], figure: str) -> np.ndarray:
    """Return (N,) a figure of a cell's missions: `time`, `bits` a second, `error`, `joint`, `known`, `wrong`.

    Those of maps are at the moment that all missions reach; of a mission that ended before, at its end.
    """
    if figure == "time":
        return np.array([record["t_mission_s"] for record in records], float)
    if figure == "bits":
        return np.array([record["bits_per_s"] for record in records], float)
    name = "joint_error" if figure == "joint" else figure
    return np.array([(record["moment"] or record["end"])[name] for record in records], float)


def _channels_table(records: Records) -> str:
    """Return a table of the channels of each scenario."""
    rows = []
    for task in TASKS:
        cells = [(f"batches of {burst}", batch_id(task, burst)) for burst in BURSTS]
        cells += [(f"summaries, {every_s:g} s", summary_id(task, every_s)) for every_s in EVERY_S]
        for name, cell in cells:
            figures = (("bits", ",.0f"), ("time", ",.0f"), ("error", ".4f"), ("joint", ".4f"))
            shown = [format(mean_interval(figure_of(records[cell], what)), form) for what, form in figures]
            rows.append([task, name, *shown])
    head = ["scenario", "channel", "bits/s", "time (s)", "error of robots' maps", "error of the joint map"]
    return markdown_table(head, rows)


def figure_bits(records: Records) -> Figure:
    """Draw mission time, and the error of robots' maps, over bits a second."""
    figure = Figure(figsize=(9.0, 5.4), layout="constrained")
    labels = {"time": "mission time (s)", "error": "error of robots' maps"}
    for row, axes_of in zip(labels, figure.subplots(2, len(TASKS)), strict=True):
        for axes, task in zip(axes_of, TASKS, strict=True):
            kinds = {
                "batches": [batch_id(task, burst) for burst in BURSTS],
                "summaries": [summary_id(task, every_s) for every_s in EVERY_S],
            }
            for colour, (kind, cells) in enumerate(kinds.items()):
                bits = [figure_of(records[cell], "bits").mean() for cell in cells]
                values = [figure_of(records[cell], row).mean() for cell in cells]
                axes.plot(bits, values, color=COLOURS[colour], marker="o", label=kind)
            axes.set(xscale="log", xlabel="bits/s", title=task if row == "time" else "")
            axes.set_xticks([500, 1000, 2000, 4000], ["500", "1000", "2000", "4000"], minor=False)
            axes.set_xticks([], minor=True)
        axes_of[0].set_ylabel(labels[row])
    figure.axes[0].legend(frameon=False)
    return figure


EXPERIMENT = Experiment(
    name="sujan-summaries",
    title="Summaries beside batches",
    template=Path(__file__).with_name("summaries.md.j2"),
    trials=experiment,
    claims=all_claims,
    groups=GROUPS,
    figures={"bits": figure_bits},
    tables={"channels": _channels_table},
    quick_seeds=4,
)
