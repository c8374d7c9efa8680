"""The slow reference itself, on cases worked out by hand and on the numbers that the paper prints."""

from __future__ import annotations

import math

import pytest

from tests.reference import rocha04

SIZE = (7, 11, 5)


def test_a_voxel_touched_in_a_corner_is_not_crossed():
    half = math.sqrt(0.5)
    pieces = rocha04.pieces_of((0.5, 0.5, 0.5), (half, half, 0.0), (3, 3, 1))
    assert [piece.voxel for piece in pieces] == [(0, 0, 0), (1, 1, 0), (2, 2, 0)]
    assert not rocha04.is_generic((0.5, 0.5, 0.5), (half, half, 0.0), (3, 3, 1), math.inf)


def test_figure_1_the_sensor_model_at_60_cm():
    """d = 60 cm, vsz = 25 cm: 0 up to 47.5 cm, 1 from 72.5 cm, in between a straight line."""
    expected = {0.0: 0.0, 0.47: 0.0, 0.475: 0.0, 0.60: 0.5, 0.65: 0.7, 0.725: 1.0, 1.0: 1.0}
    for distance, mean in expected.items():
        assert rocha04.measured_mean(distance, 0.60, 0.25) == pytest.approx(mean, abs=1e-12)
    assert rocha04.measured_sigma(60.0, 0.08, 0.0005) == pytest.approx(0.11)


def test_entropy_is_the_integral_of_equation_14():
    sigma, tick, total = 0.3, 0.001, 0.0
    for n in range(-3000, 3001):
        density = math.exp(-0.5 * (n * tick / sigma) ** 2) / (sigma * math.sqrt(2 * math.pi))
        total -= tick * density * math.log2(density) if density > 0.0 else 0.0
    assert rocha04.entropy_bits(sigma) == pytest.approx(total, abs=1e-6)


def test_the_entropies_of_the_paper_s_room():
    assert rocha04.map_entropy_bits([30.0] * 28577) == pytest.approx(198724.06, abs=0.01)
    assert rocha04.map_entropy_bits([0.03] * 28577) == pytest.approx(-86068.15, abs=0.01)


def test_utility_is_the_entropy_that_a_measurement_takes():
    """Two voxels in front of the hit and the one that it is in: eq. 26 is eq. 27."""
    beliefs = {(x, 0, 0): (0.5, 0.1 * (x + 1)) for x in range(4)}
    before = rocha04.map_entropy_bits(sigma for _, sigma in beliefs.values())
    sensor = rocha04.Sensor(0.5, 0.08, 0.01)
    bits = rocha04.integrate(beliefs, [(0, 0, 0), (1, 0, 0), (2, 0, 0)], (0.5, 0.5, 0.5), 1.0, True, sensor)
    assert before - rocha04.map_entropy_bits(s for _, s in beliefs.values()) == pytest.approx(bits)
    assert bits == pytest.approx(0.5 * sum(math.log2(1 + (s / 0.09) ** 2) for s in (0.1, 0.2, 0.3)))
    assert beliefs[3, 0, 0] == (0.5, 0.4)
    weight = 0.09**-2 / (0.09**-2 + 0.1**-2)
    assert beliefs[0, 0, 0][0] == pytest.approx(0.5 * (1 - weight))
    # The hit is 1 m away, the centre of voxel 2 too: it measures ½, as it was before.
    assert beliefs[2, 0, 0][0] == pytest.approx(0.5)


def test_candidates_are_the_voxels_whose_centres_are_within_reach():
    assert rocha04.candidates((2.5, 3.5, 1.5), 1.0, SIZE) == [
        (1, 3, 1),
        (2, 2, 1),
        (2, 3, 0),
        (2, 3, 1),
        (2, 3, 2),
        (2, 4, 1),
        (3, 3, 1),
    ]
    assert rocha04.candidates((0.5, 0.5, 0.5), 1.0, SIZE) == [(0, 0, 0), (0, 0, 1), (0, 1, 0), (1, 0, 0)]
    assert len(rocha04.candidates((2.5, 3.5, 2.5), 2.0, SIZE)) == 33  # all offsets up to 2 voxels long
    assert rocha04.candidates((2.0, 3.0, 2.0), 0.8, SIZE) == []  # the nearest centres are √¾ away


def test_the_motion_plane_of_a_level_robot_is_horizontal():
    ahead, left = rocha04.motion_axes(math.pi / 2, 0.0)
    assert ahead == pytest.approx([0.0, 1.0, 0.0], abs=1e-12)
    assert left == pytest.approx([-1.0, 0.0, 0.0], abs=1e-12)
    assert rocha04.on_plane([3.0, 4.0, 5.0], (ahead, left)) == pytest.approx([3.0, 4.0, 0.0])


def test_the_motion_axes_follow_the_gaze():
    for yaw, pitch in ((0.4, 0.3), (-2.0, -1.0), (3.0, 0.9)):
        ahead, left = rocha04.motion_axes(yaw, pitch)
        assert ahead == pytest.approx(rocha04.gaze(yaw, pitch))
        assert left == pytest.approx([-math.sin(yaw), math.cos(yaw), 0.0])
        assert sum(a * b for a, b in zip(ahead, left, strict=True)) == pytest.approx(0.0, abs=1e-12)
    ahead, left = rocha04.motion_axes(0.4, 0.3, roll=math.pi / 2)
    assert left[2] == pytest.approx(-math.cos(0.3))  # rolled on its side, its plane stands upright


def test_what_lies_across_the_motion_plane_cannot_be_reached():
    axes = rocha04.motion_axes(0.7, 0.0)
    assert rocha04.reachability((2.5, 3.5, 1.5), (2, 3, 3), axes) == pytest.approx(0.0, abs=1e-12)
    assert rocha04.reachability((2.5, 3.5, 1.5), (4, 6, 1), axes) == pytest.approx(1.0)
    assert rocha04.reachability((2.5, 3.5, 1.5), (2, 3, 1), axes) == 1.0
    assert rocha04.reachability((2.5, 3.5, 1.5), (2, 4, 2), axes) == pytest.approx(math.sqrt(0.5))


def test_the_choice_weighs_steepness_by_free_space():
    """One voxel of known entropy: the voxels after it, seen from below, are steep, and it is itself."""
    beliefs = {(x, y, z): (0.5, 1.0) for x in range(7) for y in range(11) for z in range(5)}
    beliefs[3, 5, 2] = (0.0, 0.25)
    best = rocha04.choose(beliefs, (3.5, 5.5, 2.5), 1.0, SIZE)
    assert best[0].voxel == (3, 5, 2)  # ∇h = (-2, -2, -2), μ = 0
    assert best[0].score == pytest.approx(2 * math.sqrt(3))
    assert best[0].gaze == pytest.approx([-(3**-0.5)] * 3)
    assert {choice.voxel for choice in best[1:4]} == {(4, 5, 2), (3, 6, 2), (3, 5, 3)}
    assert [choice.score for choice in best[1:5]] == pytest.approx([1.0, 1.0, 1.0, 0.0])
    assert best[-1].gaze is None
    level = rocha04.choose(beliefs, (3.5, 5.5, 2.5), 1.0, SIZE, rocha04.motion_axes(0.3, 0.0))
    assert level[0].voxel == (3, 5, 2)
    assert level[0].gaze == pytest.approx([-(2**-0.5), -(2**-0.5), 0.0], abs=1e-12)
    scores = {choice.voxel: choice.score for choice in level}
    assert scores[3, 5, 3] == pytest.approx(0.0, abs=1e-12)  # steep, but straight above


@pytest.mark.parametrize(
    ("length_m", "duration_s"), [(0.0, 0.0), (0.0625, 1.0), (0.25, 2.0), (0.5, 3.0), (1.0, 5.0)]
)
def test_driving_times_of_the_paper_s_robot(length_m, duration_s):
    """v = 0.25 m/s, a = 0.25 m/s²: 2√(L/a) up to 0.25 m, then L/v + 1 s."""
    assert rocha04.drive_s(length_m, 0.25, 0.25) == pytest.approx(duration_s)
    assert rocha04.way_at_m(duration_s, length_m, 0.25, 0.25) == pytest.approx(length_m, abs=1e-6)
