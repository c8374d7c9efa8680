"""Landmarks of robots' own maps in missions: which are chosen, what they take back, kept, refused."""

import numpy as np
import pytest

from entropy_explore_env.belief.fields import Belief
from entropy_explore_env.missions.landmarks import landmark_score
from entropy_explore_env.missions.view import view_of
from entropy_explore_env.settings.grid import Grid
from tests.reference.scenes import build, free_box, put, started, toward

SOME = {"xy_m_per_sqrt_m": 0.05, "yaw_rad_per_sqrt_m": 0.02, "yaw_rad_per_sqrt_rad": 0.02}
SHAPE = (21, 27, 1)


def plan(own_number, **changes):
    """A plan with a scanner that sees all around, for a robot that drifts."""
    around = {"field_of_view_rad": (2.0 * np.pi, 0.0), "angular_step_rad": np.pi / 45, "max_range_m": 9.0}
    return free_box(
        grid=Grid(SHAPE, 0.5),
        robots=changes.pop("robots", 1),
        robot={"motion": "planar", "reach_m": 20.0, "localization": SOME, "turn_rate_rad_s": 9.0},
        sensor=around,
        fiducials={"own_number": own_number, **changes},
    )


def with_posts(missions):
    """Two posts, and a wall with a corner."""
    solid = np.zeros(SHAPE, bool)
    solid[6, 6] = solid[14, 20] = True
    solid[14:, 8] = solid[14, 3:8] = True
    build(missions, solid)
    put(missions, 0, (5.25, 6.75, 0.25, 0.0, 0.0))
    return missions


def there_and_back(own_number, drives=24):
    """A mission of a robot that drives around in the same hall."""
    missions = with_posts(started(plan(own_number), seed=4))
    corners = [(3.0, 10.0), (9.0, 11.0), (8.0, 6.0), (5.25, 6.75)]
    for number in range(drives):
        toward(missions, (*corners[number % 4], 0.25, 0.0, 0.0))
    return missions


def test_what_takes_back_is_chosen_well_and_kept_apart():
    missions = there_and_back(6)
    kept = missions.state.landmarks[0, 0]
    used = kept[kept["used"]]
    assert 4 <= len(used) <= 6
    believed = view_of(missions, 0, 0).landmarks_m
    assert (believed == used["believed"]).all()
    apart = np.linalg.norm(believed[:, None] - believed[None], axis=2) + 9.0 * np.eye(len(used))
    assert apart.min() >= 1.0
    assert (used["score"] >= 0.7).all()
    off = np.linalg.norm(used["place"] - used["believed"], axis=1)
    assert 0.0 < off.max() < 1.5  # it drifts
    solid = missions.state.truth[0].reshape(SHAPE) > 0.5
    for place in used["place"]:  # before something solid, by a fiftieth of an edge along the ray
        steps = [(x, y, 0.0) for x in (-0.02, 0.0, 0.02) for y in (-0.02, 0.0, 0.02)]
        near = [tuple(np.floor((place + step) / 0.5).astype(int)) for step in np.array(steps)]
        assert any(solid[voxel] for voxel in near), place
        assert not solid[tuple(np.floor(place / 0.5).astype(int))]


def test_they_take_back_what_was_added_since():
    without, own = (there_and_back(number) for number in (0, 6))
    spread = [np.trace(missions.state.estimates[0, 0]["covariance"][:2, :2]) for missions in (without, own)]
    assert spread[1] < 0.5 * spread[0]
    errors = [missions.state.estimates[0, 0] for missions in (without, own)]
    assert errors[1]["squared_m2"] < 0.7 * errors[0]["squared_m2"]
    assert own.state.landmarks[0, 0]["sightings"].sum() > 30
    covariance = own.state.estimates[0, 0]["covariance"]
    assert np.linalg.eigvalsh(covariance).min() >= -1e-9 * np.trace(covariance)


def test_only_what_is_good_enough_is_chosen():
    missions = with_posts(started(plan(6, own_score=2.0)))
    for _ in range(4):
        toward(missions, (8.0, 6.0, 0.25, 0.0, 0.0))
    assert not missions.state.landmarks["used"].any()
    assert view_of(missions, 0, 0).landmarks_m.shape == (0, 3)


def test_a_score_is_that_of_the_robot_s_own_map_and_posts_come_first():
    missions = with_posts(started(plan(1)))
    toward(missions, (5.25, 6.75, 0.25, 0.0, 0.0))
    (kept,) = missions.state.landmarks[0, 0]
    belief = Belief(missions.state.mean[0, 0], missions.state.precision[0, 0], SHAPE)
    prior = np.float32(missions.scenario.sigma_prior**-2)
    scores = [landmark_score(belief, prior, np.int64(voxel)) for voxel in range(SHAPE[0] * SHAPE[1])]
    assert kept["used"] and kept["score"] == pytest.approx(max(scores))
    assert np.floor(kept["place"][:2] / 0.5 + 0.0).tolist() in ([6, 7], [7, 7], [7, 6])  # beside the post


def test_a_landmark_is_found_in_a_hall_that_is_higher_than_it_is_long_and_wide():
    """5 × 7 voxels, and 13 high: a post from floor to ceiling, 2 m ahead."""
    sensor = {"field_of_view_rad": (1.0, 0.0), "angular_step_rad": 0.1, "max_range_m": 9.0}
    missions = started(
        free_box(
            grid=Grid((5, 7, 13), 0.5),
            robots=1,
            robot={"motion": "planar", "sensor_height_m": 2.25, "localization": SOME},
            sensor=sensor,
            fiducials={"own_number": 1, "own_score": 0.0},
        )
    )
    solid = np.zeros((5, 7, 13), bool)
    solid[2, 5] = True
    build(missions, solid)
    here = (1.25, 0.75, 2.25, np.pi / 2, 0.0)
    put(missions, 0, here)
    toward(missions, here)
    (kept,) = missions.state.landmarks[0, 0]
    assert kept["used"] and kept["place"][1] == pytest.approx(2.5, abs=0.02)  # the face of the post
