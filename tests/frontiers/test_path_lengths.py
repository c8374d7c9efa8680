"""Lengths of known paths between places, by hand and beside a slow reference."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given

from tests.planner.scenes import corridor, random_plan, scene_of
from tests.reference import explorers as reference
from tests.reference.scenes import drawn, seeds


def test_lengths_between_places_are_those_of_paths_by_hand():
    """A corridor: from cell 8 to both ends 7 and 19, and 26 between them."""
    plan = corridor()
    scene = scene_of(plan, (8, 1))
    ends = np.array([np.ravel_multi_index(place, plan.shape) for place in ((1, 1), (27, 1))], np.int32)
    found = scene.paths.lengths_between(ends, np.array([7.0, 19.0]))
    assert found == pytest.approx(np.array([[0, 7, 19], [7, 0, 26], [19, 26, 0]], float))


@given(seeds)
@drawn(30)
def test_lengths_between_places_are_the_shortest(seed):
    rng = np.random.default_rng(seed)
    plan, robot = random_plan((31, 14), rng)
    scene = scene_of(plan, robot)
    reached = np.argwhere(np.isfinite(reference.lengths_from(plan, robot)))
    places = [tuple(map(int, place)) for place in reached[rng.integers(len(reached), size=4)]]
    voxels = np.array([np.ravel_multi_index(place, plan.shape) for place in places], np.int32)
    fields = reference.lengths_from_all(plan, [robot, *places])
    wanted = np.array([[field[place] for place in (robot, *places)] for field in fields])
    found = scene.paths.lengths_between(voxels, scene.paths.lengths_from(scene.here, voxels))
    assert found == pytest.approx(wanted, rel=1e-5, abs=1e-5)
