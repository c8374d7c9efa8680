"""What all recipes promise: connected space for bodies, the same world from the same draws, refusals."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage

from entropy_explore_env.errors import WorldError
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.scenarios import SCENARIOS
from entropy_explore_env.worlds.recipes.catalogue import RECIPES

BODY_M = 0.3
NATURAL = {name: scenario for name, scenario in SCENARIOS.items() if scenario.world in RECIPES}
WORLDS = {
    "room": (50, 1.0, 1.0),
    "box-7x11x5": (50, 1.0, 1.0),
    "room-furnished": (50, 0.9, 0.99),
    "office": (50, 0.94, 0.98),
    "office-signal": (50, 0.94, 0.98),
    "office-3d": (50, 0.84, 0.92),
    "office-mixed": (50, 0.7, 0.92),
    "corridor": (50, 0.2, 0.55),
    "cluttered": (15, 0.82, 0.9),
    "hybrid": (15, 0.5, 0.85),
    "cave": (12, 0.06, 0.25),
    "terrain": (50, 0.4, 0.8),
    "terrain-smooth": (50, 0.4, 0.85),
    "terrain-rough": (50, 0.4, 0.8),
    "occlusions": (20, 0.85, 0.9),
    "cliff": (20, 0.5, 0.75),
    "lab": (30, 0.88, 0.98),
    "bhattacharya-office": (50, 0.94, 0.98),
    "bhattacharya-cluttered": (3, 0.85, 0.88),
}
"""Scenario → how many worlds, 50 where one takes a millisecond or two; least and most of the free share."""
OTHER_GRIDS = {
    "office": [
        Grid((121, 233, 1), 0.07),
        Grid((37, 29, 7), 0.4),
        Grid((25, 41, 1), 1.0),
        Grid((60, 85, 26), 0.1),
    ],
    "corridor": [Grid((61, 97, 1), 0.2), Grid((37, 29, 7), 0.4), Grid((17, 9, 1), 1.0)],
    "cluttered": [Grid((61, 97, 1), 0.1), Grid((41, 29, 9), 0.3), Grid((23, 17, 1), 0.7)],
    "hybrid": [Grid((101, 163, 1), 0.2), Grid((67, 53, 5), 0.4), Grid((29, 23, 1), 1.0)],
    "cave": [Grid((61, 97, 1), 0.2), Grid((53, 67, 23), 0.25), Grid((41, 23, 11), 0.8)],
    "terrain": [Grid((31, 47, 29), 0.3), Grid((13, 9, 11), 2.0), Grid((9, 7, 8), 1.0)],
    "terrain-smooth": [Grid((31, 47, 29), 0.3), Grid((9, 7, 8), 1.0)],
    "terrain-rough": [Grid((31, 47, 29), 0.3), Grid((9, 7, 8), 1.0)],
    "occlusions": [Grid((101, 83, 1), 0.6), Grid((47, 53, 4), 1.0)],
    "cliff": [Grid((31, 47, 20), 0.3), Grid((23, 17, 9), 0.5), Grid((67, 53, 31), 0.15)],
    "lab": [Grid((37, 43, 1), 0.1), Grid((17, 13, 7), 0.3), Grid((9, 7, 3), 0.6)],
    "bhattacharya-office": [Grid((61, 83, 1), 0.25), Grid((53, 37, 6), 0.4), Grid((15, 17, 1), 1.0)],
    "bhattacharya-cluttered": [Grid((211, 173, 1), 0.1), Grid((61, 47, 4), 0.5), Grid((29, 37, 1), 1.0)],
}
SMALLEST_M = {
    "office": (8.0, 6.0),
    "corridor": (8.0, 4.0),
    "cluttered": (6.0, 5.0),
    "hybrid": (20.0, 16.0),
    "cave": (12.0, 10.0),
    "terrain": (6.0, 6.0),
    "terrain-smooth": (6.0, 6.0),
    "terrain-rough": (6.0, 6.0),
    "occlusions": (40.0, 40.0),
    "cliff": (8.0, 6.0),
    "lab": (4.0, 3.0),
    "bhattacharya-office": (14.0, 12.0),
    "bhattacharya-cluttered": (20.0, 16.0),
}

HILLY = {"terrain", "terrain-smooth", "terrain-rough", "cliff"}
"""Recipes of worlds in 3-D alone."""


def parts(room):
    return ndimage.label(room)[1]


def require_connected(world, what):
    """All places of a body, and all free voxels, are one part each."""
    assert parts(world.collision_mask(BODY_M) == 0) == 1, what
    assert parts(~world.occupied) == 1, what


@pytest.mark.parametrize("name", NATURAL)
def test_robots_of_its_scenario_can_go_wherever_they_fit(name):
    scenario = NATURAL[name]
    count, low, high = WORLDS[name]
    plane = scenario.layer_of(scenario.robot)
    hashes = set()
    for seed in range(count):
        world = RECIPES[scenario.world](scenario.grid, np.random.default_rng(seed))
        assert world.grid == scenario.grid and world.name == scenario.world
        if scenario.world != "furnished":
            require_connected(world, f"{name} {seed}")
        layout = world.layout(scenario)
        room = layout.collision_mask == 0 if plane is None else layout.collision_mask[:, :, plane] == 0
        assert len(layout.starts) == room.sum(), f"{name} {seed}: {parts(room)} parts"
        assert low <= (~world.occupied).mean() <= high, f"{name} {seed}: {(~world.occupied).mean()}"
        hashes.add(world.occupied.tobytes())
    assert len(hashes) == (1 if scenario.world == "empty" else count)


@pytest.mark.parametrize(
    ("name", "grid"), [(name, grid) for name, grids in OTHER_GRIDS.items() for grid in grids]
)
def test_other_grids_are_connected_too(name, grid):
    for seed in range(4):
        world = RECIPES[name](grid, np.random.default_rng(seed))
        assert world.grid is grid
        require_connected(world, f"{name} {grid} {seed}")
        assert 0.03 < (~world.occupied).mean() < 1.0 - 1e-9 or min(grid.size_m[:2]) < 6.0


@pytest.mark.parametrize("name", [name for name in NATURAL if name != "bhattacharya-cluttered"])
def test_the_same_draws_give_the_same_world_and_nothing_else_plays_a_part(name):
    recipe, grid = RECIPES[NATURAL[name].world], NATURAL[name].grid
    first = recipe(grid, np.random.default_rng(7))
    np.random.default_rng(8).random()
    second = recipe(grid, np.random.default_rng(7))
    np.testing.assert_array_equal(first.occupied, second.occupied)
    if first.ceiling is None:
        assert second.ceiling is None
    else:
        np.testing.assert_array_equal(first.ceiling, second.ceiling)


def test_every_recipe_is_tried_on_other_grids_and_on_too_small_ones():
    assert set(OTHER_GRIDS) == set(SMALLEST_M) == set(RECIPES) - {"empty", "furnished"}
    assert set(WORLDS) == set(NATURAL)


@pytest.mark.parametrize("name", SMALLEST_M)
def test_a_grid_that_is_too_small_is_refused_by_name(name):
    edge_m, (longest, shortest) = 0.2, SMALLEST_M[name]
    high = round(5.4 / edge_m) if name in HILLY else 1
    long, short = round(longest / edge_m), round(shortest / edge_m)
    assert RECIPES[name](Grid((long, short, high), edge_m), np.random.default_rng(0)).occupied.any()
    assert RECIPES[name](Grid((short, long, high), edge_m), np.random.default_rng(1)).occupied.any()
    too_small = [(long, short - 1, high), (short - 1, long, high), (1, 1, high), (1, 1, 1), (long, 2, 2)]
    too_small += [(long, short, 2)]  # no room for a body of 0.6 m between floor and ceiling
    if long > short:
        too_small.append((long - 1, short, high))
    for shape in too_small:
        with pytest.raises(WorldError, match=r"Grid\.shape = .*: expected .* m") as raised:
            RECIPES[name](Grid(shape, edge_m), np.random.default_rng(0))
        assert raised.value.field == "Grid.shape" and raised.value.value == shape


@pytest.mark.parametrize("name", [name for name in SMALLEST_M if name not in HILLY])
def test_voxels_in_which_rooms_and_ways_get_lost_are_refused_by_name(name):
    """A net of corridors over voxels of 1,000 km was never finished."""
    draws = np.random.default_rng(0)
    assert RECIPES[name](Grid((60, 50, 1), 2.5), draws).occupied.any()
    for edge_m in (2.51, 1e6):
        with pytest.raises(WorldError) as raised:
            RECIPES[name](Grid((60, 50, 1), edge_m), draws)
        assert (raised.value.field, raised.value.value) == ("Grid.voxel_size_m", edge_m)
