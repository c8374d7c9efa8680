"""Worlds that change under way."""

import numpy as np
import pytest

from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.errors import CallOrderError, RecordError, SettingError
from entropy_explore_env.missions.snapshot import snapshot
from entropy_explore_env.reports.mission_record import CommandRecorder
from entropy_explore_env.robots.motion import MoveEnd

DOOR = (1.0, 0.0, 0.0), (1.5, 5.5, 2.5)
"""A wall across the box of 3.5 × 5.5 × 2.5 m, in its third layer along x."""
START = np.array([[0.25, 2.75, 1.25, 0.0, 0.0]])


def begun(**settings):
    env = EntropyExploreEnv("box-7x11x5", robots=1, decision_period_s=None, **settings)
    env.reset(seed=0, options={"starts": START})
    return env


def drive(env, x_m):
    view = env.view("robot_0")
    goal = np.array([x_m, 2.75, 1.25, 0.0, 0.0])
    env.step({"robot_0": view.action_for(goal)})


def test_truth_and_collision_change_and_beliefs_do_not():
    env = begun(track_truth=True)
    drive(env, 0.25)
    belief = env.view("robot_0").mean.copy()
    env.set_world_block(*DOOR)
    world = env.missions.worlds[0]
    assert world.occupied[2].all() and not world.occupied[[0, 1, 3, 4, 5, 6]].any()
    assert np.array_equal(env.view("robot_0").mean, belief)
    drive(env, 1.25)
    assert env.view("robot_0").move_end is MoveEnd.OBSTACLE
    env.set_world_block(*DOOR, solid=False)
    drive(env, 1.25)
    assert env.view("robot_0").move_end is MoveEnd.ARRIVED
    env.reset(seed=0)
    assert not env.missions.worlds[0].occupied.any()


def test_figures_of_the_joint_map_follow_the_truth():
    """Where a wall comes, and where it goes again."""
    env = begun(track_truth=True)
    drive(env, 0.75)
    drive(env, 0.25)
    state = env.missions.state
    clock, mean, truth = state.missions[0], state.joint_mean[0], state.truth[0]
    known = state.joint_precision[0] > np.float32(30.0**-2)
    for solid in (True, False):
        env.set_world_block(*DOOR, solid=solid)
        assert clock["wrong"] == ((mean > 0.5) != (truth > 0.5))[known].sum()
        assert (clock["wrong"] > 0) == solid
        assert clock["error"] == pytest.approx(np.abs(mean.astype(float) - truth)[known].sum())
        assert clock["explored_free"] == (known & state.visible[0] & (truth < 0.5)).sum()


@pytest.mark.parametrize("home", [False, True])
def test_what_a_mission_asks_for_follows_the_truth(home):
    """All but three free voxels, of 35 fewer while there is a wall."""
    env = begun(ending={"unseen_free_voxels": 3, "return_to_start": home})
    missions = env.missions

    def asked():
        goal = missions.state.missions[0]["explored_free_end"]
        return missions._returning.free[0] if home else goal

    assert asked() == 7 * 11 * 5 - 3
    env.set_world_block((1.0, 3.0, 0.0), (1.5, 5.5, 2.5))
    free = missions.state.missions[0]["visible_free"]
    assert free == 7 * 11 * 5 - 25 and asked() == free - 3
    env.set_world_block((1.0, 3.0, 0.0), (1.5, 5.5, 2.5), solid=False)
    assert asked() == 7 * 11 * 5 - 3


def test_a_door_closes_in_time_when_nobody_is_in_its_way():
    env = begun()
    env.set_world_block(*DOOR, at_s=1.0)
    drive(env, 0.25)
    assert not env.missions.worlds[0].occupied.any()
    while env.missions.state.missions[0]["time_s"] < 1.0:
        drive(env, 1.25)
    drive(env, 1.25)  # it stands in the door
    assert not env.missions.worlds[0].occupied.any()
    for _ in range(4):
        drive(env, 3.0)
    assert env.missions.worlds[0].occupied[2].all()


def test_bad_blocks_are_refused_and_records_say_so():
    env = EntropyExploreEnv("box-7x11x5", robots=1)
    with pytest.raises(CallOrderError, match="set_world_block before reset"):
        env.set_world_block(*DOOR)
    env = begun()
    for low, high, more, message in [
        ((0.0, 0.0), (1.0, 1.0, 1.0), {}, r"low_m = .*three finite numbers"),
        ((0.0, 0.0, 0.0), (np.nan, 1.0, 1.0), {}, r"high_m = .*three finite numbers"),
        ((9.0, 0.0, 0.0), (9.5, 1.0, 1.0), {}, r"low_m, high_m = .*centres of voxels"),
        ((1e300, 0.0, 0.0), (3.0, 1.0, 1.0), {}, r"low_m, high_m = .*centres of voxels"),
        ((0.0, 2.5, 1.0), (0.5, 3.0, 1.5), {}, "robot 0 does not touch"),
        (*DOOR, {"at_s": -1.0}, r"at_s = -1.0"),
        (*DOOR, {"solid": 1}, "solid = 1: .*True or False"),
    ]:
        with pytest.raises(SettingError, match=message):
            env.set_world_block(low, high, **more)
    assert not env.missions.worlds[0].occupied.any()
    for at_s in (None, 1.0):
        env.reset(seed=0)
        recorder = CommandRecorder(env.missions)
        snapshot(env.missions)
        env.set_world_block(*DOOR, at_s=at_s)
        for refused in (recorder.record, lambda: snapshot(env.missions)):
            with pytest.raises(RecordError, match="its world changes under way"):
                refused()
