"""The entries of a head-to-head: every strategy in every scenario and team size, on the same seeds."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path

from baselines.experiments.cells import Cell
from baselines.experiments.mission import scripted
from baselines.head_to_head.timed_mission import timed_record
from baselines.strategies import STRATEGIES, make_strategy, resolved
from baselines.world_sweep import is_plan
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.errors import SettingError
from entropy_explore_env.scenario import Scenario, with_settings
from entropy_explore_env.scenarios import SCENARIOS, find_scenario

BASELINE = "random"
"""The strategy that relative times are relative to; it is always part of the table."""


@dataclass(frozen=True)
class Entries:
    """The experiment.

    Attributes:
        scenarios: Name → the task, with one robot.
        strategies: Names, `random` first.
        robots: Team sizes.
        seeds: Missions of every strategy in every scenario and team size.
    """

    scenarios: dict[str, Scenario]
    strategies: tuple[str, ...]
    robots: tuple[int, ...]
    seeds: int

    def cell_id(self, scenario: str, robots: int, strategy: str) -> str:
        """Name of a cell."""
        return f"{scenario}/robots-{robots}/{strategy}"

    def cells(self) -> list[Cell]:
        """All cells: strategies of one scenario and team size beside each other."""
        return [
            Cell(
                self.cell_id(name, robots, strategy),
                with_settings(scenario, {"robots": robots}),
                strategy,
                self.seeds,
                timed_record,
            )
            for name, scenario in self.scenarios.items()
            for robots in self.robots
            for strategy in self.strategies
        ]


def chosen_strategies(words: str) -> tuple[str, ...]:
    """Strategies from names with commas between them; `all` = every one.

    Raises:
        SettingError: None has such a name.
    """
    names = list(STRATEGIES) if words == "all" else words.split(",")
    for name in names:
        make_strategy(name)
    return tuple(dict.fromkeys([BASELINE, *map(resolved, names)]))


def chosen_scenarios(
    words: str, world_scenario: str | None, time_limit_s: float | None
) -> dict[str, Scenario]:
    """Scenarios from names and paths of world files with commas between them.

    Args:
        words: Names and paths.
        world_scenario: Name of the scenario that gives robots, sensors and voxel size for the files; None =
            `office` for plans, `room` for other worlds.
        time_limit_s: Of all missions; None = those of the scenarios.

    Returns:
        Name → scenario, scored, one robot; the name of a file is that of its scenario, without suffix.

    Raises:
        SettingError: A name is unknown or given twice, or a file cannot be used.
    """
    chosen: dict[str, Scenario] = {}
    for word in words.split(","):
        if word in SCENARIOS:
            name, scenario = word, SCENARIOS[word]
        else:
            name, scenario = Path(word).stem, _file_scenario(word, world_scenario)
        if name in chosen:
            raise SettingError("scenarios", words, f"each name once, not {name} twice")
        settings = {"track_truth": True, "robots": 1}
        if time_limit_s is not None:
            settings["time_limit_s"] = time_limit_s
        scenario = with_settings(scenario, settings)
        env = EntropyExploreEnv(scripted(scenario))  # a file that cannot be used is refused here
        chosen[name] = dataclasses.replace(scenario, grid=env.scenario.grid)
    return chosen


def _file_scenario(word: str, world_scenario: str | None) -> Scenario:
    path = Path(word)
    if not path.is_file():
        raise SettingError("scenarios", word, "names out of " + ", ".join(SCENARIOS) + ", or world files")
    base = find_scenario(world_scenario or ("office" if is_plan(path) else "room"))
    return dataclasses.replace(base, name=path.stem, world=word)
