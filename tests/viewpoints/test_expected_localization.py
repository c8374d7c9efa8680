"""LE of the rating function: by hand, beside a slow reference, and beside what missions then do."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given

from entropy_explore_env.missions.view import view_of
from entropy_explore_env.reports.metrics import localization_told
from entropy_explore_env.robots.landmarks import LANDMARK
from entropy_explore_env.robots.localization import LOCALIZATION_PARAMS
from entropy_explore_env.viewpoints.expected_localization import (
    Drive,
    Surveyor,
    error_of_points,
    foresee_covariance,
    growth_of_error,
)
from tests.missions.test_landmarks import there_and_back
from tests.reference import localization as reference
from tests.reference.scenes import drawn, free_box, put, seeds, started, toward

SIZE, EDGE, ORIGIN = (7, 11, 5), 0.5, (1.0, -2.0, 0.5)
RATES = {
    "xy_per_m": 0.01,
    "z_per_m": 0.003,
    "yaw_per_m": 0.0025,
    "yaw_per_rad": 0.004,
}
FULL_VIEW = {"half_yaw_rad": math.pi, "half_pitch_rad": math.pi}


def surveyor(landmarks=(), mean=None, every_m=math.inf, **params):
    own = np.zeros(1, LOCALIZATION_PARAMS)
    chosen = {
        **RATES,
        **FULL_VIEW,
        "range_m": 100.0,
        "range_sigma_m": 0.05,
        "bearing_sigma_rad": 0.02,
        **params,
    }
    for name, number in chosen.items():
        own[name] = number
    places = np.array(landmarks, np.float64).reshape(-1, 3)
    free = np.zeros(math.prod(SIZE), np.float32) if mean is None else mean
    mine = np.zeros(0, LANDMARK)
    return Surveyor(own, places, free, SIZE, ORIGIN, EDGE, 0.0, every_m, mine, np.empty((2, 4, 4)))


def drive(*path, pose=(1.75, -1.75, 0.75, 0.2, 0.0), gaze=0.2, since_m=0.0):
    end = path[-1] if path else pose[:3]
    points = np.array(path, np.float64).reshape(-1, 3)
    return Drive(np.array(pose, np.float64), points, np.array([*end, gaze, 0.0]), since_m)


def growth(covariance, who, way, lever_m):
    after = np.empty((4, 4))
    return growth_of_error(covariance, who, way, lever_m, after), after


def test_without_landmarks_it_is_what_the_way_adds():
    """4 m along x: 0.04 m² of x and of y, 0.012 of z, 0.01 of the yaw, which counts 3² times at 3 m."""
    le, after = growth(np.zeros((4, 4)), surveyor(), drive((5.75, -1.75, 0.75)), 3.0)
    assert np.diag(after) == pytest.approx([0.04, 0.04, 0.012, 0.01])
    assert le == pytest.approx(math.sqrt(0.092 + 9.0 * 0.01))
    known = np.diag([0.09, 0.07, 0.0, 0.0])
    assert error_of_points(known, 3.0) == pytest.approx(0.4)
    assert growth(known, surveyor(), drive((5.75, -1.75, 0.75)), 0.0)[0] == pytest.approx(
        math.sqrt(0.16 + 0.092) - 0.4
    )


def test_a_turn_on_the_spot_counts_by_the_shorter_way_round():
    le, after = growth(np.zeros((4, 4)), surveyor(), drive(gaze=0.2 - 5.0), 2.0)
    turned = 2.0 * math.pi - 5.0
    assert np.diag(after) == pytest.approx([0.0, 0.0, 0.0, 0.004 * turned])
    assert le == pytest.approx(math.sqrt(2.0**2 * 0.004 * turned))


def test_a_landmark_takes_back_more_than_a_short_way_adds():
    """Exact yaw: σ² 1 m² along the line of sight becomes 1/(1 + 1/0.05²), and nothing is known of the yaw."""
    before, who = np.diag([1.0, 1.0, 0.0, 0.0]), surveyor([(3.75, -1.75, 0.75)])
    le, after = growth(before, who, drive(gaze=0.2), 0.0)
    assert after[0, 0] == pytest.approx(1.0 / (1.0 + 1.0 / 0.05**2))
    assert after[1, 1] == pytest.approx(1.0 / (1.0 + 1.0 / (2.0 * 0.02) ** 2))
    assert le == pytest.approx(math.sqrt(after[0, 0] + after[1, 1]) - math.sqrt(2.0)) and le < 0.0


@pytest.mark.parametrize(
    ("changes", "seen"),
    [
        ({}, True),
        ({"range_m": 1.9}, False),
        ({"range_m": 2.1}, True),
        ({"half_yaw_rad": 0.25}, True),
        ({"half_yaw_rad": 0.15}, False),  # it looks 0.2 rad beside it
    ],
)
def test_only_landmarks_in_range_and_view_take_something_back(changes, seen):
    before = np.diag([1.0, 1.0, 0.0, 0.0])
    _, after = growth(before, surveyor([(3.75, -1.75, 0.75)], **changes), drive(), 0.0)
    assert (after[0, 0] < 0.5) == seen


@pytest.mark.parametrize(("wall", "seen"), [(2, False), (4, True), (5, True)])
def test_what_is_believed_covered_hides_a_landmark_but_what_carries_it_does_not(wall, seen):
    """The robot is in column 1 of the grid, the landmark in column 5; a wall through all of one column."""
    mean = np.zeros(SIZE, np.float32)
    mean[wall] = 0.9
    who = surveyor([(3.55, -1.75, 0.75)], mean.ravel())
    _, after = growth(np.diag([1.0, 1.0, 0.0, 0.0]), who, drive(), 0.0)
    assert (after[0, 0] < 0.5) == seen


@drawn(30)
@given(seeds)
def test_scans_on_the_way_count_as_the_reference_says(seed):
    rng = np.random.default_rng(seed)
    low, high = np.array(ORIGIN), np.array(ORIGIN) + EDGE * np.array(SIZE)
    pose = np.array([*rng.uniform(low, high), rng.uniform(-3, 3), 0.0])
    path = rng.uniform(low, high, (rng.integers(0, 4), 3))
    landmarks = rng.uniform(low, high, (rng.integers(0, 4), 3))
    every, since, gaze = rng.uniform(0.4, 3.0), rng.uniform(0.0, 0.3), rng.uniform(-3, 3)
    root = rng.normal(size=(4, 4)) * 0.3
    covariance = root @ root.T
    way = drive(*path, pose=pose, gaze=gaze, since_m=since)
    after = covariance.copy()
    foresee_covariance(after, surveyor(landmarks, every_m=every, range_m=2.0), way)
    wanted = reference.foreseen(
        covariance,
        pose,
        path,
        way.viewpoint,
        every,
        since,
        list(RATES.values()),
        landmarks,
        lambda place, landmark: np.linalg.norm(landmark - place) <= 2.0,
        (0.05, 0.02),
    )
    np.testing.assert_allclose(after, wanted, rtol=1e-5, atol=1e-7)


@pytest.mark.parametrize("landmarks", [(), ((3.4, 5.2, 1.2), (0.2, 3.0, 0.3))])
def test_a_mission_then_does_what_was_foreseen(landmarks):
    """A turn and a straight drive with scans under way; how far off the robot really is hardly matters."""
    rates = {name: 0.002 for name in ("xy_m_per_sqrt_m", "z_m_per_sqrt_m", "yaw_rad_per_sqrt_m")}
    around = {"field_of_view_rad": (2.0 * math.pi, math.pi), "angular_step_rad": math.pi / 6}
    missions = started(
        free_box(
            robots=1,
            robot={"localization": {**rates, "yaw_rad_per_sqrt_rad": 0.005}, "reach_m": 9.0},
            sensor={**around, "scan_every_m": 0.6},
            fiducials={"positions_m": landmarks, "range_sigma_m": 1e-4, "bearing_sigma_rad": 1e-4},
        )
    )
    put(missions, 0, (1.75, 0.75, 1.25, 0.0, 0.0))
    view = view_of(missions, 0, 0)
    goal = np.array([1.75, 4.25, 1.25, 0.4, 0.0])
    params = view.rules.localization
    assert params is not None
    who = Surveyor(
        params[:1],
        view.fiducials_m,
        np.zeros(view.mean.size, np.float32),
        view.scenario.grid.shape,
        view.scenario.grid.origin_m,
        0.5,
        0.0,
        0.6,
        view.landmarks,
        np.empty((2, 4, 4)),
    )
    foreseen = view.covariance.copy()
    foresee_covariance(foreseen, who, Drive(view.pose.copy(), goal[None, :3], goal, float(view.since_scan_m)))
    toward(missions, goal)
    found = view_of(missions, 0, 0)
    assert found.pose[:3] == pytest.approx(goal[:3], abs=0.3)
    scale = np.sqrt(np.diag(foreseen))
    np.testing.assert_allclose(
        found.covariance / np.outer(scale, scale), foreseen / np.outer(scale, scale), atol=0.01
    )
    assert (error_of_points(found.covariance, 1.0) < 1e-3) == bool(landmarks)


def test_a_scan_that_is_overdue_on_a_way_of_no_length_is_taken_at_its_end():
    due = drive((1.75, -1.75, 0.75), since_m=1.5)
    before = np.diag([1.0, 1.0, 0.0, 0.0])
    le, after = growth(before, surveyor([(3.75, -1.75, 0.75)], every_m=1.0), due, 0.0)
    assert le < 0.0 and after[0, 0] == pytest.approx(1.0 / (1.0 + 1.0 / 0.05**2))


def test_landmarks_of_its_own_map_take_back_what_the_way_adds_and_no_more():
    """One that it chose where it stands: staying brings nothing, and a drive costs less than without it."""
    before = np.diag([0.04, 0.04, 0.01, 0.01])
    own = np.zeros(1, LANDMARK)
    own["believed"], own["seen_from"], own["used"] = (2.75, -1.75, 0.75), (1.75, -1.75, 0.75), True
    own["covariance"] = before
    for way, least in ((drive(), 0.0), (drive((1.75, 1.0, 0.75)), 1e-3)):
        without, _ = growth(before, surveyor(), way, 2.0)
        having, after = growth(before, surveyor()._replace(own=own), way, 2.0)
        exact, _ = growth(before, surveyor([(2.75, -1.75, 0.75)]), way, 2.0)
        assert having == pytest.approx(0.0, abs=1e-9) if least == 0.0 else least < having < without - least
        assert exact < having and (np.linalg.eigvalsh(after) > -1e-12).all()
    hidden = np.zeros(SIZE, np.float32)
    hidden[2, :, :] = 1.0  # a wall between
    behind = own.copy()
    behind["believed"] = (3.75, -1.75, 0.75)
    who = surveyor(mean=hidden.ravel())
    way = drive((1.75, 1.0, 0.75))
    assert growth(before, who._replace(own=behind), way, 2.0)[0] == growth(before, who, way, 2.0)[0]


def test_a_view_tells_of_own_landmarks_what_the_robot_knows_and_not_where_they_are():
    missions = there_and_back(6)
    view, kept = view_of(missions, 0, 0), missions.state.landmarks[0, 0]
    kept = kept[kept["used"]]
    assert len(view.landmarks) == len(kept) > 3 and (view.landmarks["place"] == kept["believed"]).all()
    assert (kept["place"] != kept["believed"]).any() and not view.landmarks.flags.writeable
    for name in ("believed", "seen_from", "covariance", "sightings"):
        np.testing.assert_array_equal(view.landmarks[name], kept[name])
    assert localization_told(missions, 0)["own_sightings"] == kept["sightings"].sum() > 0
    assert "own_sightings" not in localization_told(there_and_back(0), 0)
