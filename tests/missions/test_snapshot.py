"""Missions of every kind go on bit for bit: in batches, on threads, copied, pickled, restored, run again."""

import copy
import pickle

import numpy as np
import pytest

from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.missions.simulation import Missions
from entropy_explore_env.missions.snapshot import restore, snapshot
from entropy_explore_env.missions.state import FROM_WORLD
from entropy_explore_env.reports.mission_record import (
    CommandRecorder,
    load_record,
    reset_options_of,
    same_end,
    save_record,
)
from entropy_explore_env.reports.state_digest import state_digest
from entropy_explore_env.worlds.load import save_world
from tests.missions.kinds import KINDS, everything, walked
from tests.reference.scenes import free_box, random_actions, started, wander


@pytest.mark.parametrize("kind", KINDS)
def test_a_batch_on_two_threads_is_its_missions_by_themselves(kind):
    """Also one that is pickled half way."""
    scenario, happened, given = KINDS[kind]
    batch = Missions(scenario, 3, threads=2, given=given)
    alone = [Missions(scenario, given=given) for _ in range(3)]
    for mission, one in enumerate(alone):
        batch.reset(mission, mission)
        one.reset(0, mission)
    rng = np.random.default_rng(0)
    for step in range(40):
        boxes, numbers = random_actions(batch, rng)
        batch.step(boxes, numbers)
        for mission, one in enumerate(alone):
            one.step(boxes[mission : mission + 1], numbers[mission : mission + 1])
        if step == 20:
            batch.close()
            batch = pickle.loads(pickle.dumps(batch))
    assert happened(batch.state)
    for mission, one in enumerate(alone):
        assert state_digest(batch, mission) == state_digest(one, 0)
        np.testing.assert_array_equal(batch.observations[mission], one.observations[0])
    batch.close()


@pytest.mark.parametrize("kind", KINDS)
def test_copies_pickles_and_snapshots_go_on_alike(kind):
    missions, restored = walked(kind, 20), walked(kind, 5, 8)
    for step in range(8):
        restore(restored, snapshot(missions))
        assert everything(restored) == everything(missions)
        wander(missions, 1, step)
    restore(restored, snapshot(missions))
    others = [copy.deepcopy(missions), pickle.loads(pickle.dumps(missions)), restored]
    wander(missions, 10, 1)
    for other in others:
        wander(other, 10, 1)
        assert everything(other) == everything(missions)


@pytest.mark.parametrize("kind", KINDS)
def test_a_record_runs_again_bit_for_bit(kind, tmp_path):
    scenario, _, given = KINDS[kind]
    settings = {}
    for world in given:
        settings["world"] = str(tmp_path / "world.npz")
        save_world(world, tmp_path / "world.npz")
    env = EntropyExploreEnv(scenario, max_cycles=25, **settings)
    env.reset(seed=4)
    recorder = CommandRecorder(env.missions)
    for agent in env.agents:
        env.action_space(agent).seed(3)
    while env.agents:
        actions = {agent: env.action_space(agent).sample() for agent in env.agents}
        recorder.command(actions)
        env.step(actions)
        recorder.note()
    save_record(recorder.record("drawn"), tmp_path / "mission.npz")
    record = load_record(tmp_path / "mission.npz")
    assert record.scenario == env.scenario and same_end(record, env.missions)
    again = EntropyExploreEnv(record.scenario)
    again.reset(seed=record.seed, options=reset_options_of(record))
    for command in record.commands:
        again.step(dict(zip(record.scenario.agents, command, strict=True)))
    assert same_end(record, again.missions)


def test_a_reset_forgets_all_of_the_mission_before():
    for kind in KINDS:
        used, fresh = walked(kind, 10), walked(kind, 0, 7)
        used.reset_some(range(2), [7, 8])
        wander(used, 3, 3)
        wander(fresh, 3, 3)
        for name, one, other in zip(used.state._fields, used.state, fresh.state, strict=True):
            assert one.tobytes() == other.tobytes(), (kind, name)


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"channel": {"burst": 0}},
        {"robots": 1, "channel": {"content": "summaries"}},
        {"robots": 1, "channel": {"order": "need"}},
        {"fiducials": {"number": 2, "own_number": 5}},
        {"robot": {"localization": {"xy_m_per_sqrt_m": 0.1}}},
    ],
)
def test_what_a_scenario_does_not_ask_for_takes_no_state(changes):
    """Of phases, need, summaries, drift, landmarks, faults and the joint map nothing is kept."""
    state, drifts = started(free_box(**changes)).state, "robot" in changes
    held = {name for name, array in state._asdict().items() if array.size}
    assert held & {"estimates"} == ({"estimates"} if drifts else set())
    others = ("phase_", "backlog", "own_", "summaries", "in_flight_parcels", "in_flight_summaries", "joint_")
    assert not [name for name in held if name.startswith((*others, "landmarks", "fiducials", "faults"))]


def test_what_follows_from_the_world_is_in_no_saved_state():
    missions = walked("late messages", 1)
    state = set(missions.state._fields)
    assert set(snapshot(missions)) & state == state - set(FROM_WORLD)


def test_a_robot_that_stands_still_for_ever_is_in_a_saved_state_only_where_robots_stop():
    missions = started(free_box(faults={"stop": {"at_s": 2.0, "robots": (0,)}}))
    wander(missions, 20, 0)
    assert np.isinf(missions.state.robots["ready_s"]).any()
    restore(started(missions.scenario, 5), snapshot(missions))


def test_distances_that_a_faulty_sensor_measures_far_too_long_are_in_a_saved_state():
    """Drawn once: distances far beyond the workspace were taken for what no mission holds."""
    wrong = {"sensor": {"range_factor": 9.0, "range_bias_m": 1e5}}
    missions = started(free_box(faults=wrong, channel={"i_min_bits": 0.0, "delay_s": 1.0}))
    wander(missions, 12, 0)
    assert missions.state.robots["depth_m"].max() > 1e5 and missions.state.in_flight_rays[..., 3].max() > 1e5
    other = started(missions.scenario, 3)
    restore(other, snapshot(missions))
    assert everything(other)[0] == everything(missions)[0]
    assert np.isfinite(missions.observations).all()
