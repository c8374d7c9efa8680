"""Recipes go by what a robot is, and refuse what makes no sense."""

from __future__ import annotations

import pytest

from entropy_explore_env.errors import SettingError
from entropy_explore_env.planner.recipe import (
    ALL_AROUND,
    NARROW_PLANNED,
    NARROW_STRAIGHT,
    angular_spread,
    checked,
    recipe_for,
)
from entropy_explore_env.scenarios import SCENARIOS


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


@pytest.mark.parametrize(
    "change",
    [
        {"exponent": 0.0},
        {"gap_probability": 1.5},
        {"stop_probability": -0.1},
        {"draw_thinning": 0},
        {"refined": 0},
        {"known_ground_share": float("nan")},
        {"far_places": 2.5},
        {"leave_below": -0.1},
        {"behind": float("inf")},
        {"gazes": 0, "turns": 0, "places": 0},
    ],
)
def test_what_makes_no_sense_is_refused_by_name(change):
    with pytest.raises(SettingError, match=r"Recipe\."):
        checked(ALL_AROUND._replace(**change))


def test_whole_numbers_become_the_types_for_which_kernels_are_compiled():
    recipe = checked(ALL_AROUND._replace(exponent=1, gazes=True + 1))
    assert [type(number) for number in recipe] == [type(number) for number in ALL_AROUND]
