"""The scenarios that are too large for whole episodes: each is made by its id, starts and steps."""

import math

import numpy as np
import pettingzoo
import pytest

from entropy_explore_env import SCENARIOS, EntropyExploreEnv, environment_id
from entropy_explore_env.settings.scenarios import ROOM
from entropy_explore_env.worlds.recipes.catalogue import RECIPES
from tests.reference.scenes import SMALL

LARGE = [name for name in SCENARIOS if name not in SMALL]


def test_small_scenarios_are_scenarios_and_every_recipe_has_one():
    assert set(SMALL) < set(SCENARIOS)
    assert {scenario.world for scenario in SCENARIOS.values()} == set(RECIPES)
    assert all(name == scenario.name for name, scenario in SCENARIOS.items())


@pytest.mark.parametrize("name", LARGE)
def test_teams_start_and_gather_bits(name):
    env = pettingzoo.make("parallel", environment_id(name), max_cycles=25)
    assert isinstance(env, EntropyExploreEnv)
    observations, _ = env.reset(seed=1)
    scenario, world = env.scenario, env.missions.worlds[0]
    assert world.name == scenario.world
    assert world is not None
    layout = world.layout(scenario)
    rng, infos, gained = np.random.default_rng(0), {}, 0.0
    while env.agents:
        actions = {agent: rng.uniform(-1, 1, env.action_space(agent).shape) for agent in env.agents}
        actions = {agent: action.astype(np.float32) for agent, action in actions.items()}
        observations, *_, infos = env.step(actions)
        for agent, observation in observations.items():
            assert env.observation_space(agent).contains(observation)
        gained += sum(info["own_bits"] for info in infos.values())
    assert len(infos) == scenario.robots and gained > 0.0
    for agent in infos:
        place = tuple(scenario.grid.voxel_of(env.view(agent).pose[:3]))
        assert not layout.collision_mask[place], f"{agent} is where its body does not fit"


def test_the_paper_s_parameters():
    """Tables 1 and 2 of Rocha04."""
    assert (ROOM.grid.shape, ROOM.grid.voxel_size_m, ROOM.grid.voxels) == ((41, 41, 17), 0.25, 28_577)
    assert ROOM.grid.centre_of(np.array([0, 0, 0])).tolist() == [0.0, 0.0, 0.0]
    assert ROOM.grid.centre_of(np.array([40, 40, 16])).tolist() == [10.0, 10.0, 4.0]
    robot, sensor = ROOM.robot, ROOM.sensor
    assert (robot.max_speed_m_s, robot.acceleration_m_s2, robot.reach_m) == (0.25, 0.25, 0.5)
    assert (robot.motion, robot.turn_rate_rad_s) == ("free", math.inf)
    assert (sensor.sigma_min, sensor.sigma_slope_per_m) == (0.08, 0.006)
    assert (sensor.field_of_view_rad, sensor.angular_step_rad) == ((math.pi / 6, math.pi / 12), math.pi / 90)
    assert (sensor.columns, sensor.rows, sensor.rays) == (16, 8, 128)
    assert (ROOM.sigma_prior, ROOM.ending.sigma_end, ROOM.ending.termination) == (30.0, 0.03, "any")
    assert (ROOM.channel.burst, ROOM.channel.i_min_bits) == (64, 0.3219)
    assert (ROOM.channel.loss_probability, ROOM.channel.delay_s, ROOM.channel.range_m) == (0.0, 0.0, math.inf)
