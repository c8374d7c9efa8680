"""Candidates: where they lie, what is said of each, and that refining them never loses the best."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from entropy_explore_env.belief.fields import Belief
from entropy_explore_env.belief.visibility import CONE
from entropy_explore_env.scenario import with_settings
from entropy_explore_env.scenarios import BOX, OFFICE
from entropy_explore_env.settings import Grid
from entropy_explore_env.viewpoints.candidates import CandidatePlanner, Kind, Situation
from entropy_explore_env.viewpoints.recipe import ALL_AROUND, NARROW_STRAIGHT

NO_CONES = np.zeros(0, CONE)
PLAN = with_settings(
    OFFICE,
    {"grid": Grid((50, 70, 1), 0.1), "robots": 1, "robot": {"body_radius_m": 0.0, "reach_m": 1.5}},
)


def half_known_plan():
    """A plan whose part below y = 20 is known and free, with a wall at x = 25 up to there."""
    shape = PLAN.grid.shape
    mean, precision = np.full(shape, 0.5, np.float32), np.full(shape, 1.0 / 900.0, np.float32)
    mean[:, :20], precision[:, :20] = 0.0, 2000.0
    mean[25, :18] = 1.0
    return Belief(mean.reshape(-1), precision.reshape(-1), shape)


def plan_situation(belief, **changes):
    return Situation(0, np.array([10.5, 5.5, 0.5, 0.3, 0.0]), belief, NO_CONES, **changes)


def test_nearby_candidates_of_a_flying_robot_lie_within_reach_and_inside():
    shape = BOX.grid.shape
    belief = Belief(np.full(385, 0.5, np.float32), np.full(385, 1.0 / 900.0, np.float32), shape)
    here = np.array([3.2, 5.1, 2.4, 0.3, -0.2])
    found = CandidatePlanner(BOX).near(Situation(0, here, belief, NO_CONES), None, np.random.default_rng(0))
    apart = np.linalg.norm(found.viewpoints[:, :3] - here[:3], axis=1)
    assert apart.max() <= 2.0 * (1 + 1e-9) and (found.viewpoints[:, :3] > 0.0).all()
    assert (found.viewpoints[:, :3] < shape).all() and np.abs(found.viewpoints[:, 3]).max() <= math.pi
    assert (found.kind == np.where(apart == 0.0, Kind.SPOT, Kind.REACH)).all()
    assert (found.bits > 0.0).any() and (found.seconds >= BOX.sensor.scan_time_s).all()


def test_refining_never_loses_the_best():
    recipe = dataclasses.replace(ALL_AROUND, exponent=0.3)
    best = []
    for refinements in (0, 1, 2, 3):
        planner = CandidatePlanner(PLAN, {0: dataclasses.replace(recipe, refinements=refinements)})
        situation = plan_situation(half_known_plan())
        found = planner.near(situation, planner.start_search(situation), np.random.default_rng(5))
        best.append(found.values(recipe.exponent).max())
    assert best == sorted(best) and best[-1] > best[0]


def test_far_places_are_reached_uncertain_and_the_kept_one_is_last():
    planner, situation = CandidatePlanner(PLAN), plan_situation(half_known_plan())
    kept = np.array([40.5, 30.5, 0.5, 0.3, 0.0])
    travel = planner.start_search(situation)
    found = planner.far(situation, travel, 1e9, kept, np.random.default_rng(0))
    np.testing.assert_array_equal(found.viewpoints[-1], kept)
    assert len(found.bits) == ALL_AROUND.far_places + 1 and (found.kind == Kind.FAR).all()
    assert np.isfinite(found.seconds).all() and (found.viewpoints[:, 3] == 0.3).all()
    assert np.median(found.viewpoints[:, 1]) > 15.0  # unknown is what lies beyond y = 20
    straight = np.linalg.norm(found.viewpoints[:, :3] - situation.here[:3], axis=1) * 0.1
    assert (found.seconds > straight / PLAN.robot.max_speed_m_s).all()


def test_the_first_stop_on_the_way_is_within_reach():
    planner, situation = CandidatePlanner(PLAN), plan_situation(half_known_plan())
    travel = planner.start_search(situation)
    goal = planner.far(situation, travel, 1e9, None, np.random.default_rng(0)).viewpoints[0]
    stop = planner.towards(situation, travel, goal, np.random.default_rng(0))
    assert stop is not None and np.linalg.norm(stop[:3] - situation.here[:3]) <= 15.0
    inside_wall = np.array([25.5, 3.5, 0.5, 0.0, 0.0])
    assert planner.towards(situation, travel, inside_wall, np.random.default_rng(0)) is None


def test_experience_changes_what_candidates_are_worth():
    planner = CandidatePlanner(PLAN)
    situation = plan_situation(half_known_plan(), weigh=lambda viewpoints, bits: 0.0 * bits)
    found = planner.near(situation, planner.start_search(situation), np.random.default_rng(0))
    assert (found.bits == 0.0).all() and (found.values(1.0) == 0.0).all()


def test_each_kind_has_its_recipe():
    planner = CandidatePlanner(PLAN, {0: NARROW_STRAIGHT})
    assert planner.recipe_of(0) is NARROW_STRAIGHT and CandidatePlanner(PLAN).recipe_of(0) is ALL_AROUND
