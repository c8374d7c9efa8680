"""Missions end where nothing is left that a robot could drive up to."""

import numpy as np
import pytest

from baselines.experiments.mission import run_mission, scripted_env
from baselines.strategies import make_strategy
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.missions.endings import IDLE_ROUNDS, IDLE_SCANS
from entropy_explore_env.missions.records import MissionEnd
from entropy_explore_env.missions.reset_options import ResetOptions
from entropy_explore_env.missions.simulation import Missions
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.scenarios import SCENARIOS
from entropy_explore_env.worlds.world import World
from tests.worlds.test_sight import EDGE_M, LEFT, asked, two_rooms

EDGES_M = EDGE_M * (23 + 9 + 1)


def rooms(**settings):
    """Two robots in the left one of two rooms; through the gap between them fits a beam, and no body."""
    world = two_rooms(1)
    missions = Missions(asked(world, 0.14, **settings), given=(world,))
    missions.reset(0, seed=0, options=ResetOptions(LEFT))
    return missions


def all_seen(**settings):
    """Robots that together know the rooms, and are asked for more than scans can show: they are idle."""
    missions = rooms(channel={"burst": 0}, **settings)
    missions.state.joint_precision[0][:] = 1e4
    missions.state.missions[0]["explored_visible"], missions.state.missions[0]["explored_end"] = 1000, 2000
    return missions


def idle(missions, scans=IDLE_SCANS, rounds=IDLE_ROUNDS):
    """Let the team have been idle for so long that its next step, a turn on the spot, asks what is left."""
    clock, robots = missions.state.missions[0], missions.state.robots[0]
    clock["idle_scans"] = 2 * scans
    clock["idle_from_m"] = (robots["departed_m"] + robots["path_m"]).sum() - 2 * rounds * EDGES_M - 1e-6
    missions.step(np.zeros((1, 2, 5)), np.zeros((1, 2), np.int64))


def know(missions, robot):
    """Write all that robots can drive up to into a robot's own map."""
    missions.state.precision[0, robot][missions.state.drivable[0]] = 1e4


def test_what_can_be_driven_up_to_is_the_own_room_and_its_walls():
    drivable = rooms().state.drivable[0].reshape(23, 9)
    assert drivable[:12].all() and not drivable[13:].any()


def leave(missions):
    """Let a voxel that no scan shows be one that robots can drive up to."""
    missions.state.drivable[0][-1] = True
    missions.state.joint_precision[0][-1] = 1e-9


@pytest.mark.parametrize(
    ("left", "scans", "rounds", "end"),
    [
        (False, IDLE_SCANS, 0.9 * IDLE_ROUNDS, MissionEnd.EXHAUSTED),
        (False, IDLE_SCANS - 5, IDLE_ROUNDS, MissionEnd.EXHAUSTED),
        (True, IDLE_SCANS, IDLE_ROUNDS, MissionEnd.RUNNING),
        (False, IDLE_SCANS - 5, 0.9 * IDLE_ROUNDS, MissionEnd.RUNNING),
    ],
)
def test_the_team_has_seen_what_is_near_and_has_long_been_idle(left, scans, rounds, end):
    missions = all_seen()
    if left:
        leave(missions)
    idle(missions, scans, rounds)
    assert missions.over(0) is end
    assert not MissionEnd.EXHAUSTED.reached_goal


@pytest.mark.parametrize(("stops", "end"), [(True, MissionEnd.EXHAUSTED), (False, MissionEnd.RUNNING)])
def test_where_maps_are_shared_robots_that_work_have_to_know(stops, end):
    faults = {"faults": {"stop": {"at_s": 0.2, "robots": (1,)}}} if stops else {}
    ending = {"seen_share": 1.0, "termination": "shared"}
    missions = all_seen(ending=ending, **faults)
    know(missions, 0)
    for _ in range(2):
        idle(missions)
    assert missions.over(0) is end


def test_a_team_that_has_seen_enough_goes_on_to_share_it():
    missions = all_seen(ending={"seen_share": 1.0, "termination": "shared"})
    clock = missions.state.missions[0]
    clock["explored_visible"] = clock["explored_end"] = clock["visible"]
    for robot in (0, 1):
        know(missions, robot)
    idle(missions)
    assert missions.over(0) is MissionEnd.RUNNING


def test_a_team_that_has_something_left_is_asked_again_soon():
    missions, stay = all_seen(), (np.zeros((1, 2, 5)), np.zeros((1, 2), np.int64))
    leave(missions)
    idle(missions)
    assert missions.over(0) is MissionEnd.RUNNING
    missions.state.joint_precision[0][-1] = 1e4
    for _ in range(IDLE_SCANS // 4):
        missions.step(*stay)
    assert missions.over(0) is MissionEnd.EXHAUSTED


@pytest.mark.parametrize("strategy", ["tour", "voronoi", "distance-advantage", "planned-rate"])
def test_strategies_end_in_front_of_a_gap_that_beams_pass(strategy):
    solid = np.zeros((80, 60, 1), bool)
    solid[40] = True
    solid[40, 28:31] = False
    settings = {"robot": {"body_radius_m": 0.25}, "ending": {"seen_share": 0.99, "time_limit_s": 1500.0}}
    world, starts = World(Grid(solid.shape, 0.1), solid, "gap"), LEFT.copy()
    starts[:, :2] = [[1.0, 1.0], [1.0, 1.8]]
    env = scripted_env(SCENARIOS["office"], world=world, robots=2, **settings)
    run_mission(env, make_strategy(strategy), 0, options={"starts": starts})
    assert env.missions.over(0) in (MissionEnd.SEEN, MissionEnd.EXHAUSTED)


def test_an_environment_cuts_the_mission_off_and_says_why():
    env = EntropyExploreEnv(
        "office", world=two_rooms(1), robots=1, robot={"body_radius_m": 0.14}, ending={"seen_share": 1.0}
    )
    env.reset(seed=0, options={"starts": LEFT[:1]})
    for step in range(400):  # to and fro along the wall
        to = np.array([0.0, 0.13 if step % 2 == 0 else -0.13, 0.0], np.float32)
        _, _, terminated, truncated, infos = env.step({"robot_0": to})
        if not env.agents:
            break
    assert (
        infos["robot_0"]["end"] is MissionEnd.EXHAUSTED and truncated["robot_0"] and not terminated["robot_0"]
    )
    seen, asked = env.missions.state.missions[0][["explored_visible", "explored_end"]]
    assert 0.5 * asked < seen < asked
