"""The task on a command line: files of settings, several worlds, kinds of robots, starts of every mission."""

from __future__ import annotations

import dataclasses
import importlib
import json

import numpy as np
import pytest
from PIL import Image

from baselines import benchmark, run
from baselines.cli.arguments import given_values, parse, run_command, told_command
from baselines.cli.options import options_of
from baselines.cli.task_options import TaskOptions, base_task, options_for, settled, tasked
from baselines.experiments.mission import Surroundings, run_mission, scripted_env
from baselines.strategies import make_strategy
from entropy_explore_env.command import BAD_INPUT
from entropy_explore_env.errors import SettingError
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.json import settings_of
from entropy_explore_env.settings.scenarios import BOX, find_scenario


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


def test_options_are_settled_so_that_they_are_the_same_everywhere(plans, tmp_path, monkeypatch):
    kinds, settings = tmp_path / "kinds.json", tmp_path / "settings.json"
    kinds.write_text('[{"robot": {"reach_m": 2.0}}]')
    settings.write_text('{"robot": {"reach_m": 0.75}}')
    monkeypatch.chdir(tmp_path)
    given = options("office", world=("a/plan.png", "jacksboro"), extra_kinds="kinds.json")
    there = settled(dataclasses.replace(given, settings="settings.json"))
    assert there.world == (plans[0], "jacksboro")
    monkeypatch.chdir("/")
    kinds.unlink()
    settings.unlink()
    assert there.extra_kinds == '[{"robot": {"reach_m": 2.0}}]'
    assert base_task("office", there.settings).scenario.robot.reach_m == 0.75
    assert settled(there) == there


def test_what_is_given_changes_each_scenario_and_the_rest_is_its_own(plans):
    words = "--robot.redecide on_scan --channel.no-announcements --ending.time-limit-s=0.1 --split test"
    words += " --robot.localization.yaw-rad-per-sqrt-m 0.01 --fiducials.positions-m 1 2 0.5 3 2 0.5"
    words = [*words.split(), "--world", *plans, "--height-m", "2.5"]
    for name in ("office", "cave"):
        own = base_task(name).defaults()
        given = options_for(base_task(name), given_values(TaskOptions, words))
        assert given.robot == dataclasses.replace(
            own.robot, redecide="on_scan", localization=given.robot.localization
        )
        assert given.robot.localization.yaw_rad_per_sqrt_m == 0.01
        assert given.channel == dataclasses.replace(own.channel, announcements=False)
        assert given.ending == dataclasses.replace(own.ending, time_limit_s=0.1)
        assert (given.split, given.world, given.world_file.height_m) == ("test", tuple(plans), 2.5)
        assert given.sensor == own.sensor and given.start_radius_m == own.start_radius_m
    assert options_for(base_task("office"), {}) == base_task("office").defaults()


def test_an_option_that_is_given_as_the_default_counts():
    words = ["--robot.reach-m", "0.5"]
    assert parse(TaskOptions, words) == TaskOptions()  # the room's
    given = options_for(base_task("office"), given_values(TaskOptions, words))
    assert given.robot.reach_m == 0.5 != base_task("office").scenario.robot.reach_m


def test_a_page_tells_the_words_without_folders(plans, tmp_path):
    words = ["room", "--world", *plans, "--out", str(tmp_path), "--json", "--settings", '{"robots": 2}']
    told = "python -m a room --world a/plan.png b/plan.png --settings '{\"robots\": 2}'"
    assert told_command("python -m a", words, ("--out", "--json")) == told


def flags_of(command):
    """Return flag → the kind of its values, of a command's arguments."""
    args = importlib.import_module(command).Args
    return {option.flag: option.kind for option in options_of(args, args())}


TASK = {option.flag: option.kind for option in options_of(TaskOptions, TaskOptions())}


@pytest.mark.parametrize(
    "command",
    ["baselines.run", "baselines.benchmark", "baselines.episodes", "training.ppo", "training.evaluate"],
)
def test_every_command_takes_every_flag_of_a_task_with_the_same_values(command):
    assert {"--settings", "--world", "--split", "--starts", "--extra-kinds", "--robot.reach-m"} <= set(TASK)
    flags = flags_of(command)
    assert {name: flags.get(name) for name in TASK} == TASK
    assert "--robots" in flags


def test_a_replay_takes_what_a_record_leaves_open():
    """A record holds its scenario: where the world's file lies now, and how much reading it may take."""
    assert set(TASK) & set(flags_of("baselines.replay")) == {"--read-memory-mib"}


@pytest.mark.parametrize(
    ("command", "words"),
    [
        *((f"baselines.{name}", []) for name in ("run", "benchmark", "episodes", "replay", "films")),
        *((f"training.{name}", []) for name in ("ppo", "evaluate", "search")),
    ],
)
def test_the_help_of_a_command_fits_a_screen_and_names_what_there_is(command, words, monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "80")
    module = importlib.import_module(command)
    with pytest.raises(SystemExit):
        module.main([*words, "--help"])
    said = capsys.readouterr().out
    assert len(said.splitlines()) <= 70 and "\n\n\n" not in said
    names = {option.name for option in options_of(module.Args, module.Args())}
    assert set(getattr(module.Args, "usual", ())) <= names


@pytest.mark.parametrize("option", ["--starts", "--settings", "--extra-kinds", "--world"])
@pytest.mark.parametrize("command", [run.main, benchmark.main])
def test_a_file_below_a_home_folder_that_is_not_there_is_an_error_in_one_line(option, command, capsys):
    assert run_command(command, [option, "~nobody-of-this-name/x.json"]) == BAD_INPUT
    said = capsys.readouterr().err
    assert "~nobody-of-this-name/x.json" in said and len(said.splitlines()) == 1
