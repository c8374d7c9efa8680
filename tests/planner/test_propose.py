"""Candidates of whole missions, which observation, mask and state describe alike, and of drawn beliefs."""

import math

import numpy as np
import pytest
from hypothesis import given

from entropy_explore_env import EntropyExploreVectorEnv
from entropy_explore_env.belief.fields import Belief
from entropy_explore_env.belief.paths.lattice import new_lattice
from entropy_explore_env.belief.paths.search import new_search
from entropy_explore_env.planner.candidate_features import COLUMNS, FEATURES
from entropy_explore_env.planner.recipe import NARROW_PLANNED, recipe_for
from entropy_explore_env.planner.records import Kind
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.scenarios import BOX
from entropy_explore_env.settings.sensor import RangeSensor
from entropy_explore_env.viewpoints.evaluation import line_is_free, new_scratch, robot_model
from tests.belief.paths.graphs import belief_costs, shortest_path
from tests.planner.situations import PRIOR, SIZE
from tests.reference.scenes import drawn, free_box, put, random_belief, seeds, started

MOST = 12
ACTION = {"kind": "candidates", "candidates": MOST}
FEW = {**ACTION, "candidates": 6}


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


def far_kinds(most_bits):
    """Kinds of the candidates of a robot in a box of which it knows all but the far end."""
    robot = {"navigator": "planned", "reach_m": 1.0}
    sensor = RangeSensor((math.pi / 6, math.pi / 12), math.pi / 36, max_range_m=4.0)
    box = free_box(grid=Grid((31, 11, 5), 0.5), robots=1, robot=robot, sensor=sensor, action=FEW)
    missions = started(box, seed=3)
    assert recipe_for(missions.scenario, missions.scenario.kinds[0]) is NARROW_PLANNED
    put(missions, 0, [1.25, 2.75, 1.25, 0.0, 0.0])
    mean = missions.state.mean[0, 0].reshape(31, 11, 5)
    precision = missions.state.precision[0, 0].reshape(31, 11, 5)
    mean[:26], precision[:26] = 0.0, 1e6
    missions.state.experience[0, 0]["most_bits"] = most_bits
    missions.step(np.zeros((1, 1, 1)), np.zeros((1, 1), int))
    return missions.state.candidates[0, 0]["kind"].tolist()


@pytest.mark.parametrize("most_bits", [0.0, 1e4])
def test_far_places_are_proposed_however_many_bits_were_ever_expected(most_bits):
    """Of 1e4 bits, 25 are little: more than the one bit of which trust in a stop was asked."""
    assert Kind.FAR in far_kinds(most_bits)


@drawn(20)
@given(seeds)
def test_candidates_in_any_belief_can_be_reached_as_they_claim(seed):
    rng = np.random.default_rng(seed)
    planned = bool(rng.integers(2))
    robot = {"navigator": "planned" if planned else "straight", "reach_m": float(rng.uniform(0.3, 3.0))}
    missions = started(free_box(action=FEW, robot=robot, observation={"panorama": False}), seed)
    mean, precision = random_belief(SIZE, seed)
    missions.state.mean[0], missions.state.precision[0] = mean.reshape(-1), precision.reshape(-1)
    place = rng.uniform(0.05, 0.95, 3) * SIZE
    put(missions, 0, [*(0.5 * place), rng.uniform(-3, 3), rng.uniform(-1, 1)])
    missions.step(np.zeros((1, 2, 1)), np.zeros((1, 2), int))  # a gaze from there, or a drive
    for number in np.flatnonzero(missions.state.robots[0]["deciding"]):
        own, candidates = missions.state.robots[0, number], missions.state.candidates[0, number]
        there = candidates[candidates["kind"] != Kind.NONE]
        here = own["goal"][:3] / 0.5
        rows = missions.layout.split(missions.observations[0, number])["candidates"]
        assert np.isfinite(rows).all() and np.abs(rows).max() <= 1.0
        belief = Belief(missions.state.mean[0, number], missions.state.precision[0, number], SIZE)
        model = robot_model(missions.scenario, missions.scenario.kinds[0])
        for k, candidate in enumerate(there):
            at = candidate["viewpoint"][:3] / 0.5
            assert (at >= 0.0).all() and (at <= SIZE).all()
            assert np.linalg.norm(at - here) <= robot["reach_m"] / 0.5 * (1 + 1e-9)
            if (
                candidate["kind"] != Kind.NEAR
                or rows[k, COLUMNS["score"]] == 0.0
                or rows[k, COLUMNS["seconds"]] == 1.0
            ):
                continue
            if planned:
                costs = belief_costs(belief.mean, belief.precision, PRIOR, 1.0)
                lattice = new_lattice(SIZE, missions.scenario.robot.body_radius_m / 0.5, None)
                ends = [int(np.ravel_multi_index(tuple(p.astype(int)), SIZE)) for p in (here, at)]
                assert math.isfinite(shortest_path(new_search(mean.size), lattice, costs, *ends)[0])
            else:
                radius = missions.scenario.robot.body_radius_m / 0.5
                assert line_is_free(belief, here, at, radius, new_scratch(BOX.grid, [model]))
