"""Driving from rest to rest, and what stops a drive."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from entropy_explore_env.belief.raycast import Line
from entropy_explore_env.robots.motion import (
    MoveEnd,
    SpeedProfile,
    distance_to_teammate,
    driven_share,
    driving_time,
    duration_of,
    free_distance,
    speed_after,
    time_after,
    turning_time,
)
from tests.reference import rocha04
from tests.reference.scenes import drawn, random_cover, ray_space, rays, seeds

SIZE = (7, 11, 5)
speeds = st.floats(0.05, 5.0)


@drawn(60)
@given(st.floats(0.0, 20.0), speeds, speeds)
def test_driving_times_are_those_of_a_trapezoid_of_speed(length_m, speed, acceleration):
    expected = rocha04.drive_s(length_m, speed, acceleration)
    assert driving_time(length_m, speed, acceleration) == pytest.approx(expected, rel=1e-9, abs=1e-12)


@drawn(40)
@given(st.floats(0.01, 20.0), speeds, speeds, st.floats(0.0, 1.0))
def test_the_driven_share_is_the_integral_of_the_speed(length_m, speed, acceleration, share):
    time_s = share * driving_time(length_m, speed, acceleration)
    driven_m = driven_share(time_s, SpeedProfile(length_m, 0.0, speed, acceleration)) * length_m
    expected_m = rocha04.way_at_m(time_s, length_m, speed, acceleration, steps=1000)
    rounded_corners = acceleration * (time_s / 1000) ** 2
    assert driven_m == pytest.approx(expected_m, abs=rounded_corners + 1e-9)


@drawn(40)
@given(st.floats(0.0, 20.0), st.floats(0.0, 1.0), st.booleans(), speeds, speeds)
def test_a_drive_from_a_speed_keeps_to_limits_and_ends_at_rest(more_m, share, brakes, speed, acceleration):
    """Seconds, metres and speeds fit each other, whether it goes on from its speed or brakes first."""
    begun = share * speed
    rest_s, rest_m = begun / acceleration, 0.5 * begun * begun / acceleration
    profile = SpeedProfile(rest_m + more_m + 1e-6, -rest_s if brakes else rest_s, speed, acceleration)
    duration = duration_of(profile)
    if brakes:
        assert duration == pytest.approx(rest_s + driving_time(more_m + 1e-6, speed, acceleration))
        assert speed_after(rest_s, profile) == pytest.approx(0.0, abs=1e-6)
        assert driven_share(rest_s, profile) * profile.length_m == pytest.approx(rest_m, abs=1e-6)
    else:
        assert duration == pytest.approx(
            driving_time(2.0 * rest_m + more_m + 1e-6, speed, acceleration) - rest_s
        )
    times = np.linspace(0.0, duration, 400)
    metres = np.array([driven_share(t, profile) for t in times]) * profile.length_m
    speed_m_s = np.array([speed_after(t, profile) for t in times])
    assert (metres[0], metres[-1]) == pytest.approx((0.0, profile.length_m))
    assert (speed_m_s[0], speed_m_s[-1]) == pytest.approx((begun, 0.0), abs=1e-6)
    gap_s = duration / 399
    assert (speed_m_s <= speed * (1 + 1e-9)).all()
    assert (np.abs(np.diff(speed_m_s)) <= acceleration * gap_s * (1 + 1e-6) + 1e-9).all()
    rounded = 0.5 * acceleration * gap_s**2
    means = 0.5 * (speed_m_s[1:] + speed_m_s[:-1])
    assert np.diff(metres) == pytest.approx(means * gap_s, abs=rounded + 1e-9)
    for place in (1, 133, 266, 398):
        assert time_after(metres[place], profile) == pytest.approx(times[place], abs=1e-3 * duration + 1e-4)


def test_no_distance_takes_no_time_and_is_driven_at_once():
    assert driving_time(0.0, 0.25, 0.25) == 0.0
    assert driven_share(0.0, SpeedProfile(0.0, 0.0, 0.25, 0.25)) == 1.0


@pytest.mark.parametrize(
    ("yaw", "new_yaw", "pitch", "new_pitch", "turn"),
    [
        (0.0, 1.0, 0.0, 0.0, 1.0),
        (1.0, 0.0, 0.0, 0.0, 1.0),
        (3.0, -3.0, 0.0, 0.0, 2 * math.pi - 6.0),  # through straight behind
        (-3.0, 3.0, 0.0, 0.0, 2 * math.pi - 6.0),
        (0.0, math.pi, 0.0, 0.0, math.pi),
        (0.0, 2 * math.pi, 0.0, 0.0, 0.0),
        (0.0, 0.5, -0.4, 0.4, 0.8),  # both at once: the larger counts
        (0.0, 0.0, 0.4, -0.4, 0.8),
    ],
)
def test_turning_goes_the_short_way_round(yaw, new_yaw, pitch, new_pitch, turn):
    assert turning_time(yaw, pitch, new_yaw, new_pitch, 0.5) == pytest.approx(2 * turn, abs=1e-12)
    assert turning_time(yaw, pitch, new_yaw, new_pitch, math.inf) == 0.0


def drive(blocked, start, direction, length, finish=None):
    crossing = ray_space(blocked.shape, behind=1)
    start, direction = np.asarray(start, np.float64), np.asarray(direction, np.float64)
    finish = start + length * direction if finish is None else finish
    line = Line(tuple(start.tolist()), tuple(direction.tolist()), float(length))
    driven, code = free_distance(blocked.ravel(), blocked.shape, line, tuple(finish.tolist()), crossing)
    return driven, list(MoveEnd)[code]


@drawn(200)
@given(rays(), seeds, st.floats(0.05, 15.0), st.sampled_from([0.05, 0.3]))
def test_a_drive_ends_in_the_last_voxel_in_which_the_body_fits(ray, seed, length, share):
    size, start, direction = ray
    assume(rocha04.is_generic(start, direction, size, length))
    blocked = random_cover(size, share, seed)
    driven, end = drive(blocked, start, direction, length)
    theirs = rocha04.trace(lambda v: blocked[v] > 0.5, start, direction, size, length, 0)
    if theirs.end == rocha04.OPEN:
        assert (driven, end) == (length, MoveEnd.ARRIVED)
        return
    assert end is (MoveEnd.OBSTACLE if theirs.end == rocha04.HIT else MoveEnd.WALL)
    last = rocha04.pieces_of(start, direction, size)[len(theirs.voxels) - 1]
    expected = 0.5 * (last.entered + last.left) if len(theirs.voxels) > 1 else 0.0
    assert driven == pytest.approx(expected, rel=1e-9, abs=1e-9)


def test_drives_by_hand():
    blocked = np.zeros(SIZE, np.float32)
    blocked[5, 5, 2] = 1.0
    east = (1.0, 0.0, 0.0)
    assert drive(blocked, (1.5, 5.5, 2.5), east, 2.0) == (2.0, MoveEnd.ARRIVED)
    assert drive(blocked, (1.5, 5.5, 2.5), east, 3.75) == (3.0, MoveEnd.OBSTACLE)  # middle of voxel 4
    assert drive(blocked, (4.25, 5.5, 2.5), east, 2.0) == (0.0, MoveEnd.OBSTACLE)
    assert drive(blocked, (1.5, 5.5, 2.5), (-1.0, 0.0, 0.0), 9.0) == (1.0, MoveEnd.WALL)
    assert drive(blocked, (1.5, 5.5, 2.5), east, 0.0) == (0.0, MoveEnd.ARRIVED)
    assert drive(blocked, (5.5, 5.5, 2.5), east, 1.0) == (1.0, MoveEnd.ARRIVED)  # out of a solid voxel
    # The face x = 5 belongs to voxel 5; the boundary x = 7 would belong to voxel 7, which does not exist.
    assert drive(blocked, (1.5, 5.5, 2.5), east, 3.5) == (3.0, MoveEnd.OBSTACLE)
    assert drive(np.zeros(SIZE, np.float32), (1.5, 5.5, 2.5), east, 5.5) == (5.0, MoveEnd.WALL)


def test_a_voxel_that_a_drive_meets_at_an_edge_only_is_none_to_stop_in():
    """The line through the edge x = 2, y = 1 meets voxel (2, 0) there, before the solid one at (2, 1)."""
    blocked = np.zeros(SIZE, np.float32)
    blocked[2, 1, 2] = 1.0
    length = math.hypot(1.75, 0.75)
    driven, end = drive(blocked, (0.25, 0.25, 2.5), (1.75 / length, 0.75 / length, 0.0), 2.0 * length)
    entered = length * 0.75 / 1.75  # x = 1
    assert (driven, end) == (pytest.approx(0.5 * (entered + length)), MoveEnd.OBSTACLE)


@drawn(150)
@given(seeds, st.sampled_from([SIZE, (3, 8, 6), (9, 6, 1)]), st.sampled_from([0.05, 0.2, 0.4]))
def test_wherever_a_drive_ends_the_body_fits(seed, size, share):
    """Between multiples of a quarter: along faces, through edges and corners, up to the boundary."""
    rng = np.random.default_rng(seed)
    blocked = random_cover(size, share, seed)
    for _ in range(10):
        start, target = rng.integers(0, 4 * np.array(size), (2, 3)) / 4
        target = target + rng.integers(0, 2, 3) * 0.25  # may be the upper boundary, or beyond it
        length = math.dist(start, target)
        if length == 0.0 or blocked[tuple(start.astype(int))] > 0.5:
            continue
        direction = (target - start) / length
        driven, end = drive(blocked, start, direction, length, target)
        place = target if end is MoveEnd.ARRIVED else start + driven * direction
        voxel = np.floor(place).astype(int)
        assert 0.0 <= driven <= length
        assert ((voxel >= 0) & (voxel < size)).all(), (start, target)
        assert blocked[tuple(voxel)] < 0.5, (start, target)


def distance_to_segment(points, begin, finish):
    """Least distance of each point to a segment, by trying 2001 places on it; (N,)."""
    places = begin + np.linspace(0.0, 1.0, 2001)[:, None] * (finish - begin)
    return np.array([np.sqrt(((places - point) ** 2).sum(axis=1)).min() for point in points])


def clear(start, direction, wanted, begin, finish, touching):
    """How far a body gets before it touches a teammate."""
    start, direction, begin, finish = (tuple(p.tolist()) for p in (start, direction, begin, finish))
    return distance_to_teammate(start, direction, wanted, begin, finish, touching)


@drawn(40)
@given(seeds, st.booleans(), st.floats(0.1, 1.5))
def test_the_distance_to_a_teammate_by_brute_force(seed, moving, touching):
    rng = np.random.default_rng(seed)
    start, begin = rng.uniform(0, 6, 3), rng.uniform(0, 6, 3)
    finish = begin + rng.uniform(-3, 3, 3) if moving else begin.copy()
    direction = rng.normal(size=3) + 0.7 * (begin - start)  # towards the teammate, more or less
    direction /= np.linalg.norm(direction)
    wanted = float(rng.uniform(0.1, 8.0))
    ours = clear(start, direction, wanted, begin, finish, touching)
    distances = np.linspace(0.0, wanted, 300)
    gaps = distance_to_segment(start + distances[:, None] * direction, begin, finish)
    assume(abs(gaps[0] - touching) > 1e-3)
    assert 0.0 <= ours <= wanted
    if gaps[0] < touching:  # they touch already: they may part, and nothing else
        parting = (np.diff(gaps) >= -1e-9).all()
        assert ours == (wanted if parting else 0.0)
        return
    assert (gaps[distances <= ours] >= touching - 1e-3).all()
    if ours < wanted:
        at = distance_to_segment((start + ours * direction)[None], begin, finish)[0]
        assert at == pytest.approx(touching, abs=1e-3)
        assert at >= touching


def test_distances_to_a_teammate_by_hand():
    start, east = np.array([1.0, 1.0, 1.0]), np.array([1.0, 0.0, 0.0])

    def free(begin, finish, touching=0.5, wanted=9.0, direction=east):
        return clear(start, direction, wanted, np.array(begin), np.array(finish), touching)

    ahead, aside, crossing = (5.0, 1.0, 1.0), (5.0, 1.6, 1.0), ((5.0, -3.0, 1.0), (5.0, 4.0, 1.0))
    assert free(ahead, ahead) == pytest.approx(3.5, abs=1e-5)
    assert free(ahead, ahead) < 3.5
    assert free(ahead, ahead, wanted=3.0) == 3.0
    assert free(aside, aside) == 9.0
    assert free((5.0, 1.3, 1.0), (5.0, 1.3, 1.0)) == pytest.approx(3.6, abs=1e-5)
    assert free(*crossing) == pytest.approx(3.5, abs=1e-5)  # it owns the whole path that it still drives
    assert free((8.0, 1.0, 1.0), ahead) == pytest.approx(3.5, abs=1e-5)
    assert free((1.0, 2.0, 1.0), (9.0, 2.0, 1.0)) == 9.0  # side by side
    assert free((0.6, 1.0, 1.0), (0.6, 1.0, 1.0)) == 9.0  # touching: parting is free
    assert free((1.4, 1.0, 1.0), (1.4, 1.0, 1.0)) == 0.0  # … coming closer is not
    assert free((-3.0, 1.0, 1.0), (-3.0, 1.0, 1.0)) == 9.0
