"""Scans on the path to a viewpoint: where they are, by hand, and what all of them bring, ray by ray."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from entropy_explore_env.belief.fields import Belief
from entropy_explore_env.belief.paths.lattice import belief_costs, new_lattice
from entropy_explore_env.belief.paths.planning import search_paths
from entropy_explore_env.belief.paths.search import extract_path, new_search
from entropy_explore_env.belief.raycast import longest_crossing
from entropy_explore_env.belief.visibility import CONE
from entropy_explore_env.missions.view import view_of
from entropy_explore_env.scenario import with_settings
from entropy_explore_env.scenarios import BOX
from entropy_explore_env.viewpoints.evaluation import robot_model
from entropy_explore_env.viewpoints.expected_scan import new_scan_scratch
from entropy_explore_env.viewpoints.imagined_scan import imagine_scan, imagined_bits
from entropy_explore_env.viewpoints.path_scans import combined_bits, fill_path_scans
from entropy_explore_env.viewpoints.travel import STRAIGHTENED
from tests.reference.scenes import drawn, free_box, seeds, started

SIZE = (7, 11, 5)
NOWHERE = np.zeros(0, np.int32)


def scans(here, at, every, since_scan, most, path=NOWHERE, layer=None, reach=math.inf):
    poses = np.zeros((most, 5))
    lattice = new_lattice(SIZE, 0.0, layer)
    here, at = np.array(here, float), np.array(at, float)
    return poses[: fill_path_scans(lattice, SIZE, path, len(path), here, at, every, since_scan, reach, poses)]


def along_y(*args, **kwargs):
    return scans(*args, **kwargs)[:, 1].tolist()


def test_on_a_straight_drive_by_hand():
    """Eight edges along y, a scan every two: after 2, 4 and 6, the one at 8 is that at the viewpoint."""
    here, at = (3.5, 1.5, 2.5, 0.3, 0.1), (3.5, 9.5, 2.5, 1.2, -0.4)
    poses = scans(here, at, 2.0, 0.0, 9)
    assert poses[:, 1].tolist() == pytest.approx([3.5, 5.5, 7.5])
    assert (poses[:, [0, 2, 3, 4]] == [3.5, 2.5, 1.2, -0.4]).all()
    assert along_y(here, at, 2.0, 1.5, 9) == pytest.approx([2.0, 4.0, 6.0, 8.0])
    assert along_y(here, at, 2.0, 0.0, 1) == pytest.approx([5.5])  # of three: the one in the middle
    assert along_y(here, at, 2.0, 0.0, 2) == pytest.approx([3.5, 7.5])
    assert along_y(here, at, 1.0, 0.0, 3) == pytest.approx([3.5, 5.5, 7.5])  # of seven
    for every, most in ((8.0, 9), (math.inf, 9), (2.0, 0)):
        assert len(scans(here, at, every, 0.0, most)) == 0
    assert len(scans(here, here, 2.0, 2.1, 9)) == 0  # it stays where it is


def test_at_stops_and_between_them_by_hand():
    """Eight edges in hops of at most three: three of 8/3, each with a scan after two, from a stop on."""
    here, at = (3.5, 1.5, 2.5, 0.0, 0.0), (3.5, 9.5, 2.5, 0.0, 0.0)
    stops = [1.5 + 8 / 3, 1.5 + 16 / 3]
    assert along_y(here, at, math.inf, 0.0, 9, reach=3.0) == pytest.approx(stops)
    between = [3.5, stops[0], stops[0] + 2.0, stops[1], stops[1] + 2.0]
    assert along_y(here, at, 2.0, 0.0, 9, reach=3.0) == pytest.approx(between)
    assert along_y(here, at, 2.0, 1.0, 9, reach=3.0) == pytest.approx([2.5, *between[1:]])
    assert along_y(here, at, 2.0, 1.9, 9, reach=3.0) == pytest.approx([1.6, 3.6, *between[1:]])


@pytest.mark.parametrize("layer", [None, 2])
def test_around_a_corner_by_hand(layer):
    """Four voxels along x, then four along y: driven 0.96 times as far, a scan every 1.92 edges."""
    steps = [(1, 2, 2), (2, 2, 2), (3, 2, 2), (4, 2, 2), (5, 2, 2), *((5, y, 2) for y in (3, 4, 5, 6))]
    path = np.array([np.ravel_multi_index(step, SIZE) for step in steps], np.int32)
    here, at = (1.5, 2.5, 2.1, 0.0, 0.0), (5.5, 6.5, 2.1, 0.0, 0.0)
    poses = scans(here, at, 2.0 * STRAIGHTENED, 0.0, 9, path, layer)
    assert poses[:, :2].tolist() == [[3.5, 2.5], [5.5, 2.5], [5.5, 4.5]]
    assert (poses[:, 2] == (2.5 if layer is None else 2.1)).all()


def test_along_a_path_without_corners_by_hand():
    """No shorter than the straight line: nine voxels, eight edges, a scan every two."""
    path = np.array([np.ravel_multi_index((3, y, 2), SIZE) for y in range(1, 10)], np.int32)
    here, at = (3.5, 1.5, 2.5, 0.0, 0.0), (3.5, 9.5, 2.5, 0.0, 0.0)
    assert along_y(here, at, 2.0, 0.0, 9, path) == [3.5, 5.5, 7.5]


@given(st.floats(0.3, 4.0), st.floats(0.0, 1.0), seeds)
@drawn(40)
def test_scans_are_those_that_a_view_foretells(every_m, share, seed):
    """On a straight drive, whatever was driven before; in the box, voxels of 0.5 m."""
    rng = np.random.default_rng(seed)
    missions = started(free_box(sensor={"scan_every_m": every_m}, robot={"reach_m": math.inf}))
    view = dataclasses.replace(view_of(missions, 0, 0), since_scan_m=share * every_m)
    grid = missions.grid
    target = view.pose.copy()
    target[:3] = np.asarray(grid.origin_m) + rng.random(3) * grid.size_m
    wanted = view.scan_places(target[None, :3])
    here, at = grid.in_grid_units(view.pose), grid.in_grid_units(target)
    every, since_scan = every_m / grid.voxel_size_m, view.since_scan_m / grid.voxel_size_m
    poses = scans(here, at, every, since_scan, 200)
    assert len(poses) == len(wanted)
    np.testing.assert_allclose(
        poses[:, :3], [grid.in_grid_units(p)[:3] for p in wanted] or poses[:, :3], atol=1e-6
    )


def test_a_path_is_that_of_the_search():
    mean, precision = np.zeros(SIZE, np.float32), np.full(SIZE, 100.0, np.float32)
    mean[3, :10] = 1.0  # a wall with a gap at y = 10
    search, lattice = new_search(mean.size), new_lattice(SIZE, 0.0, None)
    start, goal = (int(np.ravel_multi_index(v, SIZE)) for v in ((1, 2, 2), (5, 2, 2)))
    costs = belief_costs(mean, precision, 1e-3)
    search_paths(search, lattice, costs, np.array([start], np.int32), goal, math.inf)
    path = np.zeros(mean.size, np.int32)
    count = extract_path(search, lattice, goal, path)
    assert path[0] == start and path[count - 1] == goal
    assert (np.stack(np.unravel_index(path[:count], SIZE))[1].max()) == 10
    shut = int(np.ravel_multi_index((3, 2, 2), SIZE))
    assert extract_path(search, lattice, shut, path) == 0


@given(st.integers(0, 4), seeds)
@drawn(30)
def test_all_scans_bring_what_their_precision_adds_up_to(count, seed):
    """Σ ½ log2(1 + Σ added/p), scan by scan in NumPy; with none on the path that of the viewpoint alone."""
    rng = np.random.default_rng(seed)
    mean = np.where(rng.random(SIZE) < 0.15, 0.9, 0.1).astype(np.float32).reshape(-1)
    precision = np.where(rng.random(SIZE) < 0.5, 1e-3, 100.0).astype(np.float32).reshape(-1)
    scenario = with_settings(BOX, {"sensor": {"angular_step_rad": math.pi / 12}})
    scan, belief = robot_model(scenario, scenario.kinds[0], 1, 0.1).scan, Belief(mean, precision, SIZE)
    longest = longest_crossing(*SIZE, math.inf, scan.voxels_behind + 1)
    scratch = new_scan_scratch(mean.size, longest, len(scan.pitches))
    looks = np.concatenate([rng.random((count + 1, 3)) * SIZE, rng.uniform(-1.5, 1.5, (count + 1, 2))], 1)
    total = np.zeros(mean.size)
    for look in looks:
        touched = imagine_scan(belief, scan, 0.5, look, scratch, 0)
        total += scratch.added
        scratch.added[scratch.touched[:touched]] = 0.0
    found = combined_bits(belief, scan, 0.5, looks[:-1], looks[-1], scratch)
    assert found == pytest.approx(0.5 * np.log2(1.0 + total / precision).sum(), rel=1e-4, abs=1e-6)
    assert not scratch.added.any()
    alone = np.zeros(1)
    imagined_bits(belief, scan, 0.5, looks[-1:], np.zeros(0, CONE), scratch, alone)
    assert found >= alone[0] * (1.0 - 1e-6)
    if count == 0:
        assert found == alone[0]
