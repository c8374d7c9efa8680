"""What is learned in: a named scenario and a team, written NAME:ROBOTS, with candidates as actions."""

from __future__ import annotations

from entropy_explore_env.errors import SettingError
from entropy_explore_env.scenario import Scenario, with_settings
from entropy_explore_env.scenarios import find_scenario
from training.ppo_options import OWN, candidate_form


def task_of(name: str, candidates: int) -> Scenario:
    """The scenario NAME:ROBOTS, with candidates as actions.

    Raises:
        SettingError: There is no such scenario, or no such team.
    """
    scenario, _, robots = name.partition(":")
    if not robots.isdecimal() or int(robots) < 1:
        raise SettingError("tasks", name, "NAME:ROBOTS, a named scenario and a number of robots")
    changes = {"robots": int(robots), "decision_period_s": None, **OWN, **candidate_form(candidates)}
    return with_settings(find_scenario(scenario), changes)
