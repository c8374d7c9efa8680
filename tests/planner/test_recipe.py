"""Recipes go by what a robot is."""

from __future__ import annotations

import pytest

from entropy_explore_env.planner.recipe import (
    ALL_AROUND,
    NARROW_PLANNED,
    NARROW_STRAIGHT,
    angular_spread,
    recipe_for,
)
from entropy_explore_env.settings.scenarios import SCENARIOS


@pytest.mark.parametrize(
    ("name", "recipe"),
    [
        ("room", NARROW_STRAIGHT),
        ("terrain", NARROW_STRAIGHT),
        ("cave", NARROW_PLANNED),
        ("lab", NARROW_PLANNED),
        ("occlusions", NARROW_PLANNED),
        ("office", ALL_AROUND),
    ],
)
def test_the_recipe_is_that_of_the_robot(name, recipe):
    assert recipe_for(SCENARIOS[name].kinds[0]) is recipe


def test_gazes_of_scanners_vary_between_rays_and_of_others_by_half_a_view():
    office, room = SCENARIOS["office"].kinds[0], SCENARIOS["room"].kinds[0]
    assert angular_spread(office) == pytest.approx(0.25 * office.sensor.angular_step_rad)
    assert angular_spread(room) == pytest.approx(0.5 * room.sensor.field_of_view_rad[0])
