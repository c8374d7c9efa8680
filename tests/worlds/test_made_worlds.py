"""Which world a scenario asks for: made by a recipe, from a world number, or read from a file."""

from __future__ import annotations

import numpy as np
import pytest

from entropy_explore_env import EntropyExploreVectorEnv, parallel_env
from entropy_explore_env.errors import SettingError
from entropy_explore_env.missions.simulation import Missions
from entropy_explore_env.randomness import Stream, generator
from entropy_explore_env.settings.scenarios import BOX, ROOM_FURNISHED, find_scenario
from entropy_explore_env.worlds.load import make_world
from entropy_explore_env.worlds.splits import draw_world_number
from tests.reference.scenes import free_box


def rng(seed, episode=0):
    return generator(seed, episode, Stream.WORLD)


def test_seed_and_episode_determine_the_world_by_its_number():
    worlds = {}
    for seed, episode in ((5, 0), (5, 1), (6, 0)):
        first, second = (make_world(ROOM_FURNISHED, rng(seed, episode)) for _ in range(2))
        np.testing.assert_array_equal(first.occupied, second.occupied)
        assert first.grid == ROOM_FURNISHED.grid
        numbered = make_world(ROOM_FURNISHED, draw_world_number("train", rng(seed, episode)))
        np.testing.assert_array_equal(first.occupied, numbered.occupied)
        worlds[first.occupied.tobytes()] = seed, episode
    assert len(worlds) == 3


def test_missions_of_one_seed_are_in_one_world_and_those_of_another_split_are_not():
    def occupied(split):
        missions = Missions(free_box(world="furnished", split=split), 2)
        missions.reset(0, seed=3)
        missions.reset(1, seed=3)
        missions.reset(1)
        return [world.occupied.tobytes() for world in missions.worlds]

    assert occupied("test") == occupied("test")
    first, second = occupied("test")
    assert first != second
    assert len({first, second, *occupied("train"), *occupied("validation")}) == 6


def test_an_empty_world_is_shared_by_all_missions():
    assert make_world(BOX, rng(0)) is make_world(BOX, rng(1))
    assert make_world(BOX, rng(0)).grid == BOX.grid


@pytest.mark.parametrize("name", ["castle", "castle.xyzzy", "", "octomap"])
def test_a_world_that_nobody_knows_is_refused(name):
    scenario = free_box(world=name)
    for ask in (lambda: make_world(scenario, rng(0)), lambda: Missions(scenario)):
        with pytest.raises(SettingError, match=r"Scenario\.world = .*empty, furnished.*\.bt"):
            ask()
    with pytest.raises(SettingError, match=r"Scenario\.world = .*a recipe: empty, furnished"):
        make_world(scenario, 0)


@pytest.mark.parametrize("number", [-1, 0.5, None, True, "7"])
def test_a_world_number_that_is_none_is_refused(number):
    with pytest.raises(SettingError, match=r"number = .*whole number"):
        make_world(ROOM_FURNISHED, number)


def test_worlds_by_number_are_those_of_missions():
    world = make_world("office", 3)
    np.testing.assert_array_equal(world.occupied, make_world(find_scenario("office"), 3).occupied)
    assert (world.occupied != make_world("office", 4).occupied).any()
    assert world.grid == find_scenario("office").grid
    team = parallel_env("office")
    _, infos = team.reset(seed=0, options={"world": 3})
    np.testing.assert_array_equal(team.missions.worlds[0].occupied, world.occupied)
    assert {info["world_number"] for info in infos.values()} == {3}
    _, infos = team.reset(seed=0)
    number = infos["robot_0"]["world_number"]
    drawn = make_world("office", number)
    np.testing.assert_array_equal(team.missions.worlds[0].occupied, drawn.occupied)
    with pytest.raises(SettingError, match="scenario = 'offic'"):
        make_world("offic", 3)


def test_infos_of_many_missions_say_each_world_s_number_and_a_sequence_chooses_them():
    batch = EntropyExploreVectorEnv("room-furnished", 3, robots=1)
    for worlds in ([4, 5, 4], (4, 5, 4), np.array([4, 5, 4])):
        _, infos = batch.reset(seed=1, options={"world": worlds})
        assert infos["world_number"].tolist() == [4, 5, 4] and infos["world_number"].dtype == np.int64
    _, infos = batch.reset(seed=1, options={"world": range(7, 10)})
    assert infos["world_number"].tolist() == [7, 8, 9]
    mask = np.array([False, True, False])
    _, infos = batch.reset(options={"world": [0, 1, 2], "reset_mask": mask})
    assert infos["world_number"].tolist() == [7, 1, 9]
    given = parallel_env("room-furnished", world=make_world("room-furnished", 3))
    assert given.reset(seed=0)[1]["robot_0"]["world_number"] == -1
