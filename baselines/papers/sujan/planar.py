"""Sujan's planar experiments: five ways of choosing poses, by one robot and by two (figs. 17, 20, 22)."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from baselines.experiments.claims import Claim, above, below
from baselines.experiments.experiment import Amount, Experiment, Records
from baselines.experiments.mission import Surroundings, run_mission
from baselines.experiments.plots import COLOURS, mean_band
from baselines.experiments.rows import Record
from baselines.experiments.statistics import mean_interval, ratio_interval
from baselines.experiments.tables import cells_table
from baselines.experiments.trials import Cell, CellTrial, trials_of
from baselines.strategies import make_strategy
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.reports.metrics import mission_figures
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.settings.scenarios import OCCLUSIONS

METHODS = {
    "i": "random-known",
    "ii": "raster",
    "iii": "most-unmapped",
    "iv": "least-mapped",
    "v": "next-best-view",
}
"""The paper's number of a method → its strategy."""
TEAMS = (1, 2)
SCANS = 150
"""Of the team; the figures do not say how many the paper took."""
OTHERS = ("random", "nearest-frontier")
"""Strategies beside the paper's, for one robot."""


@dataclass(frozen=True)
class Run:
    """Runs a mission of a cell."""

    def __call__(self, env: EntropyExploreEnv, strategy: str, seed: int) -> Record:
        """Run the mission.

        Returns:
            The mission's figures, and before the first and after each of the team's scans `mapped`, the share
            mapped of what can be seen, and `driven_m_by_scan`, the way of all robots.
        """
        mapped, driven_m = [0.0], [0.0]

        def note(env: EntropyExploreEnv) -> None:
            robots, clock = env.missions.state.robots[0], env.missions.state.missions[0]
            share = float(clock["explored_visible"] / clock["visible"])
            missing = int(robots["scans"].sum()) + 1 - len(mapped)
            mapped.extend([round(share, 5)] * missing)
            driven_m.extend([round(float(robots["distance_m"].sum()), 2)] * missing)

        run_mission(env, make_strategy(strategy), seed, note)
        return {**mission_figures(env.missions, 0), "mapped": mapped, "driven_m_by_scan": driven_m}


def cell_id(robots: int, method: str) -> str:
    """Return the name of the cell of a method."""
    return f"robots-{robots}-{method}"


def experiment(amount: Amount) -> list[CellTrial]:
    """Return all missions."""
    seeds = amount.seeds
    points = [(robots, *method) for robots in TEAMS for method in METHODS.items()]
    points += [(1, strategy, strategy) for strategy in OTHERS]
    cells = [
        Cell(cell_id(robots, method), scenario_of(robots), strategy, seeds, Run(), in_the_middle(robots))
        for robots, method, strategy in points
    ]
    return trials_of(cells)


def scenario_of(robots: int) -> Scenario:
    """Return the task: a sensor of 90° and 15 m for one robot, of 75° and 10 m for two; a number of scans.

    A drive leads wherever the robot wants, so that each decision is one scan, as in the paper.
    """
    view, range_m = (math.pi / 2, 15.0) if robots == 1 else (math.radians(75.0), 10.0)
    settings = {
        "robots": robots,
        "robot": {"reach_m": math.inf},
        "sensor": {"field_of_view_rad": (view, 0.0), "max_range_m": range_m},
        "channel": {"burst": 1000},
        "ending": {"max_cycles": SCANS, "time_limit_s": 1e6, "seen_share": 1.0},
        "track_truth": True,
    }
    return with_settings(OCCLUSIONS, settings)


def in_the_middle(robots: int) -> Surroundings:
    """Return the start of all missions: in the middle, two robots a metre apart."""
    middle = [0.5 * size for size in OCCLUSIONS.grid.size_m]
    places = [[middle[0] + robot - 0.5 * (robots - 1), *middle[1:], 0.0, 0.0] for robot in range(robots)]
    return Surroundings(every_reset=json.dumps({"starts": places}))


GROUPS = {
    "most-": "(v) maps more for the same scans than each other method, 1 and 2 robots; ratio",
    "order-": "random poses (i) map more than (iii) and (iv); ratio",
    "metre-": "(v) maps more for each metre than each other method; ratio",
    "worst-": "random poses map less for each metre than each other method; ratio",
    "way-": "(v) drives slightly more than (iii); ratio",
}
"""Beginning of ids → what the claims are, on the page."""


def all_claims(records: Records) -> list[Claim]:
    """Return every claim, from the missions' records by cell."""
    return [claim for robots in TEAMS for claim in _team_claims(records, robots)]


def _team_claims(records: Records, robots: int) -> list[Claim]:
    """Claim which method maps more for the same scans, and for each metre, and which drives more."""
    cells = {method: cell_id(robots, method) for method in METHODS}
    share = {method: mapped(records, cell) for method, cell in cells.items()}
    density = {method: mapped_per_metre(records, cell) for method, cell in cells.items()}
    ways = [at_end(records, cells[method], "driven_m_by_scan") for method in ("v", "iii")]

    def ratios(name: str, values: dict[str, np.ndarray], better: str, others: str) -> list[Claim]:
        judge = below if name == "worst" else above
        pairs = {other: ratio_interval(values[better], values[other]) for other in others.split()}
        return [judge(f"{name}-{robots}-{other}", ratio) for other, ratio in pairs.items()]

    return [
        *ratios("most", share, "v", "i ii iii iv"),
        *ratios("order", share, "i", "iii iv"),
        *ratios("metre", density, "v", "i ii iii iv"),
        *ratios("worst", density, "i", "ii iii iv"),
        above(f"way-{robots}", ratio_interval(*ways)),
    ]


def by_scan(records: Records, cell: str, field: str, scans: int = SCANS) -> np.ndarray:
    """Return (N, scans + 1) a figure of each mission before its first scan and after each; the last stays."""
    rows = [np.asarray(record[field], float)[: scans + 1] for record in records[cell]]
    return np.stack([np.pad(row, (0, scans + 1 - len(row)), mode="edge") for row in rows])


def at_end(records: Records, cell: str, field: str) -> np.ndarray:
    """Return (N,) a figure of each mission after its last scan."""
    return np.asarray([record[field][-1] for record in records[cell]], float)


def mapped(records: Records, cell: str) -> np.ndarray:
    """Return (N,) mean share mapped over the scans of each mission: how much is mapped for the same scans."""
    return np.asarray(by_scan(records, cell, "mapped")[:, 1:].mean(axis=1))


def mapped_per_metre(records: Records, cell: str) -> np.ndarray:
    """Return (N,) share mapped at the end, over the way of the team in hundreds of metres."""
    share, way_m = (at_end(records, cell, field) for field in ("mapped", "driven_m_by_scan"))
    return np.asarray(100.0 * share / np.maximum(way_m, 1.0))


def figure_scans(records: Records, robots: int) -> Figure:
    """Draw share mapped and way driven over scans, means of all worlds with intervals."""
    figure = Figure(figsize=(9.0, 3.8), layout="constrained")
    shares, ways = figure.subplots(1, 2)
    at = np.arange(0, SCANS + 1, 5)
    for number, (method, strategy) in enumerate(METHODS.items()):
        for axes, field in ((shares, "mapped"), (ways, "driven_m_by_scan")):
            samples = by_scan(records, cell_id(robots, method), field)[:, at]
            mean_band(axes, at, samples, color=COLOURS[number], label=f"({method}) {strategy}")
    shares.set(xlabel="scans of the team", ylabel="share mapped", ylim=(0, 1))
    ways.set(xlabel="scans of the team", ylabel="way of the team (m)", ylim=(0, None))
    ways.legend(frameon=False, loc="upper left")
    team = "one robot, 90°, 15 m" if robots == 1 else "two robots, 75°, 10 m"
    worlds = len(records[cell_id(robots, "v")])
    figure.suptitle(f"Fig. {20 if robots == 1 else 22}: {team}; means of {worlds} worlds")
    return figure


def _methods_table(records: Records) -> str:
    """Return a table of every method and what stands beside them."""
    rows = [((robots, f"({m}) {s}"), cell_id(robots, m)) for robots in TEAMS for m, s in METHODS.items()]
    rows[len(METHODS) : len(METHODS)] = [((1, f"{s}, not the paper's"), cell_id(1, s)) for s in OTHERS]

    def mean(cell: str, field: str, form: str) -> str:
        return format(at_end(records, cell, field).mean(), form)

    columns = {
        "mean share mapped": lambda cell: f"{mean_interval(mapped(records, cell)):.3f}",
        f"share after {SCANS} scans": lambda cell: mean(cell, "mapped", ".3f"),
        "way (m)": lambda cell: mean(cell, "driven_m_by_scan", ",.0f"),
        "share a 100 m": lambda cell: f"{mean_interval(mapped_per_metre(records, cell)):.3f}",
    }
    return cells_table(["robots", "method"], rows, columns)


EXPERIMENT = Experiment(
    name="sujan-planar",
    title="Sujan, planar",
    template=Path(__file__).with_name("planar.md.j2"),
    trials=experiment,
    claims=all_claims,
    groups=GROUPS,
    figures={
        "figure-20": partial(figure_scans, robots=1),
        "figure-22": partial(figure_scans, robots=2),
    },
    tables={"methods": _methods_table},
    quick_seeds=5,
)
