"""Scenarios with some settings changed: what is nested, short or unknown."""

import dataclasses
import math

import pytest

from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.channel import Channel
from entropy_explore_env.settings.ending import Ending
from entropy_explore_env.settings.robot import Robot
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.settings.scenarios import BOX
from tests.settings.refusals import refusal

NAN = math.nan


def test_nested_settings():
    changed = with_settings(BOX, {"robots": 4, "channel": {"burst": 3, "delay_s": 0.5}, "robot": Robot()})
    assert (changed.robots, changed.channel.burst, changed.channel.delay_s) == (4, 3, 0.5)
    assert changed.channel.i_min_bits == BOX.channel.i_min_bits  # what is not named stays
    assert changed.robot == Robot() != BOX.robot
    assert BOX.channel.burst == 8
    assert with_settings(BOX, {}) == BOX
    assert with_settings(BOX, {"grid": {"voxel_size_m": 0.25}}).grid.shape == BOX.grid.shape


def test_short_names_of_the_ending():
    for ending in ({"termination": "all"}, Ending(termination="all")):
        changed = with_settings(BOX, {"ending": ending, "max_cycles": 7, "time_limit_s": 60.0}).ending
        assert (changed.termination, changed.max_cycles, changed.time_limit_s) == ("all", 7, 60.0)
    assert with_settings(BOX, {"max_cycles": 7}).ending.sigma_end == BOX.ending.sigma_end
    assert refusal(lambda: with_settings(BOX, {"max_cycles": 0})).field == "Ending.max_cycles"


@pytest.mark.parametrize(
    ("settings", "field"),
    [
        ({"robotz": 3}, "Scenario.robotz"),
        ({"channel": {"bursts": 3}}, "Channel.bursts"),
        ({"channel.burst": 3}, "Scenario.channel.burst"),
        ({"robot": {"max_cycles": 3}}, "Robot.max_cycles"),
        ({"channel": {"burst": NAN}}, "Channel.burst"),
        ({"channel": 3}, "Scenario.channel"),
        ({"grid": {"shape": [7, 11, 5]}}, "Grid.shape"),
        ({"agents": ()}, "Scenario.agents"),
        ({"ending": 5, "max_cycles": 3}, "Scenario.ending"),
    ],
)
def test_unknown_names_and_nested_values_that_are_not_allowed(settings, field):
    assert refusal(lambda: with_settings(BOX, settings)).field == field


def test_an_unknown_name_is_answered_with_the_names_that_there_are():
    for settings, part, near in (
        ({"robotz": 3}, Scenario, "robots"),
        ({"robotz": {}}, Scenario, "robot"),
        ({"channel": {"bursts": 3}}, Channel, "burst"),
    ):
        allowed = refusal(lambda changes=settings: with_settings(BOX, changes)).allowed
        names = [field.name for field in dataclasses.fields(part)]
        assert allowed == f"one of the fields {', '.join(names)}; did you mean {near}?"
