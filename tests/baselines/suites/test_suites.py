"""The suites: worlds, starts and seeds that stay as they are."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
import pytest

from baselines.suites import SCOREBOARD, SUITES, bundled_worlds, find_suite, scoreboard
from baselines.suites.bundled_worlds import WORLDS
from baselines.suites.page import about
from entropy_explore_env import load_world
from entropy_explore_env.errors import SettingError
from entropy_explore_env.settings.scenarios import SCENARIOS

TEAMS = ("random", "gradient")
PINNED = {
    "plans": (8, "7f0af6d10108c637"),
    "volumes": (14, "f93b5b336574af0c"),
    "teams": (43, "6bc0fc634ee10a7c"),
    "others": (9, "3bc51248fe3eb894"),
}
"""Suite → how many tasks it has, and a digest of their names."""


@pytest.mark.parametrize("name", SCOREBOARD)
def test_a_suite_is_pinned(name):
    suite = find_suite(name, False, TEAMS)
    names = [task.name for task in suite.tasks]
    assert (len(names), hashlib.sha256("\n".join(names).encode()).hexdigest()[:16]) == PINNED[name]
    for task in suite.tasks:
        assert task.missions == (100 if task.name == "dungeons" else 30)
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
    digest = hashlib.sha256()
    for path in sorted(WORLDS.rglob("*.npz")):
        world = load_world(path)
        digest.update(repr((path.relative_to(WORLDS).as_posix(), world.grid)).encode())
        digest.update(np.packbits(world.occupied).tobytes())
    digest.update((WORLDS / "starts.csv").read_bytes())
    assert digest.hexdigest() == "51d9a6aa1c3dd334d6c5f6bbd321b90bb285c291445e1baeb6712078393672ac"


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
    for place in dungeons.places[:: len(dungeons.places) // 4]:
        world, start = load_world(place.scenario.world), place.start
        assert start is not None
        x, y, z = world.grid.voxel_of(np.asarray(start[:3]))
        assert not world.occupied[x, y, z]
    assert len({place.scenario.world for place in dungeons.places}) == len(dungeons.places) == 100


def test_unknown_suites_and_missing_worlds_are_named(monkeypatch):
    with pytest.raises(SettingError, match=r"suite = .plan.: expected one of plans, volumes, teams"):
        find_suite("plan", False, TEAMS)
    monkeypatch.setattr(bundled_worlds, "WORLDS", Path("/nowhere"))
    with pytest.raises(SettingError, match=r"suite world = '/nowhere/geb079.npz': expected a file that"):
        find_suite("volumes", False, TEAMS)


@pytest.mark.parametrize("name", SUITES)
def test_a_quick_suite_is_a_part_of_the_whole(name):
    whole, quick = (find_suite(name, few) for few in (False, True))
    trials = {(trial.cell, trial.seed, str(trial.settings)) for trial in whole.trials}
    assert {(trial.cell, trial.seed, str(trial.settings)) for trial in quick.trials} < trials
