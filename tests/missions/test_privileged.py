"""Critics get what all robots' maps hold together, and nothing that acts does."""

from typing import Any

import grimp
import numpy as np
import pytest

from entropy_explore_env.envs.privileged_vec_env import PrivilegedVecEnv
from entropy_explore_env.envs.robot_vec_env import RobotVecEnv
from entropy_explore_env.errors import SettingError
from entropy_explore_env.missions.privileged import PRIVILEGED, privileged_numbers
from entropy_explore_env.settings.scenario import Scenario
from tests.reference.scenes import free_box, started, wander

COLUMN = {number.name: place for place, number in enumerate(PRIVILEGED)}


def team(**changes: Any) -> Scenario:
    return free_box(channel={"loss_probability": 0.3}, **changes)


def test_numbers_of_critics_by_hand():
    """The joint map knows each voxel as well as the robot that knows it best: no map knows more."""
    these = started(team(robots=3), missions=2)
    start = privileged_numbers(these)
    assert start.shape == (2, 3, len(PRIVILEGED))
    assert np.allclose(start[:, :, :4], 1.0, atol=1e-6) and np.allclose(start[:, :, 4], 0.0, atol=1e-6)
    assert np.allclose(start[:, :, COLUMN["next_decision"]], 0.0)
    wander(these, 9, 0)
    numbers, clock = privileged_numbers(these), these.state.missions
    asked = clock["entropy_start_bits"] - clock["entropy_end_bits"]
    prior = these.rules.params["prior_precision"][0]
    joint = 0.5 * np.log2(these.state.precision.max(axis=1) / prior, dtype=np.float64).sum(axis=1)
    assert np.allclose(numbers[:, 0, COLUMN["joint_left"]], 1.0 - joint / asked, atol=1e-5)
    own = 1.0 - (clock["entropy_start_bits"][:, None] - these.state.robots["entropy_bits"]) / asked[:, None]
    assert np.allclose(numbers[:, :, COLUMN["own_left"]], own, atol=1e-6)
    assert np.allclose(numbers[:, :, COLUMN["least_left"]], own.min(axis=1)[:, None], atol=1e-6)
    assert np.allclose(numbers[:, :, COLUMN["most_left"]], own.max(axis=1)[:, None], atol=1e-6)
    assert (numbers[:, :, COLUMN["joint_left"]] < numbers[:, :, COLUMN["least_left"]]).all()
    logs = np.log(np.clip(1.0 - joint / asked, 1e-3, 1.0)) / np.log(1e3)
    assert np.allclose(numbers[:, 1, COLUMN["log_joint_left"]], logs, atol=1e-4)


def test_teammates_are_as_near_as_they_are_and_decide_when_they_do():
    these = started(team(robots=3, decision_period_s=0.05))
    wander(these, 1, 0)
    robots, time_s = these.state.robots[0], these.state.missions["time_s"][0]
    robots["origin"][:, :3] = robots["goal"][:, :3] = [[0.1, 0, 0], [0.4, 0, 0], [0.1, 0.4, 0]]
    robots["deciding"], robots["redecide_s"] = [False, False, True], np.inf
    robots["ready_s"] = time_s + np.array([2.0, 5.0, 0.0])
    numbers = privileged_numbers(these)[0]
    diagonal = np.linalg.norm(these.grid.size_m)
    assert np.allclose(numbers[:, COLUMN["nearest_mate"]], np.array([0.3, 0.3, 0.4]) / diagonal, atol=1e-5)
    assert np.allclose(numbers[:, COLUMN["next_decision"]], [0.0, 0.0, 2.0 / 12.0], atol=1e-5)
    alone = privileged_numbers(started(team(robots=1)))[0, 0]
    assert alone[COLUMN["nearest_mate"]] == alone[COLUMN["next_decision"]] == 1.0


def test_rows_for_training_are_observations_and_then_what_no_robot_knows():
    there = team(observation={"flat": True}, ending={"time_limit_s": 12.0}, decision_period_s=2.0)
    plain, told = RobotVecEnv(there, 2, seeds=[1, 2]), PrivilegedVecEnv(there, 2, seeds=[1, 2])
    ours, theirs, size = told.reset(), plain.reset(), plain.vector_env.missions.layout.size
    assert told.observation_space.shape == (size + len(PRIVILEGED),)
    ends = 0
    for step in range(8):
        assert np.array_equal(ours[:, :size], theirs)
        numbers = privileged_numbers(told.vector_env.missions).reshape(4, -1)
        assert np.array_equal(ours[:, size:], numbers)
        actions = np.random.default_rng(step).uniform(-1, 1, (4, 5)).astype(np.float32)
        before = numbers
        ours, rewards, dones, infos = told.step(actions)
        theirs, expected, _, others = plain.step(actions)
        assert np.array_equal(rewards, expected)
        for row in np.flatnonzero(dones):
            last = infos[row]["terminal_observation"]
            assert np.array_equal(last[:size], others[row]["terminal_observation"])
            # Of the mission that ended, and not of the fresh one in its place, which lacks everything.
            assert last[size] < 1.0 and last[size] <= before[row, 0]
            ends += 1
    assert ends > 0


def test_privileged_rows_must_be_flat():
    with pytest.raises(SettingError, match="flat"):
        PrivilegedVecEnv(team(), 1)


def test_nobody_who_acts_or_evaluates_can_see_what_only_training_may():
    graph = grimp.build_graph("entropy_explore_env", "baselines", "training")
    privileged = "entropy_explore_env.missions.privileged"
    direct = graph.find_modules_that_directly_import(privileged)
    assert direct == {"entropy_explore_env.envs.privileged_vec_env"}
    acting = ["training.policy", "training.evaluate", "training.validation", "entropy_explore_env"]
    acting += [each for each in graph.modules if each.startswith("baselines")]
    for module in acting:
        assert graph.find_shortest_chain(module, privileged) is None, module
