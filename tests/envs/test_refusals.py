"""What cannot be had is refused with a named error, in one line, before anything changes."""

from __future__ import annotations

import math
import pickle
from typing import Any

import pytest

from entropy_explore_env import CallOrderError, SettingError, WorldError, parallel_env
from entropy_explore_env.envs.conformance import require_same, snapshot

BOX = "box-7x11x5"
BOX_VOXELS = 7 * 11 * 5


@pytest.mark.parametrize("seed", [-1, 0.5, "1", True, [1], math.nan])
def test_bad_seeds_are_refused_and_change_nothing(seed: Any) -> None:
    team = parallel_env(BOX)
    team.reset(seed=0)
    before = snapshot(team)
    with pytest.raises(SettingError, match="seed"):
        team.reset(seed=seed)
    require_same("bad seed", before, snapshot(team))


@pytest.mark.parametrize(
    ("settings", "field"),
    [
        ({"robot": {"max_speed_m_s": 0.0}}, "Robot.max_speed_m_s"),
        ({"robot": {"speed": 1.0}}, "Robot.speed"),
        ({"robots": 0}, "Scenario.robots"),
        ({"robots": 2.0}, "Scenario.robots"),
        ({"robots": True}, "Scenario.robots"),
        ({"burst": 3}, "Scenario.burst"),
        ({"channel": {"burst": -1}}, "Channel.burst"),
        ({"channel": {"loss_probability": math.nan}}, "Channel.loss_probability"),
        ({"channel": 3}, "channel"),
        ({"decision_period_s": 0.0}, "Scenario.decision_period_s"),
        ({"decision_period_s": math.inf}, "Scenario.decision_period_s"),
        ({"max_cycles": 0}, "Ending.max_cycles"),
        ({"time_limit_s": -1.0}, "Ending.time_limit_s"),
        ({"reward": {"kind": "none"}}, "Reward.kind"),
        ({"observation": {"flat": 1}}, "Observation.flat"),
        ({"observation": {"patch_shape": (4, 5, 5)}}, "Observation.patch_shape"),
        ({"action": {"kind": "discrete"}, "robot": {"reach_m": 0.1}}, "Robot.reach_m"),
        ({"action": {"kind": "discrete"}, "robot": {"reach_m": math.inf}}, "Action.kind"),
        ({"world": "nowhere"}, "Scenario.world"),
        ({"world": "nowhere.bt"}, "nowhere.bt"),
        ({"render_mode": "ansi"}, "render_mode"),
        ({"ending": 5, "max_cycles": 3}, "ending"),
    ],
)
def test_bad_settings_are_named_with_their_value_and_what_is_allowed(
    settings: dict[str, Any], field: str
) -> None:
    with pytest.raises(SettingError) as caught:
        parallel_env(BOX, **settings)
    assert field in str(caught.value)
    assert repr(caught.value.value) in str(caught.value) and caught.value.allowed in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("scenario", ["box", "", None, 3, ["room"]])
def test_unknown_scenarios_are_refused_with_the_known_names(scenario: Any) -> None:
    with pytest.raises(SettingError, match="room, room-furnished, box-7x11x5"):
        parallel_env(scenario)


def test_errors_survive_the_way_back_from_a_worker() -> None:
    with pytest.raises(SettingError) as caught:
        parallel_env(BOX, robots=0)
    again = pickle.loads(pickle.dumps(caught.value))
    assert type(again) is SettingError and str(again) == str(caught.value)


def test_too_many_robots_are_refused_before_anything_changes() -> None:
    """Balls of 2 m in a box of 3.5 × 5.5 × 2.5 m: one finds room, twelve do not."""
    assert len(parallel_env(BOX, robots=1, robot={"body_radius_m": 1.0}).reset(seed=0)[0]) == 1
    for settings in ({"robots": 12, "robot": {"body_radius_m": 1.0}}, {"robots": BOX_VOXELS + 1}):
        team = parallel_env(BOX, **settings)
        before = snapshot(team)
        with pytest.raises(WorldError, match="robots") as caught:
            team.reset(seed=0)
        assert caught.value.value == settings["robots"]
        require_same("refused reset", before, snapshot(team))
        assert team.agents == []
        with pytest.raises(CallOrderError):
            team.step({})


def test_a_body_larger_than_the_world_is_refused() -> None:
    with pytest.raises(WorldError, match="body"):
        parallel_env(BOX, robots=1, robot={"body_radius_m": 2.0}).reset(seed=0)


def test_a_strategy_has_no_random_stream_before_the_first_reset() -> None:
    team = parallel_env(BOX)
    with pytest.raises(CallOrderError, match="strategy_generator before reset"):
        team.strategy_generator()
    team.reset(seed=0)
    team.strategy_generator()


@pytest.mark.parametrize("value", [2, "1", True, 1])
def test_only_what_checkers_send_may_be_given_for_nothing(value: Any) -> None:
    team = parallel_env(BOX)
    if value == 1 and value is not True:
        team.reset(seed=0, options={"options": value})
        return
    with pytest.raises(SettingError, match="options = 'options': expected only starts, world"):
        team.reset(seed=0, options={"options": value})


def test_values_that_cannot_be_shown_are_refused_all_the_same() -> None:
    with pytest.raises(SettingError, match=r"Scenario.robots = <int>: expected a whole number"):
        parallel_env(BOX, robots=10**5000)


@pytest.mark.parametrize(
    ("asked", "meant"),
    [
        ({"scenario": "ofice"}, "office"),
        ({"scenario": "room-furnishd"}, "room-furnished"),
        ({"robts": 3}, "robots"),
        ({"max_cyles": 3}, "max_cycles"),
        ({"reach_m": 3.0}, "robot={'reach_m': …}"),
        ({"max_range_m": 3.0}, "sensor={'max_range_m': …}"),
        ({"channel": {"brust": 3}}, "burst"),
        ({"world": "furnishd"}, "furnished"),
        ({"world": {"path": "x.npz", "hight_m": 3.0}}, "height_m"),
        ({"split": "tests"}, "test"),
        ({"robot": {"motion": "planr"}}, "planar"),
        ({"robot": {"redecide": "on_scans"}}, "on_scan"),
        ({"action": {"kind": "discret"}}, "discrete"),
        ({"render_mode": "rgb_aray"}, "rgb_array"),
        ({"scenario": "xyz"}, None),
        ({"split": "xyz"}, None),
        ({"split": 3}, None),
        ({"render_mode": "xyz"}, None),
        ({"xyz": 3}, None),
        ({"scenario": ["ofice"]}, None),
    ],
)
def test_words_that_are_nearly_right_are_answered_with_the_right_one(asked: Any, meant: str | None) -> None:
    with pytest.raises(SettingError) as caught:
        parallel_env(**{"scenario": BOX, **asked})
    assert str(caught.value).endswith(f"; did you mean {meant}?") == (meant is not None)
    assert meant is not None or "did you mean" not in str(caught.value)


def test_an_option_of_a_reset_that_is_nearly_right_is_answered_with_the_right_one() -> None:
    with pytest.raises(SettingError, match="did you mean starts"):
        parallel_env(BOX).reset(seed=0, options={"start": None})
