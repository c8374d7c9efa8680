"""What cannot be had is refused with a named error, in one line, before anything changes."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from entropy_explore_env import (
    SCENARIOS,
    CallOrderError,
    EntropyExploreVectorEnv,
    SettingError,
    SingleRobotEnv,
    World,
    WorldError,
    env,
    parallel_env,
    save_world,
)
from entropy_explore_env.envs.robot_vec_env import RobotVecEnv
from entropy_explore_env.reports.state_digest import state_digest

BOX = "box-7x11x5"


class Pairs(Mapping):
    """A mapping whose keys need no hash."""

    def __init__(self, *pairs: tuple[Any, Any]) -> None:
        self.pairs = pairs

    def __len__(self) -> int:
        return len(self.pairs)

    def __iter__(self):
        return (key for key, _ in self.pairs)

    def __getitem__(self, key: Any) -> Any:
        return next(value for one, value in self.pairs if one is key)


@pytest.mark.parametrize(
    ("settings", "field"),
    [
        ({"burst": 3}, "Scenario.burst"),
        ({"time_limit_s": -1.0}, "Ending.time_limit_s"),
        ({"world": "nowhere"}, "Scenario.world"),
        ({"world": "nowhere.bt"}, "nowhere.bt"),
        ({"render_mode": "ansi"}, "render_mode"),
        ({"channel": {1: 2}}, "Channel, field 1"),
        ({"channel": {("a", "b"): 2}}, "Channel, field ('a', 'b')"),
        ({"channel": {"signal": {None: 2}}}, "Signal, field None"),
        ({"channel": Pairs(([1], 2))}, "Channel, field [1]"),
        ({"channel": {"signal": Pairs(({}, 2))}}, "Signal, field {}"),
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
        ({"channel": {"loss": 0.1}}, "loss_probability"),
        ({"sensor": {"range_m": 3.0}}, "min_range_m or max_range_m"),
        ({"voxel_size": 0.1}, "grid={'voxel_size_m': …}"),
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


@pytest.mark.parametrize(
    "seeds", [[1], [[1], [2, 3]], np.zeros((2, 1), int), np.array(3), b"ab", [1, 2.0], {1: 2}]
)
def test_seeds_of_rows_are_whole_numbers_one_a_mission(seeds: Any) -> None:
    with pytest.raises(SettingError, match=r"seeds = .*2 whole numbers"):
        RobotVecEnv(BOX, 2, seeds=seeds)
    RobotVecEnv(BOX, 2, seeds=np.array([3, 4]))


@pytest.mark.parametrize(
    ("make", "call", "given"),
    [
        *((parallel_env, call, ()) for call in ("deciding_agents", "render", "state", "strategy_generator")),
        *((make, "view", ("robot_0",)) for make in (parallel_env, env)),
        *((env, call, ()) for call in ("last", "state")),
        (env, "observe", ("robot_0",)),
        (env, "step", (None,)),
        (SingleRobotEnv, "view", ()),
        (SingleRobotEnv, "step", (np.zeros(5, np.float32),)),
    ],
)
def test_calls_before_a_reset_are_refused_by_name(make: Any, call: str, given: tuple[Any, ...]) -> None:
    with pytest.raises(CallOrderError, match=f"{call} before reset"):
        getattr(make(BOX, render_mode="rgb_array"), call)(*given)


def test_a_margin_that_spans_millions_of_voxels_is_refused_at_once() -> None:
    drifting = {"localization": {"margin_m": 20.0, "xy_m_per_sqrt_m": 0.02}}
    with pytest.raises(SettingError, match=r"localization.margin_m, in voxel edges = 81.*2,097,152 voxels"):
        parallel_env("office-3d", robot=drifting)


def test_within_a_step_nothing_starts_in_a_file_that_has_gone(tmp_path) -> None:
    file, same_step = tmp_path / "hall.npz", AutoresetMode.SAME_STEP
    save_world(World(SCENARIOS[BOX].grid, np.zeros((7, 11, 5), bool), "hall"), file)
    rows = EntropyExploreVectorEnv(BOX, 2, world=str(file), autoreset_mode=same_step, max_cycles=2)
    rows.reset(seed=0)
    rows.step(rows.action_space.sample())
    before, kept = [state_digest(rows.missions, mission) for mission in range(2)], file.read_bytes()
    file.unlink()
    with pytest.raises(WorldError, match=r"hall\.npz"):
        rows.step(rows.action_space.sample())
    assert [state_digest(rows.missions, mission) for mission in range(2)] == before
    file.write_bytes(kept)
    assert rows.step(rows.action_space.sample())[3].all()
