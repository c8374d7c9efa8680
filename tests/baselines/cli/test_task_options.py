"""The task on a command line: files of settings, several worlds, kinds of robots, starts of every mission."""

from __future__ import annotations

import json

import numpy as np
import pytest
from PIL import Image

from baselines.cli.task_options import TaskOptions, base_task, tasked
from baselines.experiments.mission import Surroundings, run_mission, scripted_env
from baselines.strategies import make_strategy
from entropy_explore_env.errors import SettingError
from entropy_explore_env.scenario import with_settings
from entropy_explore_env.scenarios import BOX, find_scenario
from entropy_explore_env.settings_json import settings_of


@pytest.fixture
def plans(tmp_path):
    """Two plans of one name and different sizes, in folders of their own."""
    paths = []
    for name, shape in (("a", (30, 44)), ("b", (36, 40))):
        pixels = np.full(shape, 254, np.uint8)
        pixels[10:20, 15:18] = 0
        (tmp_path / name).mkdir()
        paths.append(tmp_path / name / "plan.png")
        Image.fromarray(pixels).save(paths[-1])
    return [str(path) for path in paths]


def options(scenario, **changes):
    task = base_task(scenario)
    return TaskOptions(**{**vars(task.defaults()), **changes})


def test_a_file_of_settings_changes_the_named_scenario_or_stands_for_itself(tmp_path):
    part, whole, mission = (tmp_path / name for name in ("part.json", "whole.json", "mission.json"))
    part.write_text(json.dumps({"robot": {"reach_m": 0.75}, "decision_period_s": 2.0}))
    task = base_task("box-7x11x5", str(part))
    assert task.scenario == with_settings(BOX, {"robot": {"reach_m": 0.75}, "decision_period_s": 2.0})
    assert task.decision_period_s == 2.0
    changed = with_settings(BOX, {"name": "mine", "robots": 4, "decision_period_s": None})
    whole.write_text(json.dumps(settings_of(changed)))
    mission.write_text(json.dumps({"settings": settings_of(changed), "finished": True}))
    for file in (whole, mission):
        assert base_task("room", str(file)).scenario == changed
    assert base_task("box-7x11x5") == (BOX, None)  # a named scenario's own period is that of its environment


@pytest.mark.parametrize("text", ["", "[]", "{", '{"robot": {"wings": 2}}', '{"robot": {"reach_m": -1}}'])
def test_a_file_that_holds_no_settings_is_named(text, tmp_path):
    (tmp_path / "s.json").write_text(text)
    with pytest.raises(SettingError):
        base_task("room", str(tmp_path / "s.json"))
    with pytest.raises(SettingError, match="settings = "):
        base_task("room", str(tmp_path / "nowhere.json"))


def test_nothing_given_is_the_scenario_itself():
    scenario, surroundings = tasked(BOX, options("box-7x11x5"))
    assert scenario == with_settings(BOX, {"decision_period_s": None}) and surroundings == Surroundings()


def test_several_plans_of_one_name_are_dealt_in_turn_on_one_grid(plans):
    office = find_scenario("office")
    scenario, surroundings = tasked(office, options("office", world=tuple(plans), time_limit_s=5.0), robots=1)
    assert [str(file) for file in surroundings.files()] == plans
    env = scripted_env(scenario, surroundings)
    names, walls = [], []
    for seed in (0, 1, 2):
        run_mission(env, make_strategy("random"), seed)
        world = env.missions.worlds[0]
        names.append(world.name)
        walls.append(int(world.occupied.sum()))
        assert env.scenario.ending.time_limit_s == 5.0
    assert names == ["a/plan", "b/plan", "a/plan"]
    # pixels of 0.05 m as voxels of 0.1 m: 22 × 15 and 20 × 18 of them, together in 22 × 18
    assert env.scenario.grid.shape == (22, 18, 1)
    block = walls[0] - 22 * 3
    assert 0 < block < 20 and walls[1] == 2 * 18 + block


def test_kinds_and_starts_are_given_as_json_or_in_files(tmp_path):
    kinds = [{"robot": {"reach_m": 2.0}, "sensor": {"max_range_m": "inf"}}]
    (tmp_path / "kinds.json").write_text(json.dumps(kinds))
    starts = [[1.0, 1.0, 1.0, 0.0, 0.0], [2.0, 4.0, 1.0, 0.5, 0.0]]
    for given in (json.dumps(kinds), str(tmp_path / "kinds.json")):
        changes = {"extra_kinds": given, "starts": json.dumps(starts), "decision_period_s": 0.5}
        scenario, surroundings = tasked(BOX, options("box-7x11x5", **changes))
        assert scenario.extra_kinds[0].robot.reach_m == 2.0
        env = scripted_env(scenario, surroundings)
        for seed in (3, 4):  # of every mission
            env.reset(seed=seed)
            assert [env.view(agent).pose.tolist() for agent in env.agents] == starts
        env.step({agent: np.zeros(5, np.float32) for agent in env.agents})
        assert env.missions.state.missions[0]["time_s"] == 0.5
    for words in ("{}", "[1]", "nowhere.json", '[{"wings": 1}]'):
        with pytest.raises(SettingError):
            tasked(BOX, options("box-7x11x5", extra_kinds=words))
