"""Columns in which a rover is safe, and its paths over them."""

from __future__ import annotations

import numpy as np

from baselines.strategies.next_best_view.plateau import PlateauPaths, safe_columns
from entropy_explore_env.scenarios import CLIFF
from entropy_explore_env.worlds.load import make_world
from entropy_explore_env.worlds.world import Collision


def test_columns_are_safe_where_the_body_fits_on_the_plateau():
    world = make_world(CLIFF, 5)
    layer = CLIFF.layer_of(CLIFF.robot)
    fits = world.layout(CLIFF).collision_mask[:, :, layer] == Collision.NONE
    safe = safe_columns(world.occupied.sum(axis=2) == 24, 0.3 / 0.125)
    assert (fits[safe]).all() and safe.sum() > 0.8 * fits.sum()


def test_paths_turn_at_corners_of_what_is_safe():
    safe = np.ones((9, 7), bool)
    safe[4, :5] = False
    paths = PlateauPaths((9, 7))
    reachable = paths.start(safe, (1, 1))
    np.testing.assert_array_equal(reachable, safe)
    corner = paths.first_corner(np.array([1.5, 1.5]), np.array([7.5, 1.5]))
    assert corner[1] > 4.0 and corner.tolist() != [7.5, 1.5]
    assert paths.first_corner(np.array([1.5, 1.5]), np.array([1.5, 6.5])).tolist() == [1.5, 6.5]
    safe[4] = False
    assert not paths.start(safe, (1, 1))[5:].any()
