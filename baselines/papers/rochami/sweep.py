"""The experiment of RochaMI as cells: scenario, coordination and number of starts of each point."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from baselines.experiments.experiment import Amount
from baselines.experiments.trials import Cell, CellTrial, trials_of
from baselines.papers.rochami.mission import Run
from baselines.strategies.mutual_information.neighbourhood import MutualInformationConfig
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.scenarios import LAB, ROOM

TEAMS = tuple(range(2, 11))
FEW = (2, 4, 8)
"""Team sizes with one thing changed at a time."""
QUICK_KAPPAS = (0.25, 1.0)
KAPPAS = (0.0, 0.0625, 0.125, 0.25, 0.375, 0.5, 0.75, 1.0)
COVERED = (4, 8)
"""Team sizes of which H(T) and I are followed."""
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
class Change:
    """One thing that is not as in the experiment.

    Attributes:
        text: What it is.
        settings: Of the scenario.
        coordination: Fields of MutualInformationConfig.
        both: Whether it concerns the uncoordinated method, too; else it is compared with that as it is.
        starts: At most this many, where missions seldom end.
    """

    text: str
    settings: dict[str, Any]
    coordination: dict[str, Any]
    both: bool = True
    starts: int = 1000


CHANGES: dict[str, Change] = {
    "bodies": Change(
        "bodies off: no robot is in the way",
        {"robot": {"body_radius_m": 0.0}},
        {"teammates_block": False},
    ),
    "bodies-no-overlap": Change(
        "bodies off, and λ = 1",
        {"robot": {"body_radius_m": 0.0}},
        {"teammates_block": False, "overlap": False, "interference": 1.0},
    ),
    "overlap": Change("λ = 1: overlap does not count", {}, {"overlap": False}, both=False),
    "blocking": Change("teammates do not count in ρ", {}, {"teammates_block": False}, both=False),
    "interference": Change("η = 1: teammates in view do not count", {}, {"interference": 1.0}, both=False),
    "only-overlap": Change(
        "λ alone: η = 1, teammates not in ρ",
        {},
        {"teammates_block": False, "interference": 1.0},
        both=False,
    ),
    "scale-up": Change("ξ ten times as large", {}, {"overlap_scale": 1.0}, both=False),
    "scale-down": Change("ξ a tenth", {}, {"overlap_scale": 0.01}, both=False),
    "unannounced": Change("nothing is announced", {"channel": {"announcements": False}}, {}, both=False),
    "lost": Change("half of all messages are lost", {"channel": {"loss_probability": 0.5}}, {}),
    "occlusion": Change("obstacles hide voxels of cones", {}, {"occlusion": True}, both=False),
    "entropy": Change("a voxel counts as known at σ = 0.03 instead of 0.2", {}, {"known_sigma": 0.03}),
    "static": Change("ρ does not heed obstacles (eq. 38 as it stands)", {}, {"static_reach": False}),
    "literal": Change(
        "neither ρ of obstacles nor escape from traps",
        {},
        {"static_reach": False, "repeats": 10**6},
        starts=10,
    ),
    "starts": Change("all start within 1.5 m of each other", {"start_radius_m": 1.5}, {}),
    "reach": Change("candidates at most 1 m away", {"robot": {"reach_m": 1.0}}, {}),
    "end": Change("the mission ends at σ = 0.1 instead of 0.2", {"ending": {"sigma_end": 0.1}}, {}),
    "wait-15": Change("blocked robots wait 15 s instead of 5 s", {"robot": {"blocked_wait_s": 15.0}}, {}),
}


def cell_id(robots: int, method: str, blocked: str = "wait") -> str:
    """Return the name of a cell of the main experiment; a robot alone is not blocked and not coordinated."""
    if robots == 1:
        return "n1-random" if method == "random" else "n1-rule"
    return f"n{robots}-{method}-{blocked}"


def kappa_id(kappa: float) -> str:
    """Return the name of the cell with this cost sensitivity."""
    return f"kappa-{kappa:g}" if kappa > 0.0 else cell_id(2, "coordinated")


def change_id(name: str, robots: int, method: str) -> str:
    """Name of the cell with one thing changed; of what does not concern a method the cell without it."""
    if method == "uncoordinated" and not CHANGES[name].both:
        return cell_id(robots, method)
    return f"change-{name}-n{robots}-{method}"


def sharing_id(robots: int, i_min_bits: float | None = None, fill: float | None = None) -> str:
    """Return the name of the cell in Rocha04's room with a fixed or a steered I_min."""
    return f"sharing-n{robots}-" + (f"imin-{i_min_bits:g}" if fill is None else f"fill-{fill:g}")


def experiment(amount: Amount) -> list[CellTrial]:
    """Return all missions; a quick run has fewer team sizes and changes."""
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
                covered = robots in COVERED and blocked == "wait" and method != "random"
                name = cell_id(robots, method, blocked)
                cells.append(_cell(name, settings, method, starts, covered=covered))
        short = {"robots": robots, "robot": {"reach_m": 1.0}}
        cells.append(_cell(f"n{robots}-random-1m", short, "random", starts))
    for kappa in QUICK_KAPPAS if quick else KAPPAS[1:]:
        cells.append(_cell(kappa_id(kappa), {"robots": 2}, "coordinated", starts, {"distance_cost": kappa}))
    for name in ("bodies", "reach") if quick else CHANGES:
        for robots in FEW:
            for method in METHODS[:2] if CHANGES[name].both else METHODS[:1]:
                change = CHANGES[name]
                settings = {"robots": robots, **change.settings}
                cell, few = change_id(name, robots, method), min(starts, change.starts)
                cells.append(_cell(cell, settings, method, few, change.coordination))
    return trials_of(cells + _sharing_cells(starts, quick))


def _cell(
    name: str,
    settings: dict[str, Any],
    method: str,
    starts: int,
    coordination_settings: dict[str, Any] | None = None,
    covered: bool = False,
) -> Cell:
    scenario = with_settings(with_settings(LAB, _BASE), settings)
    if method != "coordinated":
        scenario = with_settings(scenario, {"channel": {"announcements": False}})
    if method == "random":
        return Cell(name, scenario, "random", starts)
    own = {"coordinated": method == "coordinated", **(coordination_settings or {})}
    strategy = "mutual-information" if method == "coordinated" else "ground-gradient"
    return Cell(name, scenario, strategy, starts, Run(MutualInformationConfig(**own), covered))


def _sharing_cells(starts: int, quick: bool) -> list[Cell]:
    """Rocha04's room with its gradient strategy: I_min fixed, or steered."""
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
