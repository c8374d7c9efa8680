"""Groups of frontier voxels: beside SciPy's labels, and how drones in fine grids choose among them."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import ndimage

from baselines.strategies.rules.nearest_frontier import NearestFrontier
from entropy_explore_env.belief.paths.search import new_search
from entropy_explore_env.frontiers import voxel_frontiers
from entropy_explore_env.frontiers.blocks import DROPPED, EDGE, NONE, new_blocks
from entropy_explore_env.frontiers.groups import any_large, fill_nearest, new_groups
from entropy_explore_env.frontiers.path_lengths import KnownPaths
from entropy_explore_env.frontiers.voxel_frontiers import VoxelFrontiers
from entropy_explore_env.frontiers.voxel_map import body_footprint
from entropy_explore_env.planner.frontier_rule import Scene
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.scenarios import OFFICE_3D
from entropy_explore_env.viewpoints import evaluation
from tests.reference.scenes import drawn, seeds

DRONE = with_settings(
    OFFICE_3D,
    {"grid": Grid((60, 20, 12), 0.1), "robots": 1, "robot": {"body_radius_m": 0.3, "reach_m": 3.0}},
)


@given(st.sampled_from([(9, 6, 7), (5, 11, 8), (13, 9, 1)]), st.integers(1, 9), st.floats(0.05, 0.4), seeds)
@drawn(60)
def test_the_nearest_cells_that_touch_a_large_one_of_scipys_labels_are_found(shape, least, share, seed):
    rng = np.random.default_rng(seed)
    layer = 0 if shape[2] == 1 else None
    state = np.zeros(math.prod(shape), np.uint8)
    blocks = new_blocks(shape, state, body_footprint(shape, 1.3, layer), layer, 3)
    groups = new_groups(len(state), least)
    for _ in range(2):  # the second time as after a change of the edges
        edge, dropped = rng.random(shape) < share, rng.random(shape) < 0.2
        blocks.flags[:] = np.where(edge.ravel(), EDGE, 0) | np.where(dropped.ravel(), DROPPED, 0)
        blocks.edges[:] = 1
        labels, _ = ndimage.label(edge & ~dropped, np.ones((3, 3, 3)))
        large = (np.bincount(labels.ravel())[labels] >= least) & (labels > 0)
        groups.forget()

        body = np.zeros((2 * blocks.reach + 1,) * 3, bool)
        body[tuple((blocks.footprint + blocks.reach).T)] = True
        touching = ndimage.binary_dilation(large, body).ravel() | (least == 1)
        cells = rng.permutation(len(state)).astype(np.int32)
        lengths = rng.integers(0, 9, len(state)).astype(float)
        lengths[lengths == 8] = np.inf
        of_block, nearest = rng.integers(0, 5, len(state)).astype(np.int32), np.full(5, NONE)
        fill_nearest(blocks, groups, cells, lengths, of_block, 5.0, nearest)
        allowed = np.where(touching[cells] & (lengths <= 5.0), lengths, np.inf)
        for block in range(5):
            worth = np.where(of_block == block, allowed, np.inf)
            assert nearest[block] == (int(np.argmin(worth)) if np.isfinite(worth).any() else NONE)
        if least > 1:
            assert any_large(blocks, groups) == large.any()
            groups.forget()
            assert any_large(blocks, groups) == large.any()


def hall(unknown, least_m2=0.5, walls=()):
    """A hall that a drone at (15, 10, 6) knows, but for boxes of voxels; cells are of two voxels.

    Each of `walls` is the x of a wall across the hall.
    """
    mean, precision = (
        np.full(DRONE.grid.shape, 0.05, np.float32),
        np.full(DRONE.grid.shape, 100.0, np.float32),
    )
    for low, high in unknown:
        precision[tuple(slice(*ends) for ends in zip(low, high, strict=True))] = 30.0**-2
    mean[list(walls)] = 0.95
    view = SimpleNamespace(
        mean=mean, precision=precision, scenario=DRONE, teammates={}, robot=0, since_scan_m=0.0
    )
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(evaluation, "_CELLS_WITHIN", 7)
        patched.setattr(voxel_frontiers, "LEAST_GROUP_M2", least_m2)
        assert evaluation.cell_edge(DRONE, DRONE.kind_of(0)) == 2
        cells = VoxelFrontiers(DRONE, DRONE.kind_of(0))
        paths = KnownPaths(DRONE, DRONE.kind_of(0), cells, new_search(DRONE.grid.voxels))
    cells.update(view, 0.5)  # type: ignore[arg-type]
    here = int(np.ravel_multi_index((15, 10, 6), DRONE.grid.shape))
    paths.start(here)
    return Scene(view, cells, paths, here, NONE, NONE)  # type: ignore[arg-type]


def test_drones_go_to_a_large_group_past_a_small_one_and_to_small_ones_at_last_by_hand():
    sliver, wall = ((15, 1, 4), (16, 2, 8)), ((50, 0, 0), (60, 20, 12))
    scene = hall([sliver, wall])
    x, y, _ = np.unravel_index(NearestFrontier().pick(scene), DRONE.grid.shape)
    assert x == 46  # the body, of three voxels, touches the last known ones at 49
    assert len(scene.paths.frontiers_within(20.0)[0]) == 0 and len(scene.paths.frontiers_within(40.0)[0]) > 0
    behind_a_wall = hall([sliver, wall], walls=(30,))
    for scene in (hall([sliver]), behind_a_wall):
        x, y, _ = np.unravel_index(NearestFrontier().pick(scene), DRONE.grid.shape)
        assert abs(x - 15) <= 4 and y <= 6
    assert len(behind_a_wall.paths.frontiers_within(20.0)[0]) == 0


def test_a_group_that_shrinks_or_is_dropped_is_large_no_longer_by_hand():
    """Groups of 50 voxels are large; the wall's has 12 for each of its rows along y."""
    sliver = ((15, 1, 4), (16, 2, 8))

    def picked(scene):
        return np.unravel_index(NearestFrontier().pick(scene), DRONE.grid.shape)[0]

    scene = hall([sliver, ((50, 0, 0), (60, 20, 12))], least_m2=2.3)
    flags = scene.cells._marks.reshape(DRONE.grid.shape)[49]
    while picked(scene) == 46:
        before = int((flags & (EDGE | DROPPED) == EDGE).sum())
        scene.cells.drop(int(NearestFrontier().pick(scene)), with_edges=True)
    assert before >= 230 > int((flags & (EDGE | DROPPED) == EDGE).sum()) > 200

    scene = hall([sliver, ((50, 0, 0), (60, 20, 12))])
    for rows, large in ((20, True), (5, True), (4, False), (6, True)):
        precision, mean = scene.view.precision, scene.view.mean
        precision[50:60], precision[50:60, :rows], mean[50:60, rows:] = 100.0, 30.0**-2, 0.95
        scene.cells.update(scene.view, 0.5)
        assert (picked(scene) == 46) == large
