"""A World object straight into every environment, in two lines."""

import gymnasium
import numpy as np
import pettingzoo
import pytest

import entropy_explore_env as eee

ROOM = "entropy_explore_env/Room-v1"
SHAPE = (9, 12, 7)


SOLID = np.zeros(SHAPE, bool)
SOLID[4, 2:-2] = True
HUT = eee.World(eee.Grid(SHAPE, 0.4), SOLID, "hut 4")


def single() -> gymnasium.Env:
    return gymnasium.make(ROOM, world=HUT).unwrapped


MAKERS = {
    "parallel_env": lambda: eee.parallel_env("room", robots=2, world=HUT),
    "EntropyExploreEnv": lambda: eee.EntropyExploreEnv("office-3d", world=HUT),
    "pettingzoo parallel": lambda: pettingzoo.make("parallel", ROOM, world=HUT),
    "env": lambda: eee.env("room", world=HUT).unwrapped,
    "pettingzoo aec": lambda: pettingzoo.make("aec", ROOM, world=HUT).unwrapped,
    "SingleRobotEnv": lambda: eee.SingleRobotEnv("room", world=HUT),
    "gymnasium": single,
    "vector": lambda: eee.EntropyExploreVectorEnv("room", 3, world=HUT),
    "gymnasium vector": lambda: gymnasium.make_vec(ROOM, num_envs=3, world=HUT),
}


@pytest.mark.parametrize("make", MAKERS.values(), ids=MAKERS)
def test_the_missions_of_every_environment_are_in_the_world(make):
    env = make()
    env.reset(seed=1)
    assert env.scenario.grid == HUT.grid == env.missions.grid
    for world, truth in zip(env.missions.worlds, env.missions.state.truth, strict=True):
        assert world.name == "hut 4"
        np.testing.assert_array_equal(truth.reshape(SHAPE), HUT.occupied)
    env.close()


def test_the_scenario_of_a_given_world_makes_no_other_by_itself():
    env = eee.parallel_env("room", world=HUT)
    with pytest.raises(eee.SettingError, match="'given'"):
        eee.parallel_env(env.scenario)
    again = eee.parallel_env(env.scenario, world=HUT)
    assert again.scenario == env.scenario


def test_a_world_says_what_it_is_in_a_line():
    assert repr(HUT) == "World('hut 4', 9 × 12 × 7 voxels of 0.4 m)"
