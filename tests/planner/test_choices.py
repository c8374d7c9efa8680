"""What decides by hand: the recipe of a robot, a planner's next state, and the target of a tour."""

import math

import numpy as np
import pytest

from entropy_explore_env.frontiers.blocks import NONE
from entropy_explore_env.planner.model import new_proposers
from entropy_explore_env.planner.recipe import (
    ALL_AROUND,
    MANY_RAYS,
    NARROW_PLANNED,
    NARROW_STRAIGHT,
    angular_spread,
    recipe_for,
)
from entropy_explore_env.planner.scene import best_of
from entropy_explore_env.planner.states import PlannerState, next_state
from entropy_explore_env.planner.thresholds import DEPLETED_SCANS
from entropy_explore_env.planner.tour import Tour
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.scenarios import SCENARIOS
from tests.planner.scenes import cell, corridor, scene_of, varied


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
    assert recipe_for(SCENARIOS[name], SCENARIOS[name].kinds[0]) is recipe


@pytest.mark.parametrize(
    ("rows", "seen_share", "voxel_size_m", "thinnings"),
    [
        (17, 0.99, 0.1, (2, 4)),
        (16, 0.99, 0.1, (1, 1)),  # fewer than MANY_RAYS
        (17, None, 0.1, (1, 2)),
        (17, 0.99, 0.4, (1, 2)),
    ],
)
def test_of_many_rays_a_quarter_is_imagined_where_drones_look_for_the_unseen_in_fine_grids(
    rows, seen_share, voxel_size_m, thinnings
):
    step_rad = math.pi / 60
    view_rad = (2.0 * math.pi, (rows - 0.5) * step_rad)
    many = with_settings(
        SCENARIOS["office-3d"],
        {
            "sensor": {"field_of_view_rad": view_rad, "angular_step_rad": step_rad},
            "robot": {"reach_m": 10.0},
            "grid": Grid((200, 100, 20), voxel_size_m),
            "ending": {"seen_share": seen_share},
            "track_truth": True,
            "action": {"kind": "candidates"},
        },
    )
    assert many.kinds[0].sensor.rays == 120 * rows and (120 * rows >= MANY_RAYS) == (rows == 17)
    proposer = new_proposers(many)[0]
    for scan, thinning in zip((proposer.refined, proposer.drawn), thinnings, strict=True):
        assert (len(scan.yaws), len(scan.pitches)) == (120 // thinning, rows // thinning)


def test_gazes_of_scanners_vary_between_rays_and_of_others_by_half_a_view():
    office, room = SCENARIOS["office"].kinds[0], SCENARIOS["room"].kinds[0]
    assert angular_spread(office) == pytest.approx(0.25 * office.sensor.angular_step_rad)
    assert angular_spread(room) == pytest.approx(0.5 * room.sensor.field_of_view_rad[0])


@pytest.mark.parametrize(
    ("low_gain_scans", "leaves", "best_bits", "gives_way", "state"),
    [
        (0, False, math.inf, False, PlannerState.EXPLORING),
        (DEPLETED_SCANS - 1, True, 1.0, False, PlannerState.LEAVING),
        (DEPLETED_SCANS, True, 1.0, False, PlannerState.DEPLETED),
        (DEPLETED_SCANS, True, 1e-6, False, PlannerState.WANDERING),
        (0, False, 1.0, True, PlannerState.WANDERING),
    ],
)
def test_what_is_most_urgent_decides(low_gain_scans, leaves, best_bits, gives_way, state):
    assert next_state(low_gain_scans, leaves, best_bits, gives_way) == state


def test_a_cell_as_good_as_the_target_does_not_replace_it():
    voxels, worth = np.array([4, 9, 2]), np.array([1.0, 3.0, 3.0])
    assert [best_of(voxels, worth, target) for target in (2, 9, 4)] == [2, 9, 9]
    assert best_of(voxels, np.full(3, -np.inf), 4) == NONE and best_of(voxels[:0], worth[:0], 4) == NONE


def test_a_tour_of_both_ends_begins_with_the_nearer_and_keeps_its_target_when_that_is_as_good():
    plan = corridor()
    assert cell(plan, varied(Tour(), near=1.5, cover=0.5).pick(scene_of(plan, (8, 1)))) == (1, 1)
    assert cell(plan, varied(Tour(), near=1.5, cover=0.5).pick(scene_of(plan, (20, 1)))) == (27, 1)
    right = int(np.ravel_multi_index((27, 1), plan.shape))
    near_middle = scene_of(plan, (13, 1), target=right)
    assert cell(plan, varied(Tour(), near=1.5, cover=0.5, stay=0.2).pick(near_middle)) == (27, 1)
    restless = varied(Tour(), near=1.5, cover=0.5, stay=0.0)
    assert cell(plan, restless.pick(scene_of(plan, (13, 1), target=right))) == (1, 1)
