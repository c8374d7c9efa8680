"""Lengths of known paths between places, by hand and beside a slow reference."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given

from entropy_explore_env.belief.paths.search import new_search
from entropy_explore_env.frontiers.path_lengths import KnownPaths
from entropy_explore_env.frontiers.voxel_frontiers import VoxelFrontiers
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.scenarios import OFFICE_3D
from entropy_explore_env.viewpoints import evaluation
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


DRONE = with_settings(
    OFFICE_3D,
    {"grid": Grid((60, 42, 14), 0.1), "robots": 1, "robot": {"body_radius_m": 0.3, "reach_m": 3.0}},
)


def known_hall(seed):
    """A hall that a drone knows, but for patches, with pillars and a wall with a door, and where it is."""
    rng, shape = np.random.default_rng(seed), DRONE.grid.shape
    mean, precision = np.full(shape, 0.05, np.float32), np.full(shape, 100.0, np.float32)
    mean[30, :30], mean[30, 39:] = 0.95, 0.95
    for _ in range(4):
        x, y = int(rng.integers(10, 56)), int(rng.integers(10, 38))
        mean[x : x + 2, y : y + 2] = 0.95
    x, y = int(rng.integers(34, 56)), int(rng.integers(4, 38))
    precision[x : x + 4, y : y + 4] = 30.0**-2
    cells = VoxelFrontiers(DRONE, DRONE.kind_of(0))
    view = SimpleNamespace(
        mean=mean, precision=precision, scenario=DRONE, teammates={}, robot=0, since_scan_m=0.0
    )
    cells.update(view, 0.5)  # type: ignore[arg-type]
    return cells, int(np.ravel_multi_index((5, 5, 6), shape))


@given(seeds)
@drawn(10)
def test_drones_in_fine_grids_find_about_the_same_lengths_in_cells(seed):
    """To standing places, by cells of 0.2 m and by voxels of 0.1 m; routes lead from voxel to voxel."""
    cells, here = known_hall(seed)
    fine = KnownPaths(DRONE, DRONE.kind_of(0), cells, new_search(DRONE.grid.voxels))
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(evaluation, "_CELLS_WITHIN", 7)
        assert (evaluation.cell_edge(DRONE, DRONE.kind_of(0)), fine.lattice.edge) == (2, 1)
        coarse = KnownPaths(DRONE, DRONE.kind_of(0), cells, new_search(DRONE.grid.voxels))
    standing = np.flatnonzero(np.isfinite(cells.traversal_cost)).astype(np.int32)
    others = np.random.default_rng(seed).choice(standing, 40)
    by_voxels, by_cells = fine.lengths_from(here, others), coarse.lengths_from(here, others)
    assert np.isfinite(by_voxels).sum() > 5
    np.testing.assert_array_equal(np.isfinite(by_cells[np.isfinite(by_voxels)]), True)
    near = by_voxels[np.isfinite(by_voxels)]
    assert (np.abs(by_cells[np.isfinite(by_voxels)] - near) <= 0.1 * near + 2 * 2 * np.sqrt(3.0)).all()
    goal = int(others[np.isfinite(by_voxels)][np.argmax(near)])
    fine.start(here)
    fine.extend(np.inf)
    route, steps = fine.route_to(goal), coarse.route_to(goal)
    assert (steps[0], steps[-1]) == (route[0], route[-1]) == (here, goal)
    for path in (route, steps):
        places = np.stack(np.unravel_index(path, DRONE.grid.shape), axis=-1)
        assert np.abs(np.diff(places, axis=0)).max() == 1
        assert np.linalg.norm(np.diff(places, axis=0), axis=1).sum() == pytest.approx(near.max(), rel=1e-6)
    places = np.stack(np.unravel_index(standing, DRONE.grid.shape), axis=-1) + 0.5
    places = np.random.default_rng(seed).choice(places, 30)
    for paths in (fine, coarse):
        paths.start(here)
        paths.extend(np.inf)
    lines = coarse.free_lines(places, 40.0)
    np.testing.assert_array_equal(lines, fine.free_lines(places, 40.0))
    assert lines.sum() > 30 and not lines.all()
    assert [coarse.is_line_free(places[0], place) for place in places] == [
        fine.is_line_free(places[0], place) for place in places
    ]
    np.testing.assert_array_equal(coarse.lengths_to(others), by_cells)
    walled = np.random.default_rng(seed).choice(np.flatnonzero(np.isinf(cells.traversal_cost)), 20)
    assert np.isinf(coarse.lengths_from(here, walled.astype(np.int32))).all()


def test_a_frontier_cell_just_beyond_the_reach_of_a_finished_search_counts_by_hand():
    """A free strip of 9 × 2 cells: the frontier cell in its far corner is 8.41 away, the first reach is 8."""
    plan = np.full((40, 40), reference.WALL, np.int8)
    plan[5:14, 5:7] = reference.FREE
    plan[14, 6] = reference.UNKNOWN
    scene = scene_of(plan, (5, 5))
    scene.paths.start(scene.here)
    assert scene.paths.reach == 8.0 and scene.paths.exhausted()
    voxels, lengths = scene.paths.nearest_frontiers()
    assert voxels.tolist() == [13 * 40 + 6] and lengths[0] == pytest.approx(7.0 + np.sqrt(2.0))
