"""The experiment of Rocha04 as cells: scenario, strategy and number of starts of each point."""

from __future__ import annotations

from itertools import product

from baselines.experiments.experiment import Amount
from baselines.experiments.trials import Cell, CellTrial, trials_of
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.settings.scenarios import ROOM

TEAMS = (2, 3, 4)
BURSTS = (32, 64, 128)
I_MINS = (0.6215, 0.3219, 0.0291)
STANDARD = (64, 0.3219)
"""burst and I_min of figure 4."""
ALTERNATIVES = ("random", "gradient-plane", "planned-rate")
"""Strategies compared with eqs. 33-34 for every team size: a random walk, the motion-plane rule, and ours."""


def team_id(robots: int, burst: int, i_min_bits: float) -> str:
    """Return the name of the cell with this team; a robot alone shares nothing, whatever the channel."""
    return "single" if robots == 1 else f"team-{robots}-burst-{burst}-imin-{i_min_bits}"


def alternative_id(robots: int, strategy: str) -> str:
    """Return the name of the cell with another strategy and the settings of `team_id(robots, *STANDARD)`."""
    return f"single-{strategy}" if robots == 1 else f"team-{robots}-{strategy}"


def experiment(amount: Amount) -> list[CellTrial]:
    """Return all missions; in a quick run one robot has three times as many starts."""
    single, starts = with_settings(ROOM, {"robots": 1}), amount.seeds
    alone = 3 * starts if amount.quick else starts
    cells = [
        Cell("single", single, "gradient", alone),
        *(Cell(alternative_id(1, strategy), single, strategy, alone) for strategy in ALTERNATIVES),
    ]
    for robots in TEAMS:
        for burst, i_min_bits in product(BURSTS, I_MINS):
            scenario = _team(robots, burst, i_min_bits)
            cells.append(Cell(team_id(robots, burst, i_min_bits), scenario, "gradient", starts))
        for strategy in ALTERNATIVES:
            cells.append(Cell(alternative_id(robots, strategy), _team(robots, *STANDARD), strategy, starts))
    return trials_of(cells)


def _team(robots: int, burst: int, i_min_bits: float) -> Scenario:
    return with_settings(ROOM, {"robots": robots, "channel": {"burst": burst, "i_min_bits": i_min_bits}})
