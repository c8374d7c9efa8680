"""Frontier cells of voxels: dropped ones, and openings beside a slow reference."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
from hypothesis import given
from scipy import ndimage

from baselines.strategies.rules.nearest_frontier import NearestFrontier
from tests.planner.scenes import belief_of_plan, random_plan, scene_of
from tests.reference import explorers as reference
from tests.reference.scenes import drawn, seeds


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


@given(seeds)
@drawn(30)
def test_openings_are_the_connected_frontier_cells_of_the_textbook(seed):
    plan, robot = random_plan((23, 17), np.random.default_rng(seed))
    scene = scene_of(plan, robot)
    there = np.zeros(plan.shape, bool)
    for place in reference.frontier_cells(plan):
        there[place] = True
    labels, _ = ndimage.label(there, np.ones((3, 3)))
    for place in reference.frontier_cells(plan)[:5]:
        whole = int((labels == labels[place]).sum())
        voxel = int(np.ravel_multi_index(place, plan.shape))
        assert [scene.cells.opening(voxel, most) for most in (2, 5, 1000)] == [
            min(whole, m) for m in (2, 5, 1000)
        ]
