"""Which world a scenario asks for: made by a recipe, from a world number, or read from a file."""

from __future__ import annotations

import numpy as np
import pytest

from entropy_explore_env.errors import SettingError, WorldError
from entropy_explore_env.missions.simulation import Missions
from entropy_explore_env.randomness import Stream, generator
from entropy_explore_env.scenarios import BOX, ROOM_FURNISHED
from entropy_explore_env.worlds.load import make_world, with_world, world_from_file, world_with_number
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
        numbered = world_with_number(ROOM_FURNISHED, draw_world_number("train", rng(seed, episode)))
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


@pytest.mark.parametrize("name", ["castle", "castle.las", "", "octomap"])
def test_a_world_that_nobody_knows_is_refused(name):
    scenario = free_box(world=name)
    for ask in (lambda: make_world(scenario, rng(0)), lambda: with_world(scenario)):
        with pytest.raises(SettingError, match=r"Scenario\.world = .*empty, furnished.*\.bt"):
            ask()
    with pytest.raises(SettingError, match=r"Scenario\.world = .*a recipe: empty, furnished"):
        world_with_number(scenario, 0)


@pytest.mark.parametrize("number", [-1, 0.5, None, True, "7"])
def test_a_world_number_that_is_none_is_refused(number):
    with pytest.raises(SettingError, match=r"number = .*whole number"):
        world_with_number(ROOM_FURNISHED, number)


def test_a_world_file_that_is_missing(tmp_path):
    path = tmp_path / "nowhere.bt"
    with pytest.raises(WorldError, match="allowed is a file that exists") as raised:
        world_from_file(path, 0.5)
    assert str(path) in str(raised.value)


def test_a_recipe_leaves_the_scenario_s_grid_alone():
    assert with_world(ROOM_FURNISHED) is ROOM_FURNISHED
