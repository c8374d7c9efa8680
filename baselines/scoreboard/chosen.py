"""What a user chooses: strategies by name, and scenarios of one's own in place of a suite."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path

from baselines.experiments.mission import scripted
from baselines.scoreboard.results import BASELINE, REFERENCES
from baselines.scoreboard.suites import Place, Task, team_name
from baselines.strategies import STRATEGIES, make_strategy, resolved
from baselines.world_sweep import is_plan
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.errors import SettingError
from entropy_explore_env.scenario import Scenario, with_settings
from entropy_explore_env.scenarios import SCENARIOS, find_scenario


def chosen_strategies(words: str, suite: bool) -> tuple[str, ...]:
    """Strategies from names with commas between them; `all` = every one.

    Args:
        words: Names.
        suite: Of a suite, whose references are added; else the random walk is.

    Raises:
        SettingError: None has such a name.
    """
    names = list(STRATEGIES) if words == "all" else words.split(",")
    for name in names:
        make_strategy(name)
    added = [name for name in REFERENCES if name in STRATEGIES] if suite else [BASELINE]
    return tuple(dict.fromkeys([*added, *map(resolved, names)]))


def own_tasks(scenarios: Mapping[str, Scenario], robots: Sequence[int], missions: int) -> tuple[Task, ...]:
    """A task for each scenario and team size, in worlds of the scenario's own split."""
    return tuple(
        Task(team_name(name, team), (Place(name, with_settings(scenario, {"robots": team}), missions),))
        for name, scenario in scenarios.items()
        for team in robots
    )


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
