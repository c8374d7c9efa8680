"""Mapping a cliff from above: eqs. 3 and 5 by a slow reference, the edge, and rovers that do not fall."""

from __future__ import annotations

import dataclasses
import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from scipy import ndimage

from baselines.experiments.mission import run_mission, scripted_env
from baselines.strategies import CLIFF_STRATEGIES, make_strategy
from baselines.strategies.next_best_view.edge import behind_line, find_edge, inside_polygon
from baselines.strategies.next_best_view.elevation_view import (
    Camera,
    Ground,
    fill_new_information,
    fill_visibility,
    visibility,
)
from baselines.strategies.next_best_view.plateau import PlateauPaths, safe_columns
from baselines.strategies.rules.cliff import CliffConfig, CliffMapping
from entropy_explore_env.errors import SettingError
from entropy_explore_env.missions.view import view_of
from entropy_explore_env.reports.metrics import mission_figures
from entropy_explore_env.robots.motion import MoveEnd
from entropy_explore_env.scenario import with_settings
from entropy_explore_env.scenarios import CLIFF, LAB
from entropy_explore_env.worlds.load import make_world
from entropy_explore_env.worlds.world import Collision
from tests.reference import sujan
from tests.reference.scenes import drawn, seeds

QUICK = {"sensor": {"angular_step_rad": math.pi / 60}, "robot": {"reach_m": math.inf}}


def random_ground(seed, shape=(11, 7)):
    """Rough ground with some columns measured well, others not at all, and a camera above it."""
    rng = np.random.default_rng(seed)
    height = rng.uniform(0.0, 2.0, shape)
    sigma = rng.choice([0.05, 0.7], shape)
    measurements = rng.choice([0.0, 1.5, 9.0], shape)
    ground = Ground(height, sigma, measurements, rng.uniform(0.1, 1.0, shape))
    pose = np.array([*(rng.uniform(0.05, 0.95, 2) * shape), rng.uniform(2.0, 5.0), rng.uniform(-3, 3), 0.6])
    return ground, pose


@drawn(60)
@given(seeds)
def test_visibility_over_elevation_is_the_paper_s(seed):
    ground, pose = random_ground(seed)
    seen = np.empty(ground.height.shape)
    fill_visibility(ground, Camera(math.pi, math.pi, math.inf), pose, seen)
    for x, y in np.ndindex(*seen.shape):
        expected = sujan.visibility(ground.height, ground.sigma, pose[:3], x, y)
        assert seen[x, y] == pytest.approx(expected if expected >= 1e-3 else 0.0, abs=1e-3)


@drawn(60)
@given(seeds)
def test_new_information_over_elevation_is_the_paper_s(seed):
    ground, pose = random_ground(seed)
    poses, bits = np.stack([pose, pose + np.array([0.1, 0.2, 0.3, 0.4, -0.3])]), np.empty(2)
    fill_new_information(ground, Camera(0.7, 0.4, 6.0), 4.0, poses, bits)
    for given_pose, found in zip(poses, bits, strict=True):
        expected = sujan.elevation_information(*ground, 4.0, given_pose, (1.4, 0.8), 6.0)
        assert found == pytest.approx(expected, abs=0.02)


def test_a_wall_hides_what_is_behind_it_and_a_ray_along_its_top_is_even():
    height, sigma = np.zeros((9, 5)), np.full((9, 5), 0.1)
    camera = (8.5, 2.5, 4.0)
    ground = Ground(height, sigma, np.zeros((9, 5)), np.ones((9, 5)))
    assert visibility(ground, camera, 0, 2) == pytest.approx(1.0, abs=1e-4)
    height[4, 2] = 3.0
    assert visibility(ground, camera, 0, 2) == 0.0
    height[4, 2] = 2.0  # the ray's height in the middle of its way
    assert visibility(ground, camera, 0, 2) == pytest.approx(0.5)
    assert visibility(ground, camera, 4, 2) == pytest.approx(1.0, abs=1e-4)  # its own top hides nothing


# --- the edge


def distances_to(polygon, points):
    """Distance of (N, 2) points to the nearest side of a closed polygon."""
    nearest = np.full(len(points), np.inf)
    for a, b in itertools.pairwise(polygon):
        share = np.clip(((points - a) @ (b - a)) / ((b - a) @ (b - a)), 0.0, 1.0)
        nearest = np.minimum(nearest, np.linalg.norm(points - a - share[:, None] * (b - a), axis=1))
    return nearest


@pytest.mark.parametrize("tolerance", [0.6, 1.6, 4.0])
def test_the_polygon_is_as_near_to_the_edge_as_a_wheel_and_coarser_for_larger_wheels(tolerance):
    """Figs. 8-9, on worlds with the rocks of the Viking sites."""
    corners = []
    for number in range(4):
        height = make_world(CLIFF, number).occupied.sum(axis=2).astype(float)
        edge = find_edge(height, (20, 40), 1.6, 1.6, tolerance)
        plateau = height == 24.0
        assert (edge.plateau[plateau]).all()
        assert (edge.plateau & ~plateau).sum() <= 30  # what the closing closes
        assert distances_to(edge.polygon, edge.border).max() <= tolerance + 1e-9
        np.testing.assert_array_equal(edge.polygon[0], edge.polygon[-1])
        apart = ndimage.distance_transform_edt(plateau) + ndimage.distance_transform_edt(~plateau)
        wrong = inside_polygon(edge.polygon, plateau.shape) != plateau
        assert apart[wrong].max() <= tolerance + 2.5
        corners.append(len(edge.polygon))
    assert np.mean(corners) > 7 if tolerance < 2.0 else np.mean(corners) >= 5


def test_rocks_on_the_plateau_are_no_holes_and_another_plateau_is_not_the_rover_s():
    height = np.zeros((17, 23))
    height[:7], height[11:] = 5.0, 5.0
    height[3, 9] = 9.0
    edge = find_edge(height, (1, 1), 1.0, 0.0, 0.4)
    assert not edge.plateau[3, 9] and not edge.plateau[11:].any()
    assert edge.border.min() == pytest.approx(0.0) and edge.border[:, 0].max() == pytest.approx(7.0)
    assert inside_polygon(edge.polygon, (17, 23)).sum() >= 7 * 23 - 4  # a contour cuts its corners
    assert inside_polygon(edge.polygon, (17, 23))[3, 9]
    far = find_edge(height, (14, 3), 1.0, 0.0, 0.4)
    assert far.plateau[11:].all() and not far.plateau[:11].any()


def test_the_straight_edge_is_the_line_that_fits_the_border_within_the_workspace():
    height = np.where(np.add.outer(2.0 * np.arange(17), np.arange(23)) < 25, 5.0, 0.0)
    side = behind_line(find_edge(height, (1, 1), 1.0, 0.0, 0.4), (1, 1))
    assert (side != (height > 0.0)).mean() < 0.05 and side[0, 0] and not side[-1, -1]
    assert behind_line(find_edge(np.zeros((5, 7)), (1, 1), 1.0, 0.0, 0.4), (1, 1)).all()


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


# --- rovers


def mapped(strategy, seed, scans):
    """(ends of drives, missions, the strategy) after a number of scans."""
    env = scripted_env(with_settings(CLIFF, {**QUICK, "max_cycles": scans}))
    ends: list[MoveEnd] = []

    def note(env):
        ends.append(list(MoveEnd)[env.missions.state.robots[0, 0]["move_end"]])

    run_mission(env, strategy, seed, note)
    return ends, env.missions, strategy


@pytest.mark.parametrize("name", CLIFF_STRATEGIES)
def test_no_rover_drives_over_the_edge(name):
    places = set()
    for seed in range(3):
        ends, missions, _ = mapped(make_strategy(name), seed, 16)
        assert set(ends) == {MoveEnd.ARRIVED} and missions.state.robots[0, 0]["scans"] >= 16
        places.add(float(missions.state.robots[0, 0]["distance_m"]) > 0.5)
    assert True in places


def test_a_goal_that_cannot_be_reached_is_given_up_and_teams_map_on():
    env = scripted_env(with_settings(CLIFF, {**QUICK, "robots": 2, "max_cycles": 24}))
    made, ends = CliffMapping(), set()

    def note(env):
        ends.update(list(MoveEnd)[end] for end in env.missions.state.robots[0]["move_end"])

    run_mission(env, made, 2, note)
    assert MoveEnd.EDGE not in ends and (env.missions.state.robots[0]["distance_m"] > 1.0).all()
    view, memory = view_of(env.missions, 0, 0), made._memories[0]
    memory.goal = view.pose + np.array([1.0, 0.0, 0.0, 0.0, 0.0])
    goal, looks = memory.goal, len(made.looks[0])
    made.choose(dataclasses.replace(view, move_end=MoveEnd.TEAMMATE))
    assert memory.goal is not goal and len(made.looks[0]) == looks + 1


def test_interest_falls_where_nothing_answers_and_nowhere_else():
    _, missions, strategy = mapped(CliffMapping(CliffConfig(interest_decay=0.7)), 0, 16)
    view, memory = view_of(missions, 0, 0), strategy._memories[0]
    known = strategy._measured(view)
    before, visibility = memory.interest.copy(), np.linspace(0.0, 1.0, 120 * 96).reshape(120, 96)
    memory.known, memory.visibility = known, visibility
    answered = np.zeros((120, 96), bool)
    answered[30:40, 50:] = True
    strategy._learn(view, memory, known._replace(measurements=known.measurements + answered))
    expected = [sujan.interest(b, p, 0.7) for b, p in zip(before.ravel(), visibility.ravel(), strict=True)]
    np.testing.assert_allclose(memory.interest, np.where(answered, before, np.reshape(expected, (120, 96))))
    looks = strategy.looks[0]
    assert len(looks) > 5 and sum(look.obtained for look in looks) > 500
    _, _, steady = mapped(CliffMapping(CliffConfig(interest_decay=0.0)), 0, 8)
    assert (steady.interest(0) == 1.0).all()


def test_raster_without_yaw_looks_along_x_and_with_yaw_all_around():
    for name, yaws in (("cliff-raster-fixed-yaw", {0.0}), ("cliff-raster", {0.0, 90.0, 180.0, 270.0})):
        env = scripted_env(with_settings(CLIFF, {**QUICK, "max_cycles": 14}))
        found = []

        def note(env, found=found):
            found.append(round(math.degrees(env.missions.state.robots[0, 0]["origin"][3]), 3) % 360.0)

        run_mission(env, make_strategy(name), 1, note)
        assert set(found[6:]) == yaws, name


def test_others_than_rovers_and_settings_out_of_range_are_refused():
    with pytest.raises(SettingError, match=r"above_ground_m and Robot\.tilts"):
        CliffMapping().reset(LAB, np.random.default_rng(0))
    with pytest.raises(SettingError):
        CliffMapping().reset(with_settings(CLIFF, {"robot": {"tilts": False}}), np.random.default_rng(0))
    for bad in (
        {"choice": "x"},
        {"edge": "circle"},
        {"turning": 1},
        {"poses": 0},
        {"most_measurements": 0},
        {"interest_decay": -1.0},
        {"distance_weight": math.nan},
        {"wheel_m": 0.0},
        {"spacing_m": -1.0},
    ):
        with pytest.raises(SettingError, match=f"CliffConfig.{next(iter(bad))}"):
            CliffConfig(**bad)


@pytest.mark.long
def test_the_recommended_strategy_learns_where_the_ground_ends():
    """No map shows the edge: it once drove against it 90 times in 200 s, and never came to the end."""
    env = scripted_env(CLIFF, ending={"time_limit_s": 400.0})
    run_mission(env, make_strategy("best"), seed=0)
    figures = mission_figures(env.missions, 0)
    assert figures["finished"] and figures["blocked_moves"] < 20
