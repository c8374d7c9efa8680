"""Corridors, hybrids, caves, Sujan's, RochaMI's and Bhattacharya's worlds: what makes each what it is."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage

from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.scenarios import (
    BHATTACHARYA_CLUTTERED,
    BHATTACHARYA_OFFICE,
    CAVE,
    CLUTTERED,
    CORRIDOR,
    HYBRID,
    LAB,
    OCCLUSIONS,
)
from entropy_explore_env.worlds.recipes.bhattacharya import bhattacharya_cluttered, bhattacharya_office
from entropy_explore_env.worlds.recipes.cave import cave
from entropy_explore_env.worlds.recipes.corridor import corridor
from entropy_explore_env.worlds.recipes.hybrid import hybrid
from entropy_explore_env.worlds.recipes.obstacles import cluttered, occlusions
from entropy_explore_env.worlds.recipes.rooms import lab
from tests.worlds.recipes.test_obstacles import distances


def rng(seed):
    return np.random.default_rng(seed)


def plan_of(recipe, scenario, seed):
    return recipe(scenario.grid, rng(seed)).occupied[:, :, 0]


def widest_m(plan, edge_m):
    """Diameter of the largest disc of free space, walls around."""
    return 2.0 * edge_m * distances(np.pad(~plan, 1)).max()


@pytest.mark.parametrize(
    ("scenario", "size_m", "voxel_size_m", "robots"),
    [
        (OCCLUSIONS, (100.0, 100.0), 0.5, 1),
        (LAB, (5.0, 4.6), 0.1, 2),
        (BHATTACHARYA_OFFICE, (17.0, 20.0), 0.1, 5),
        (BHATTACHARYA_CLUTTERED, (100.0, 78.3), 0.1, 4),
    ],
)
def test_scenarios_of_papers_are_what_they_say(scenario, size_m, voxel_size_m, robots):
    assert tuple(scenario.grid.size_m[:2]) == pytest.approx(size_m)
    assert (scenario.grid.voxel_size_m, scenario.robots) == (voxel_size_m, robots)
    assert LAB.robot.motion == "planar" and OCCLUSIONS.sensor.max_range_m == 15.0
    assert np.degrees(OCCLUSIONS.sensor.field_of_view_rad[0]) == pytest.approx(90.0)


def test_corridors_are_narrow_and_long():
    for seed in range(10):
        plan = plan_of(corridor, CORRIDOR, seed)
        assert 1.2 <= widest_m(plan, 0.1) <= 5.0
        opened = ndimage.binary_opening(~plan, np.ones((12, 12)))  # 1.2 m: nothing is narrower
        np.testing.assert_array_equal(opened, ~plan)


def test_corridors_of_3_d_worlds_are_as_high_as_the_world():
    occupied = corridor(Grid((80, 50, 11), 0.25), rng(0)).occupied
    assert (occupied == occupied[:, :, :1]).all()


def test_clutter_in_3_d_has_heights():
    occupied = cluttered(Grid((80, 64, 14), 0.25), rng(1)).occupied
    heights = np.unique(occupied.sum(axis=2))
    assert len(heights) > 5 and heights.max() <= 12  # 3 m
    assert (occupied[:, :, :-1] | ~occupied[:, :, 1:]).all()
    assert widest_m(plan_of(cluttered, CLUTTERED, 0), 0.1) < 8.0


def test_a_hybrid_has_solid_parts_walls_and_wide_parts():
    for seed in range(5):
        plan = plan_of(hybrid, HYBRID, seed)
        depth = distances(plan)
        assert depth.max() * 0.1 > 0.8  # rock between corridors
        thin = plan & ~ndimage.binary_opening(plan, np.ones((3, 3)))
        assert thin.sum() > 500  # walls
        numbers, count = ndimage.label(plan)
        sizes = np.bincount(numbers.ravel())[1:]
        assert ((sizes > 20) & (sizes < 800)).sum() > 8 and count < 150  # obstacles


def test_caves_are_hollows_in_rock_on_several_levels():
    for seed in range(4):
        occupied = cave(CAVE.grid, rng(seed)).occupied
        levels = np.flatnonzero((~occupied).any(axis=(0, 1)))
        assert np.ptp(levels) * CAVE.grid.voxel_size_m > 4.0
        distance_m = distances(~occupied) * CAVE.grid.voxel_size_m
        assert 1.2 < distance_m.max() < 4.5  # halls, yet not one hall
        roughness = (ndimage.binary_dilation(occupied) & ~occupied).sum() / (~occupied).sum()
        assert roughness > 0.2
    plan = cave(Grid((160, 120, 1), 0.2), rng(0)).occupied
    assert 0.25 < (~plan).mean() < 0.6


def test_the_middle_of_sujan_s_world_is_open():
    for seed in range(20):
        plan = plan_of(occlusions, OCCLUSIONS, seed)
        assert not plan[95:105, 95:105].any()
        assert 10 < ndimage.label(plan)[1] < 80


def test_the_lab_has_furniture_of_several_heights_for_ground_robots():
    counts = []
    for seed in range(20):
        occupied = lab(LAB.grid, rng(seed)).occupied
        assert (occupied[:, :, :-1] | ~occupied[:, :, 1:]).all()
        counts.append(ndimage.label(occupied[:, :, 0])[1])
        assert occupied[:, :, 4].any()  # seen at the sensor's height
    assert np.mean(counts) > 4


def test_bhattacharya_s_office_has_a_corridor_in_a_ring():
    for seed in range(20):
        plan = plan_of(bhattacharya_office, BHATTACHARYA_OFFICE, seed)
        numbers, count = ndimage.label(ndimage.binary_opening(~plan, np.ones((12, 12))))  # doors shut
        assert count >= 12
        around = [
            number
            for number in range(1, count + 1)
            if numbers[85, 100] != number
            and np.asarray(ndimage.binary_fill_holes(numbers == number))[85, 100]
        ]
        assert len(around) == 1, "one part of the free space runs around the middle"
        assert widest_m(numbers != around[0], 0.1) < 3.0


def test_bhattacharya_s_large_map_has_rooms_and_clutter():
    plan = plan_of(bhattacharya_cluttered, BHATTACHARYA_CLUTTERED, 0)
    along_x = (ndimage.binary_opening(plan, np.ones((40, 1)))).sum()
    along_y = (ndimage.binary_opening(plan, np.ones((1, 40)))).sum()
    assert along_x > 5000 and along_y > 5000  # walls of 4 m and more
    assert ndimage.label(plan)[1] > 100  # obstacles that stand alone
