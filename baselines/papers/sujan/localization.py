"""Sujan's errors of localization over the way (fig. 19): fiducials near and far, and the rating's weight."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from baselines.experiments.claims import Claim, below
from baselines.experiments.experiment import Amount, Experiment, Records, sample
from baselines.experiments.mission import run_mission
from baselines.experiments.plots import COLOURS
from baselines.experiments.rows import Record
from baselines.experiments.statistics import mean_interval, ratio_interval
from baselines.experiments.tables import cells_table
from baselines.experiments.trials import Cell, CellTrial, trials_of
from baselines.papers.sujan.planar import METHODS, at_end, in_the_middle, scenario_of
from baselines.strategies.rules.next_best_view import NextBestView
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.reports.metrics import mission_figures
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.localization import Localization
from entropy_explore_env.settings.scenario import Scenario

DRIFT = Localization(xy_m_per_sqrt_m=0.02, yaw_rad_per_sqrt_m=0.002, yaw_rad_per_sqrt_rad=0.002)
"""Ours: after 100 m the standard deviation of x, and that of y, is 0.2 m, and that of the yaw 1.1°."""
COUNTS = (0, 1, 3, 10)
"""Fiducials within reach of a robot on average, the numbers of fig. 19."""
REACH_M = {"near": 7.5, "far": 15.0}
"""How far away fiducials are sighted."""
AREA_M2 = 100.0 * 100.0
ERROR_WEIGHTS = (0.3, 1.0)
"""w_LE, bits a metre, beside 0."""
SPARSE = (1, 3)
"""Fiducials within reach, far, where w_LE is weighed: with more, any way leads past some."""
OWN = 16
"""Landmarks of the robot's own map, where there are no fiducials: ours."""
OWN_ID = "own-landmarks"
SCANS = 60
_QUICK_SCANS = 40
WAY_M = 300.0
"""Errors are compared over so much of the way."""
EVERY_M = 10.0
_SHARE = 0.25
"""Of what can be seen: how long it takes to map it."""
GROUPS = {
    "number-": "the error is less with more fiducials: 1, 3, 10 within reach, near and far; ratio to fewer",
    "near-": "the error is less with near fiducials than with far ones; ratio",
    "own": "ours: the error is less with landmarks of its own map than with none; ratio",
    "weight-": "ours: less of the map is wrong where the rating weighs the error; ratio",
}
"""Beginning of ids → what the claims are, on the page."""


@dataclass(frozen=True)
class Run:
    """Runs a mission of a cell with `next-best-view`, whatever the strategy that the cell names.

    Without what lets robots that drift back off from what blocks them (`planner.driver`): the paper's
    have nothing of the kind.
    """

    error_weight: float = 0.0

    def __call__(self, env: EntropyExploreEnv, strategy: str, seed: int) -> Record:
        """Run the mission.

        Returns:
            The mission's figures, and after each scan `error_m`, of the place, `driven_m_by_scan`, `time_s`,
            `mapped`, the share mapped of what can be seen, and `wrong`, the share of that map on the wrong
            side of ½.
        """
        series: dict[str, list[float]] = {
            name: [] for name in ("error_m", "driven_m_by_scan", "time_s", "mapped", "wrong")
        }

        def note(env: EntropyExploreEnv) -> None:
            figures = mission_figures(env.missions, 0, floor=False)
            if figures["scans"] == len(series["mapped"]):
                return
            joint = figures["joint"]
            found = {
                "error_m": figures["localization"]["mean_error_m"],
                "driven_m_by_scan": figures["distance_m"],
                "time_s": figures["t_mission_s"],
                "mapped": joint["explored"],
                "wrong": joint["wrong"],
            }
            for name, number in found.items():
                series[name].append(round(float(number), 4))

        run_mission(env, NextBestView(self.error_weight), seed, note, backs_off=False)
        return {**mission_figures(env.missions, 0, floor=False), **series}


def cell_id(count: int, reach: str, weight: float = 0.0) -> str:
    """Return the name of the cell of a number of fiducials, `near` or `far`, and a weight of the error."""
    place = f"fiducials-{count}-{reach}" if count else "fiducials-0"
    return f"{place}-weight-{weight:g}" if weight else place


def in_world(count: int, reach: str) -> int:
    """Return the number of fiducials in a world that has `count` of them within reach, on average."""
    return round(count * AREA_M2 / (math.pi * REACH_M[reach] ** 2))


def experiment(amount: Amount) -> list[CellTrial]:
    """Return all missions, one a world: method (v), one robot."""
    worlds, scans = amount.seeds, _QUICK_SCANS if amount.quick else SCANS
    cells = [_cell(0, "far", 0.0, worlds, scans)]
    for reach in REACH_M:
        cells += [_cell(count, reach, 0.0, worlds, scans) for count in COUNTS if count]
    own = with_settings(drifting(0, "far", scans), {"fiducials": {"own_number": OWN}})
    cells.append(Cell(OWN_ID, own, METHODS["v"], worlds, Run(), in_the_middle(1)))
    for count in SPARSE:
        cells += [_cell(count, "far", weight, worlds, scans) for weight in ERROR_WEIGHTS]
    return trials_of(cells)


def _cell(count: int, reach: str, weight: float, worlds: int, scans: int) -> Cell:
    task = drifting(count, reach, scans)
    return Cell(cell_id(count, reach, weight), task, METHODS["v"], worlds, Run(weight), in_the_middle(1))


def drifting(count: int, reach: str, scans: int) -> Scenario:
    """Return the planar task for one robot that drifts."""
    return with_settings(
        scenario_of(1),
        {
            "robot": {"localization": DRIFT},
            "fiducials": {"number": in_world(count, reach), "range_m": REACH_M[reach]},
            "ending": {"max_cycles": scans},
        },
    )


def all_claims(records: Records) -> list[Claim]:
    """Return every claim."""
    pairs = {
        f"number-{reach}-{more}": (cell_id(more, reach), cell_id(fewer, reach))
        for reach in REACH_M
        for fewer, more in itertools.pairwise(COUNTS)
    }
    pairs |= {f"near-{count}": (cell_id(count, "near"), cell_id(count, "far")) for count in COUNTS[1:]}
    pairs["own"] = OWN_ID, cell_id(0, "far")
    claims = [
        below(name, ratio_interval(*(rms_error_m(records, cell) for cell in cells)))
        for name, cells in pairs.items()
    ]
    for count, weight in itertools.product(SPARSE, ERROR_WEIGHTS):
        cells = cell_id(count, "far", weight), cell_id(count, "far")
        ratio = ratio_interval(*(at_end(records, cell, "wrong") for cell in cells))
        claims.append(below(f"weight-{count}-{weight:g}", ratio, claim=f"w_LE {weight:g} instead of 0"))
    return claims


def errors_by_way(records: Records, cell: str) -> np.ndarray:
    """Return (N, D) error of the place in metres after every `EVERY_M` of each mission's way, up to `WAY_M`.

    Between scans it is interpolated; beyond the last one it stays.
    """
    at = np.arange(0.0, WAY_M + 0.5 * EVERY_M, EVERY_M)
    return np.stack(
        [np.interp(at, record["driven_m_by_scan"], record["error_m"]) for record in records[cell]]
    )


def rms_error_m(records: Records, cell: str) -> np.ndarray:
    """Return (N,) root mean square error of the place over `WAY_M` of each mission's way."""
    return np.asarray(np.sqrt((errors_by_way(records, cell) ** 2).mean(axis=1)))


def time_to_map(records: Records, cell: str, share: float) -> np.ndarray:
    """Return (N,) seconds until a share was mapped; where it was not, those of the whole mission."""
    times = []
    for record in records[cell]:
        reached = int(np.searchsorted(np.asarray(record["mapped"]), share))
        times.append(record["time_s"][min(reached, len(record["time_s"]) - 1)])
    return np.asarray(times, float)


def _columns(records: Records) -> dict[str, Callable[[str], str]]:
    """Return what both tables show of a cell."""
    return {
        f"rms over {WAY_M:.0f} m, mean of worlds (m)": lambda cell: (
            f"{mean_interval(rms_error_m(records, cell)):.3f}"
        ),
        "wrong, mean": lambda cell: f"{mean_interval(at_end(records, cell, 'wrong')):.4f}",
        "share mapped, mean": lambda cell: f"{at_end(records, cell, 'mapped').mean():.3f}",
    }


def _fiducials_table(records: Records) -> str:
    """Return a table of numbers of fiducials within reach."""
    rows = [(("0", ""), cell_id(0, "far")), (("own", ""), OWN_ID)]
    rows += [((count, reach), cell_id(count, reach)) for reach in REACH_M for count in COUNTS if count]

    def sighted(cell: str) -> str:
        told = [record["localization"] for record in records[cell]]
        found = np.mean([each["sightings"] + each.get("own_sightings", 0) for each in told])
        return f"{found / sample(records, cell, 'scans').mean():.2f}"

    def last_error(cell: str) -> str:
        return f"{mean_interval(errors_by_way(records, cell)[:, -1]):.2f}"

    head = f"error after {WAY_M:.0f} m, mean of worlds (m)"
    columns = {"sighted a scan": sighted, **_columns(records), head: last_error}
    return cells_table(["within reach", ""], rows, columns)


def _weights_table(records: Records) -> str:
    """Return a table of weights of the localization error in the rating."""
    rows = [
        ((count, f"{weight:g}"), cell_id(count, "far", weight))
        for count, weight in itertools.product(SPARSE, (0.0, *ERROR_WEIGHTS))
    ]

    def slower(cell: str) -> str:
        unweighted = cell.partition("-weight")[0]
        times = [time_to_map(records, name, _SHARE) for name in (cell, unweighted)]
        return f"{ratio_interval(*times):.2f}"

    columns = {
        **_columns(records),
        "way, mean (m)": lambda cell: f"{at_end(records, cell, 'driven_m_by_scan').mean():,.0f}",
        f"seconds to {_SHARE:.0%} mapped, over w_LE 0": slower,
    }
    return cells_table(["within reach", "w_LE"], rows, columns)


def figure_19(records: Records) -> Figure:
    """Draw the root mean square error of the place over the way, near and far fiducials."""
    figure = Figure(figsize=(9.0, 3.8), layout="constrained")
    for axes, reach in zip(figure.subplots(1, len(REACH_M), sharey=True), REACH_M, strict=True):
        for number, count in enumerate(COUNTS):
            curve = np.sqrt((errors_by_way(records, cell_id(count, reach)) ** 2).mean(axis=0))
            axes.plot(EVERY_M * np.arange(len(curve)), curve, color=COLOURS[number], label=f"{count}")
        axes.set(title=f"{reach}: up to {REACH_M[reach]:g} m", xlabel="way (m)")
    figure.axes[0].set(ylabel="error of the place, rms over worlds (m)", ylim=(0, None))
    figure.axes[0].legend(frameon=False, title="fiducials within reach")
    return figure


EXPERIMENT = Experiment(
    name="sujan-localization",
    title="Sujan, errors of localization",
    template=Path(__file__).with_name("localization.md.j2"),
    trials=experiment,
    claims=all_claims,
    groups=GROUPS,
    figures={"figure-19": figure_19},
    tables={"fiducials": _fiducials_table, "weights": _weights_table},
)
