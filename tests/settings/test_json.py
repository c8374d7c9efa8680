"""Settings as JSON: what comes back is what was written, to the last bit."""

import dataclasses
import json
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from entropy_explore_env.errors import SettingError
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.json import dataclass_of, scenario_of, settings_of
from entropy_explore_env.settings.robot import Robot
from entropy_explore_env.settings.robot_kind import RobotKind
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.settings.scenarios import BOX, ROOM, SCENARIOS
from entropy_explore_env.settings.sensor import RangeSensor
from tests.reference.scenes import drawn

RARE = {
    "robots": 3,
    "robot": {"localization": {"xy_m_per_sqrt_m": 0.05, "margin_m": 0.1}},
    "fiducials": {"positions_m": ((1.0, 1.0, 1.0), (0.5, 2.0, 0.25)), "range_m": 4.0},
    "faults": {
        "stop": {"at_s": 3.0, "robots": (1, 2)},
        "blind": {"mean_s": 7.5, "lasts_s": 2.0},
        "silent": {"at_s": 0.1, "mean_s": 0.2, "lasts_s": 0.3, "robots": (0,)},
        "sensor": {"lost_rays": 0.1, "range_factor": 1.02, "range_bias_m": -0.05, "robots": (2,)},
        "radio": {"garbled": 0.1, "repeated": 0.2, "late": 0.3, "late_s": 4.0, "robots": (0, 1)},
    },
    "channel": {"reach": "signal", "signal": {"exponent": 3.0, "budget_db": 55.0}},
    "ending": {"termination": "shared"},
}


@pytest.mark.parametrize("scenario", [*SCENARIOS.values(), with_settings(BOX, RARE)])
def test_scenarios_come_back_as_they_were(scenario):
    text = json.dumps(settings_of(scenario))
    back = scenario_of(json.loads(text, parse_constant=pytest.fail))
    assert back == scenario and hash(back) == hash(scenario)
    assert json.dumps(settings_of(back)) == text
    assert kinds(back) == kinds(scenario)


def through_json(scenario: Scenario) -> Scenario:
    return scenario_of(json.loads(json.dumps(settings_of(scenario))))


def kinds(settings: object) -> list:
    """Types of all settings, from the outside in: a list in place of a tuple would show."""
    if dataclasses.is_dataclass(settings):
        return [kinds(getattr(settings, field.name)) for field in dataclasses.fields(settings)]
    return [type(settings), *([kinds(each) for each in settings] if isinstance(settings, tuple) else [])]


@drawn(60)
@given(
    size=st.floats(0.02, 3e3),
    origin=st.tuples(*[st.floats(-1e9, 1e9)] * 3),
    reach=st.floats(1e-6, 1e6) | st.just(math.inf),
    limit=st.floats(1e-3, 1e9) | st.just(math.inf),
    period=st.none() | st.floats(1e-3, 1e5),
    cycles=st.none() | st.integers(1, 2**62),
)
def test_numbers_are_exact(size, origin, reach, limit, period, cycles):
    grid = Grid((7, 11, 5), size, origin)
    changes = {
        "grid": grid,
        "decision_period_s": period,
        "robot": {"reach_m": reach, "motion": "free", "redecide": max(period or 0.0, 0.01)},
        "ending": {"max_cycles": cycles, "time_limit_s": limit},
    }
    scenario = with_settings(BOX, changes)
    assert through_json(scenario) == scenario


def test_what_json_lacks_by_hand():
    settings = settings_of(ROOM)
    assert settings["sensor"]["max_range_m"] == settings["channel"]["range_m"] == "inf"
    assert settings["grid"] == {"shape": [41, 41, 17], "voxel_size_m": 0.25, "origin_m": [-0.125] * 3}
    assert settings["ending"]["max_cycles"] is None and settings["robots"] == 3


def test_a_text_that_says_inf_stays_a_text():
    scenario = dataclasses.replace(BOX, name="inf", world="inf")
    assert through_json(scenario) == scenario


def test_numbers_of_numpy_become_plain_ones_of_the_same_value():
    channel = dataclasses.replace(BOX.channel, burst=np.int64(7), i_min_bits=np.float32(0.1))
    back = through_json(dataclasses.replace(BOX, channel=channel))
    assert (type(back.channel.burst), back.channel.burst) == (int, 7)
    assert back.channel.i_min_bits == float(np.float32(0.1)) != 0.1


def test_what_is_missing_has_its_default_if_it_has_one():
    grid = {"shape": [7, 11, 5], "voxel_size_m": 0.5}
    assert scenario_of({"name": "mine", "grid": grid}) == Scenario("mine", Grid((7, 11, 5), 0.5))
    with pytest.raises(SettingError, match=r"Scenario\.grid"):
        scenario_of({"name": "mine"})


def changed(path: str, value: object) -> dict:
    settings = json.loads(json.dumps(settings_of(BOX)))
    *folders, last = path.split(".")
    inside = settings
    for folder in folders:
        inside = inside[folder]
    inside[last] = value
    return settings


@pytest.mark.parametrize(
    ("path", "value", "named"),
    [
        ("wings", 2, "Scenario.wings"),
        ("channel.wings", 2, "Channel.wings"),
        ("channel", [1, 2], "Scenario.channel"),
        ("channel", None, "Scenario.channel"),
        ("channel.burst", "8", "Channel.burst"),
        ("channel.burst", "inf", "Channel.burst"),
        ("channel.burst", {"a": 1}, "Channel.burst"),
        ("channel.loss_probability", "inf", "Channel.loss_probability"),
        ("grid.shape", [7, 11], "Grid.shape"),
        ("grid.shape", 7, "Grid.shape"),
        ("grid.shape", [7, 11, "inf"], "Grid.shape"),
        ("grid.origin_m", ["inf", 0.0, 0.0], "Grid.origin_m"),
        ("robot.reach_m", "-inf", "Robot.reach_m"),
        ("ending.max_cycles", "inf", "Ending.max_cycles"),
        ("decision_period_s", {}, "decision_period_s"),
        ("name", 3, "Scenario.name"),
    ],
)
def test_what_is_wrong_is_named(path, value, named):
    with pytest.raises(SettingError, match=named.replace(".", r"\.")):
        scenario_of(changed(path, value))


def test_any_dataclass_of_settings_comes_back():
    kind = RobotKind(Robot(reach_m=math.inf, motion="planar"), RangeSensor(field_of_view_rad=(1.5, 0.25)))
    assert dataclass_of(RobotKind, json.loads(json.dumps(settings_of(kind), allow_nan=False))) == kind
    with pytest.raises(SettingError, match=r"RobotKind\.wings"):
        dataclass_of(RobotKind, {"wings": 2})
    with pytest.raises(SettingError, match=r"RobotKind\.robt.*; did you mean robot\?"):
        dataclass_of(RobotKind, {"robt": {}})
