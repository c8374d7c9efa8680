"""The suite of C²-Explorer's buildings: teams start where their authors' do, and missions run."""

from __future__ import annotations

import math

import numpy as np
import pytest

from baselines.experiments.mission import run_mission, scripted_env
from baselines.strategies import make_strategy
from baselines.suites import c2, find_suite
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.worlds.public.table import PUBLIC
from tests.public_worlds import needs_public_worlds


def test_every_team_has_both_radios_and_starts_in_the_building():
    tasks = find_suite("c2").tasks
    assert len(tasks) == 2 * (4 + 3)
    for task in tasks:
        (place,) = task.places
        world, scenario = PUBLIC[place.scenario.world], place.scenario
        starts = place.surroundings.settings()["every_reset"]["starts"]
        assert scenario.grid == world.grid and len(starts) == scenario.robots
        assert scenario.channel.range_m == (5.0 if "radio" in task.name else math.inf)
        for start in starts:
            world.grid.voxel_of(np.array(start[:3]))
    assert {task.scenario.robots for task in tasks if "radio" in task.name} == {2, 3, 4}


@pytest.mark.parametrize("world", c2.STARTS_M)
def test_four_drones_start_where_the_launch_files_put_them_and_fly(world):
    needs_public_worlds(world)
    task = next(each for each in find_suite("c2").tasks if each.name == f"{world}, 4 robots")
    (place,) = task.places
    scenario = with_settings(place.scenario, {"ending": {"time_limit_s": 4.0}})
    env, poses = scripted_env(scenario, place.surroundings), []

    def note(env):
        poses.append(env.missions.state.robots[0]["origin"].copy())

    run_mission(env, make_strategy("nearest-frontier"), 0, note)
    assert np.allclose(poses[0], [[*start, 0.0, 0.0] for start in c2.STARTS_M[world]])
    moved_m = np.linalg.norm(poses[-1][:, :3] - poses[0][:, :3], axis=1)
    assert (moved_m > 0.5).any() and env.missions.state.missions[0]["explored_visible"] > 10_000
