"""The experiment of RochaMI as cells: scenario, coordination and number of starts of each point."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from baselines.experiments.experiment import Amount
from baselines.experiments.mission import mission_record
from baselines.experiments.rows import Record
from baselines.experiments.trials import Cell, CellTrial, trials_of
from baselines.strategies.rules.mutual_information import MutualInformation
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.scenarios import LAB, ROOM

TEAMS = tuple(range(2, 11))
FEW = (2, 4, 8)
"""Team sizes of quick runs, and of the table."""
QUICK_KAPPAS = (0.25, 1.0)
KAPPAS = (0.0, 0.0625, 0.125, 0.25, 0.375, 0.5, 0.75, 1.0)
I_MINS = (0.6215, 0.3219, 0.0291)
FILLS = (0.15, 0.35, 0.5, 0.75, 1.0, 1.5, 3.0)
SHARING_TEAMS = (2, 4)

METHODS = ("coordinated", "uncoordinated", "random")
BLOCKED = ("wait", "wander")
END_SIGMA = 0.2
TIME_LIMIT_S = 2000.0

_BASE: dict[str, Any] = {
    "robot": {"reach_m": 4.0, "when_blocked": "wait"},
    "ending": {"sigma_end": END_SIGMA, "time_limit_s": TIME_LIMIT_S},
}


@dataclass(frozen=True)
class Run:
    """Runs a mission of `mutual-information` with another κ than the strategy of that name has."""

    distance_cost: float

    def __call__(self, env: EntropyExploreEnv, strategy: str, seed: int) -> Record:
        """Run the mission."""
        return mission_record(env, MutualInformation(distance_cost=self.distance_cost), seed)


def cell_id(robots: int, method: str, blocked: str = "wait") -> str:
    """Return the name of a cell of the main experiment; a robot alone is not blocked and not coordinated."""
    if robots == 1:
        return "n1-random" if method == "random" else "n1-rule"
    return f"n{robots}-{method}-{blocked}"


def kappa_id(kappa: float) -> str:
    """Return the name of the cell with this cost sensitivity."""
    return f"kappa-{kappa:g}" if kappa > 0.0 else cell_id(2, "coordinated")


def sharing_id(robots: int, i_min_bits: float | None = None, fill: float | None = None) -> str:
    """Return the name of the cell in Rocha04's room with a fixed or a steered I_min."""
    return f"sharing-n{robots}-" + (f"imin-{i_min_bits:g}" if fill is None else f"fill-{fill:g}")


def experiment(amount: Amount) -> list[CellTrial]:
    """Return all missions; a quick run has fewer team sizes."""
    starts, quick = amount.seeds, amount.quick
    teams = FEW if quick else TEAMS
    cells = [
        _cell(cell_id(1, "random"), {"robots": 1}, "random", starts),
        _cell(cell_id(1, "coordinated"), {"robots": 1}, "coordinated", starts),
        _cell("n1-random-1m", {"robots": 1, "robot": {"reach_m": 1.0}}, "random", starts),
    ]
    for robots in teams:
        for blocked in BLOCKED:
            for method in METHODS:
                settings = {"robots": robots, "robot": {"when_blocked": blocked}}
                cells.append(_cell(cell_id(robots, method, blocked), settings, method, starts))
        short = {"robots": robots, "robot": {"reach_m": 1.0}}
        cells.append(_cell(f"n{robots}-random-1m", short, "random", starts))
    for kappa in QUICK_KAPPAS if quick else KAPPAS[1:]:
        cells.append(_cell(kappa_id(kappa), {"robots": 2}, "coordinated", starts, kappa))
    return trials_of(cells + _sharing_cells(starts, quick))


def _cell(
    name: str,
    settings: dict[str, Any],
    method: str,
    starts: int,
    kappa: float | None = None,
) -> Cell:
    scenario = with_settings(with_settings(LAB, _BASE), settings)
    if method != "coordinated":
        scenario = with_settings(scenario, {"channel": {"announcements": False}})
    if method == "random":
        return Cell(name, scenario, "random", starts)
    strategy = "mutual-information" if method == "coordinated" else "ground-gradient"
    record = mission_record if kappa is None else Run(kappa)
    return Cell(name, scenario, strategy, starts, record)


def _sharing_cells(starts: int, quick: bool) -> list[Cell]:
    """Return the cells of Rocha04's room with its gradient strategy: I_min fixed, or steered."""
    cells = []
    for robots in SHARING_TEAMS[:1] if quick else SHARING_TEAMS:
        base = with_settings(ROOM, {"robots": robots, "channel": {"burst": 64}, "time_limit_s": math.inf})
        for i_min_bits in I_MINS:
            fixed = with_settings(base, {"channel": {"i_min_bits": i_min_bits}})
            cells.append(Cell(sharing_id(robots, i_min_bits), fixed, "gradient", starts))
        for fill in FILLS[1::2] if quick else FILLS:
            steered = with_settings(base, {"channel": {"i_min_bits": I_MINS[0], "i_min_fill": fill}})
            cells.append(Cell(sharing_id(robots, fill=fill), steered, "gradient", starts))
    return cells
