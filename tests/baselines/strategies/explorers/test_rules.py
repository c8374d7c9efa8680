"""Choices of the rules of exploration in random plans, beside the textbook's."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from baselines.strategies.explorers.distance_advantage import (
    DistanceAdvantage,
    DistanceAdvantageConfig,
    advantages,
)
from baselines.strategies.explorers.explorer import Scene
from baselines.strategies.explorers.frontier_cells import BLOCK, FrontierCells
from baselines.strategies.explorers.nearest_frontier import NearestFrontier, best_of
from baselines.strategies.explorers.path_lengths import KnownPaths
from baselines.strategies.frontier.voxel.map import NONE
from entropy_explore_env.belief.paths.search import new_search
from entropy_explore_env.scenario import with_settings
from entropy_explore_env.scenarios import find_scenario
from entropy_explore_env.settings import Grid
from tests.reference import explorers as reference
from tests.reference.scenes import drawn, seeds

SHAPES = ((17, 11), (9, 23), (31, 14))


def random_plan(shape, rng):
    """Known free cells in patches, walls and unknown cells among them; one free cell for the robot."""
    plan = np.full(shape, reference.UNKNOWN, np.int8)
    for _ in range(int(rng.integers(2, 9))):
        low = [int(rng.integers(0, n)) for n in shape]
        wide = [int(rng.integers(2, 9)) for _ in shape]
        plan[low[0] : low[0] + wide[0], low[1] : low[1] + wide[1]] = reference.FREE
    plan[(plan == reference.FREE) & (rng.random(shape) < 0.15)] = reference.WALL
    free = np.argwhere(plan == reference.FREE)
    robot = tuple(int(i) for i in free[rng.integers(len(free))]) if len(free) else (0, 0)
    plan[robot] = reference.FREE
    return plan, robot


def belief_of_plan(plan):
    """(X, Y, 1) mean and precision that say the same."""
    mean = np.where(plan == reference.WALL, 0.95, 0.05).astype(np.float32)
    precision = np.where(plan == reference.UNKNOWN, 30.0**-2, 100.0).astype(np.float32)
    return mean[:, :, None], precision[:, :, None]


def scenario_of(shape, **robot):
    base = find_scenario("office")
    settings = {"grid": Grid((*shape, 1), 0.1), "world": "empty", "robot": {"body_radius_m": 0.0, **robot}}
    return with_settings(base, settings)


def scene_of(plan, robot, target=NONE):
    """What a robot there knows of a plan."""
    scenario = scenario_of(plan.shape)
    mean, precision = belief_of_plan(plan)
    view = SimpleNamespace(mean=mean, precision=precision, scenario=scenario)
    cells = FrontierCells(scenario, scenario.kind_of(0))
    cells.update(view, 0.5)  # type: ignore[arg-type]
    paths = KnownPaths(scenario, scenario.kind_of(0), cells, new_search(scenario.grid.voxels))
    here = int(np.ravel_multi_index(robot, plan.shape))
    paths.start(here)
    return Scene(view, cells, paths, here, target)  # type: ignore[arg-type]


def cell(plan, voxel):
    x, y = np.unravel_index(voxel, plan.shape)
    return int(x), int(y)


@given(st.sampled_from(SHAPES), seeds)
@drawn(60)
def test_the_nearest_frontier_cell_of_all_is_chosen(shape, seed):
    plan, robot = random_plan(shape, np.random.default_rng(seed))
    wanted = reference.nearest_frontier(plan, robot)
    picked = NearestFrontier().pick(scene_of(plan, robot))
    if not wanted:
        assert picked == NONE
    else:
        assert wanted[cell(plan, picked)] == pytest.approx(max(wanted.values()), abs=1e-6)


@given(st.sampled_from(SHAPES), st.sampled_from([3, 6, 40]), st.sampled_from([4.0, 9.0, math.inf]), seeds)
@drawn(40)
def test_advantages_are_the_textbooks_and_the_greatest_of_one_cell_a_block_is_chosen(
    shape, radius, horizon, seed
):
    plan, robot = random_plan(shape, np.random.default_rng(seed))
    scene = scene_of(plan, robot)
    wanted = reference.distance_advantage(plan, robot, radius, horizon)
    picked = DistanceAdvantage(DistanceAdvantageConfig(radius=radius, horizon=horizon)).pick(scene)
    if not wanted:
        assert picked == NONE
        return
    lengths = reference.lengths_from(plan, robot)
    nearest_in_block: dict[tuple[int, int], float] = {}
    for place in wanted:
        block = (place[0] // BLOCK, place[1] // BLOCK)
        nearest_in_block[block] = min(lengths[place], nearest_in_block.get(block, math.inf))
    stand = {
        p: v for p, v in wanted.items() if lengths[p] <= nearest_in_block[p[0] // BLOCK, p[1] // BLOCK] + 1e-6
    }
    x, y = cell(plan, picked)
    assert (x, y) in stand
    tied = {}  # of a block's equally near cells either may stand for it
    for p, v in stand.items():
        tied.setdefault((p[0] // BLOCK, p[1] // BLOCK), []).append(v)
    least = max(min(values) for values in tied.values())
    assert stand[x, y] >= least - 1e-6


@given(seeds)
@drawn(30)
def test_sparing_searches_changes_no_greatest_advantage(seed):
    plan, robot = random_plan((31, 14), np.random.default_rng(seed))
    scene = scene_of(plan, robot)
    voxels, lengths = scene.paths.frontiers_within(math.inf)
    if len(voxels) == 0:
        return
    around = scene.paths.around(scene.here, 12)
    farthest = float(scene.paths.lengths_to(around).max())
    worth = advantages(scene.paths, voxels, lengths, around, farthest)
    all_of_them = reference.distance_advantage(plan, robot, 12, math.inf)
    wanted = np.array([all_of_them[cell(plan, voxel)] for voxel in voxels])
    known = np.isfinite(worth)
    np.testing.assert_allclose(worth[known], wanted[known], atol=1e-6)
    assert worth.max() == pytest.approx(wanted.max(), abs=1e-6)


def test_of_two_equally_near_frontiers_the_one_far_from_all_else_is_taken_by_hand():
    """A corridor of 18 cells, 3 … 20; the robot in cell 5 is two steps from a frontier on either side.

    From cell 3 the others are 0 … 17 steps away, 8.5 on average; from cell 7 it is 101/18.
    """
    plan = np.full((22, 3), reference.WALL, np.int8)
    plan[3:21, 1] = reference.FREE
    plan[2, 1] = plan[7, 2] = reference.UNKNOWN
    wanted = reference.distance_advantage(plan, (5, 1), 60, 60.0)
    assert wanted == pytest.approx({(3, 1): 8.5 - 2.0, (7, 1): 101 / 18 - 2.0})
    assert cell(plan, DistanceAdvantage().pick(scene_of(plan, (5, 1)))) == (3, 1)


def test_a_cell_as_good_as_the_target_does_not_replace_it():
    voxels, worth = np.array([4, 9, 2]), np.array([1.0, 3.0, 3.0])
    assert [best_of(voxels, worth, target) for target in (2, 9, 4)] == [2, 9, 9]
    assert best_of(voxels, np.full(3, -np.inf), 4) == NONE and best_of(voxels[:0], worth[:0], 4) == NONE


def test_a_dropped_cell_counts_again_when_the_map_changes_around_it_only():
    plan = np.full((30, 7), reference.WALL, np.int8)
    plan[:, 3] = reference.FREE
    plan[0, 3] = plan[29, 3] = reference.UNKNOWN
    scene = scene_of(plan, (10, 3))
    left, right = (int(np.ravel_multi_index(place, plan.shape)) for place in ((1, 3), (28, 3)))
    assert NearestFrontier().pick(scene) == left
    scene.cells.drop(left, with_edges=True)
    assert NearestFrontier().pick(scene) == right and not scene.cells.is_frontier(left)
    for place, back in (((25, 2), False), ((2, 2), True)):
        plan[place] = reference.UNKNOWN
        mean, precision = belief_of_plan(plan)
        view = SimpleNamespace(mean=mean, precision=precision.copy(), scenario=scene.view.scenario)
        view.precision[place] = 200.0  # measured again, and free now
        view.mean[place] = 0.05
        scene.cells.update(view, 0.5)  # type: ignore[arg-type]
        assert scene.cells.is_frontier(left) == back
