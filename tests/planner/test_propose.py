"""Candidates of whole missions: what the observation, the mask and the state say of them is the same."""

import numpy as np
import pytest

from entropy_explore_env import EntropyExploreVectorEnv
from entropy_explore_env.planner.candidate_features import COLUMNS, FEATURES
from entropy_explore_env.planner.records import Kind

MOST = 12
ACTION = {"kind": "candidates", "candidates": MOST}


def team(**settings):
    observation = {"action_mask": True, "overlaps": True}
    given = {"robots": 2, "decision_period_s": None, "action": ACTION, "observation": observation}
    return EntropyExploreVectorEnv("box-7x11x5", 2, **{**given, **settings})


@pytest.fixture(scope="module")
def played():
    """(observations, state) before each of the first steps of two missions with random candidates."""
    env, moments = team(), []
    observations, infos = env.reset(seed=7)
    rng = np.random.default_rng(1)
    for _ in range(25):
        state = {name: array.copy() for name, array in env.missions.state._asdict().items()}
        moments.append((observations, infos["action_mask"], state))
        observations, _, ended, cut, infos = env.step(rng.integers(0, MOST, (2, 2)))
        if (ended | cut).any():
            break
    return env.missions, moments


def test_the_mask_is_1_where_there_is_a_candidate(played):
    _, moments = played
    for observations, mask, state in moments:
        deciding = state["robots"]["deciding"]
        there = state["candidates"]["kind"] != Kind.NONE
        np.testing.assert_array_equal(mask[deciding], there[deciding])
        np.testing.assert_array_equal(mask[~deciding], np.eye(1, MOST)[[0] * int((~deciding).sum())])
        np.testing.assert_array_equal(observations["action_mask"], mask)
        described = observations["candidates"].any(axis=-1)
        np.testing.assert_array_equal(described[deciding], there[deciding])
        assert not described[~deciding].any() and not observations["context"][~deciding].any()
        assert there[deciding][:, 0].all()


def test_numbers_are_in_their_ranges(played):
    _, moments = played
    for observations, _, _ in moments:
        rows = observations["candidates"].reshape(-1, len(FEATURES))
        assert np.isfinite(rows).all() and np.abs(rows).max() <= 1.0
        for feature in FEATURES:
            assert rows[:, COLUMNS[feature.name]].min() >= feature.least, feature.name
        overlaps = observations["overlaps"]
        assert overlaps.min() >= 0.0 and overlaps.max() <= 1.0
        np.testing.assert_array_equal(overlaps, overlaps.swapaxes(-1, -2))


def test_candidates_are_in_the_workspace_and_within_reach(played):
    missions, moments = played
    grid, reach_m = missions.grid, missions.scenario.robot.reach_m
    low, high = np.asarray(grid.origin_m), np.asarray(grid.origin_m) + grid.size_m
    for _, _, state in moments:
        deciding = state["robots"]["deciding"]
        viewpoints = state["candidates"]["viewpoint"][deciding]
        here = state["robots"]["goal"][deciding]
        assert (viewpoints[..., :3] >= low).all() and (viewpoints[..., :3] <= high).all()
        away = np.linalg.norm(viewpoints[..., :3] - here[:, None, :3], axis=-1)
        assert away.max() <= reach_m * (1.0 + 1e-9)
        spot = state["candidates"]["kind"][deciding] == Kind.SPOT
        assert away[spot].max(initial=0.0) < 1e-9 and spot.any()


def test_the_number_of_a_candidate_sends_the_robot_there(played):
    _, moments = played
    env = team()
    env.reset(seed=7)
    rng = np.random.default_rng(1)
    for _, _, state in moments[:-1]:
        numbers = rng.integers(0, MOST, (2, 2))
        env.step(numbers)
        deciding = state["robots"]["deciding"]
        chosen = np.take_along_axis(state["candidates"]["viewpoint"], numbers[..., None, None], axis=2)
        target = env.missions.state.robots["target"]
        np.testing.assert_array_equal(target[deciding], chosen[:, :, 0][deciding])


def test_a_number_of_no_candidate_means_the_first(played):
    _, moments = played
    for _, _, state in moments:
        none = state["candidates"]["kind"] == Kind.NONE
        first = np.broadcast_to(state["candidates"]["viewpoint"][..., :1, :], (*none.shape, 5))
        deciding = state["robots"]["deciding"][..., None] & none
        np.testing.assert_array_equal(state["candidates"]["viewpoint"][deciding], first[deciding])
