"""Columns in which a rover is safe."""

from __future__ import annotations

from baselines.strategies.next_best_view.ground_map import safe_columns
from entropy_explore_env.settings.scenarios import CLIFF
from entropy_explore_env.worlds.load import make_world
from entropy_explore_env.worlds.world import Collision


def test_columns_are_safe_where_the_body_fits_on_the_plateau():
    world = make_world(CLIFF, 5)
    layer = CLIFF.layer_of(CLIFF.robot)
    fits = world.layout(CLIFF).collision_mask[:, :, layer] == Collision.NONE
    safe = safe_columns(world.occupied.sum(axis=2) == 24, 0.3 / 0.125)
    assert (fits[safe]).all() and safe.sum() > 0.8 * fits.sum()
