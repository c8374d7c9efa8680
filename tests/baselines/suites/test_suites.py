"""The suites: worlds, starts and seeds that stay as they are."""

from __future__ import annotations

import hashlib

import numpy as np
import pytest

from baselines.experiments.rows import trial_key
from baselines.experiments.trials import How
from baselines.suites import SCOREBOARD, SUITES, find_suite, scoreboard
from baselines.suites.page import about
from baselines.suites.results import run_suite
from entropy_explore_env import load_world
from entropy_explore_env.errors import SettingError, WorldError
from entropy_explore_env.settings.scenarios import SCENARIOS
from entropy_explore_env.worlds.files.process import kept_reader
from entropy_explore_env.worlds.public import fetching
from entropy_explore_env.worlds.public.fetching import FOLDER_VARIABLE
from entropy_explore_env.worlds.public.table import PUBLIC
from tests.public_worlds import needs_public_worlds

TEAMS = ("random", "gradient")
PINNED = {
    "plans": (8, "7f0af6d10108c637"),
    "volumes": (14, "f93b5b336574af0c"),
    "teams": (43, "6bc0fc634ee10a7c"),
    "others": (9, "3bc51248fe3eb894"),
    "c2": (14, "76841d4064976c42"),
}
"""Suite → how many tasks it has, and a digest of their names."""


@pytest.mark.parametrize("name", (*SCOREBOARD, "c2"))
def test_a_suite_is_pinned(name):
    suite = find_suite(name, False, TEAMS)
    names = [task.name for task in suite.tasks]
    assert (len(names), hashlib.sha256("\n".join(names).encode()).hexdigest()[:16]) == PINNED[name]
    for task in suite.tasks:
        assert task.missions == (100 if task.name == "dungeons" else 10 if name == "c2" else 30)
        assert task.scenario.track_truth
        assert task.scenario.split == "test" or task.name == "dungeons"  # which has no split
    ids = [cell.id for cell in suite.cells]
    assert len(set(ids)) == len(ids) and all("," not in each and " " not in each for each in ids)


def test_every_named_scenario_stands_in_a_suite():
    there = {
        task.name.partition(",")[0] for name in SCOREBOARD for task in find_suite(name, False, TEAMS).tasks
    }
    assert set(SCENARIOS) <= there


def test_the_worlds_are_those_that_they_were():
    """Cells of all worlds of others in which rows were made, when their files lay in this repository."""
    dungeons = [f"dungeon-{number}" for number in range(1, 101)]
    names = sorted(["depot", "geb079", "warehouse", "willow", *dungeons])
    needs_public_worlds(*names)
    digest = hashlib.sha256()
    with kept_reader():
        for name in names:
            world = load_world(name)
            assert world.grid == PUBLIC[name].grid
            digest.update(repr((name, world.grid)).encode() + np.packbits(world.occupied).tobytes())
    assert digest.hexdigest() == "cb8853ef41b7ac49eabc9c1e067e05ed843a6a2670088cae44dc3d01558d5f9d"


def test_rows_hold_a_digest_of_every_world_whose_file_once_lay_here():
    """Keys of rows are as they were, wherever the files of worlds lie now."""
    trials = find_suite("plans", False, ("random",)).trials
    worlds = {str(trial.settings["scenario"]["world"]) for trial in trials}
    assert len(worlds) == 100 + 3 + 4
    keys = "\n".join(trial_key(trial.cell, trial.seed, trial.settings) for trial in trials)
    assert hashlib.sha256(keys.encode()).hexdigest()[:16] == "e21d79a253e93460"


def test_plans_replan_at_every_scan_until_everything_is_seen():
    for task in find_suite("plans", False, TEAMS).tasks:
        scenario = task.scenario
        assert (scenario.robot.redecide, scenario.sensor.scan_every_m) == ("on_scan", scoreboard.SCAN_EVERY_M)
        assert (scenario.sensor.rays, scenario.sensor.max_range_m) == (720, 8.0)
        if task.name == "dungeons":
            assert scenario.ending.unseen_free_voxels == scoreboard.DUNGEON_UNSEEN == 250
            assert scenario.sensor.max_range_m == 80 * scenario.grid.voxel_size_m
            assert scenario.robot.body_radius_m == 0.0
        else:
            assert scenario.ending.seen_share == 1.0


def test_tables_say_with_what_plans_are_scanned():
    plan, *_ = find_suite("plans", True, TEAMS).tasks
    assert "1 ground robot that scans 720 rays of 8 m every 0.5 m, time limit" in about(plan)
    _, team, *_ = find_suite("volumes", True, TEAMS).tasks
    assert "3 flying robots, time limit" in about(team) and about(team).startswith("2 starts, world")
    others = {task.name: about(task) for task in find_suite("others", False, TEAMS).tasks}
    assert ", 1 ground robot, time limit" in others["cliff, 1 robot"]  # which looks down, and tilts
    assert ", 3 ground and flying robots, time limit" in others["office-mixed, 3 robots"]


def test_mission_k_of_every_task_comes_before_any_mission_k_plus_1():
    """Each dungeon is a cell of its own; the others hold thirty starts."""
    trials = find_suite("plans", False, TEAMS).trials
    cells = {trial.cell for trial in trials[: 2 * PINNED["plans"][0]]}
    assert {cell.split("/")[0] for cell in cells} == {
        task.folder for task in find_suite("plans", False, TEAMS).tasks
    }
    assert [trial.seed for trial in trials if trial.cell == "office/random"] == list(range(30))
    dungeons = [trial.cell for trial in trials if trial.cell.startswith("dungeons/")]
    assert dungeons[:3] == ["dungeons/1/random", "dungeons/1/gradient", "dungeons/2/random"]
    assert len(trials) == 2 * (100 + 7 * 30)


def test_dungeons_start_on_their_mark():
    (dungeons,) = [task for task in find_suite("plans", False, TEAMS).tasks if task.name == "dungeons"]
    assert len({place.scenario.world for place in dungeons.places}) == len(dungeons.places) == 100
    some = dungeons.places[:: len(dungeons.places) // 4]
    needs_public_worlds(*(place.scenario.world for place in some))
    for place in some:
        world, start = load_world(place.scenario.world), place.start
        assert start is not None
        x, y, z = world.grid.voxel_of(np.asarray(start[:3]))
        assert not world.occupied[x, y, z]


def test_unknown_suites_and_missing_worlds_are_named(monkeypatch, tmp_path):
    with pytest.raises(SettingError, match=r"suite = .plan.: expected one of plans, volumes, teams"):
        find_suite("plan", False, TEAMS)
    monkeypatch.setenv(FOLDER_VARIABLE, str(tmp_path / "worlds"))
    monkeypatch.setattr(fetching, "HOST", "http://127.0.0.1:9")  # a port that no server listens on
    with pytest.raises(WorldError, match=r"world = 'dungeon-1': expected img_1.png, which could not be"):
        run_suite(find_suite("plans", True, TEAMS), tmp_path / "rows.jsonl", How())
    assert not (tmp_path / "rows.jsonl").exists()


@pytest.mark.parametrize("name", SUITES)
def test_a_quick_suite_is_a_part_of_the_whole(name):
    whole, quick = (find_suite(name, few) for few in (False, True))
    trials = {(trial.cell, trial.seed, str(trial.settings)) for trial in whole.trials}
    assert {(trial.cell, trial.seed, str(trial.settings)) for trial in quick.trials} < trials
