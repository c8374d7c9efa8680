"""Ray traversal against the slow reference, and by hand where rounding would decide."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from entropy_explore_env.belief.raycast import (
    NEVER_STOP,
    OBSTACLE,
    OPEN,
    STOP_AT_COVERED,
    TICKS,
    WALL,
    Line,
    cast_range,
    cast_ray,
    longest_crossing,
)
from tests.reference import rocha04
from tests.reference.scenes import SHAPES, drawn, flat_index, random_cover, ray_space, rays, seeds

ENDS = {OPEN: rocha04.OPEN, OBSTACLE: rocha04.HIT, WALL: rocha04.WALL}
SIZE = (7, 11, 5)
NOTHING = np.zeros(SIZE, np.float32)


def cast(cover, start, direction, length=math.inf, behind=0, hit_at_length=False, stop=STOP_AT_COVERED):
    """The library's ray as a reference Trace (voxels by number), and the distances of entry."""
    size = cover.shape
    crossing = ray_space(size, length, behind)
    start, direction = (tuple(np.asarray(place, np.float64).tolist()) for place in (start, direction))
    line = Line(start, direction, float(length))
    ray = cast_ray(cover.ravel(), size, line, stop, hit_at_length, behind, crossing)
    n = ray.voxels
    assert (crossing.voxels[n:] == -1).all()
    trace = rocha04.Trace(ray.length, crossing.voxels[:n].tolist(), ENDS[ray.reason])
    return trace, crossing.entered[:n] / TICKS


@drawn(250)
@given(rays(), seeds, st.sampled_from([0.0, 0.05, 0.3]), st.floats(0.05, 20.0), st.integers(0, 3))
def test_a_ray_crosses_what_the_reference_says(ray, seed, share, length, behind):
    size, start, direction = ray
    assume(rocha04.is_generic(start, direction, size, length))
    cover = random_cover(size, share, seed)
    for longest in (length, math.inf):
        ours, entered = cast(cover, start, direction, longest, behind)
        theirs = rocha04.trace(lambda v: cover[v] > 0.5, start, direction, size, longest, behind)
        assert ours.end == theirs.end
        assert ours.voxels == flat_index(theirs.voxels, size)
        assert ours.length == pytest.approx(theirs.length, rel=1e-9, abs=1e-9)
        pieces = rocha04.pieces_of(start, direction, size)[: len(entered)]
        expected = [min(piece.entered, theirs.length) for piece in pieces]
        assert entered == pytest.approx(expected, rel=1e-9, abs=1e-9)


@drawn(200)
@given(rays(), st.floats(0.05, 20.0), st.integers(0, 3))
def test_a_measured_distance_crosses_the_same_voxels_whatever_they_hold(ray, length, behind):
    size, start, direction = ray
    assume(rocha04.is_generic(start, direction, size, length))
    theirs = rocha04.trace(lambda v: False, start, direction, size, length, behind, hit_at_longest=True)
    for cover in (np.zeros(size, np.float32), np.ones(size, np.float32)):
        ours, _ = cast(cover, start, direction, length, behind, hit_at_length=True, stop=NEVER_STOP)
        assert ours.voxels == flat_index(theirs.voxels, size)
        assert (ours.length, ours.end) == (pytest.approx(theirs.length), theirs.end)


@drawn(60)
@given(rays(), seeds, st.sampled_from([0.0, 0.05, 0.3]), st.sampled_from([0.5, 3.0, math.inf]))
def test_a_range_is_that_of_the_ray_and_says_what_it_met(ray, seed, share, length):
    size, start, direction = ray
    cover = random_cover(size, share, seed)
    line = Line(tuple(start.tolist()), tuple(direction.tolist()), length)
    crossing = ray_space(size, length, 1)
    whole = cast_ray(cover.ravel(), size, line, STOP_AT_COVERED, False, 1, crossing)
    at, covered, reason = cast_range(cover.ravel(), size, line, STOP_AT_COVERED)
    assert (at, reason) == (whole.length, whole.reason)
    met = cover.ravel()[crossing.voxels[whole.voxels - 1]] if reason == OBSTACLE else 0.0
    assert covered == met


@drawn(60)
@given(rays(), seeds, st.sampled_from([0.5, 1.5, 3.0, math.inf]), st.integers(0, 2))
def test_a_ray_is_unbroken_and_crosses_no_voxel_twice(ray, seed, length, behind):
    """Holds for every ray, also through edges and corners."""
    size, start, direction = ray
    for at in (start, np.floor(start), np.floor(start) + 0.5):
        ours, entered = cast(random_cover(size, 0.05, seed), at, direction, length, behind)
        assert len(ours.voxels) <= longest_crossing(*size, length, behind)
        assert len(set(ours.voxels)) == len(ours.voxels)
        places = np.stack(np.unravel_index(ours.voxels, size), axis=-1)
        assert (np.abs(np.diff(places, axis=0)).sum(axis=1) == 1).all()
        assert (np.diff(entered) >= 0.0).all()
        assert entered[0] == 0.0


@pytest.mark.parametrize("size", SHAPES)
@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_along_an_axis(size, axis, sign):
    direction = np.zeros(3)
    direction[axis] = sign
    start = np.array(size) // 2 + np.array([0.5, 0.25, 0.75])
    ours, entered = cast(np.zeros(size, np.float32), start, direction)
    theirs = rocha04.trace(lambda v: False, start, direction, size, math.inf, 0)
    assert ours == (theirs.length, flat_index(theirs.voxels, size), rocha04.WALL)
    wall = size[axis] - start[axis] if sign > 0.0 else start[axis]
    assert ours.length == wall
    assert (np.diff(entered[1:]) == 1.0).all()


def row_of_voxels(*xs):
    """Numbers of voxels along x."""
    return flat_index([(x, 5, 2) for x in xs], SIZE)


@pytest.mark.parametrize(
    ("start", "direction", "more", "expected", "entered"),
    [
        # A point on a face belongs to the voxel above it: backwards a ray starts there and leaves at once.
        ((3.0, 5.5, 2.5), (1, 0, 0), {}, (4.0, row_of_voxels(3, 4, 5, 6), rocha04.WALL), [0, 1, 2, 3]),
        ((3.0, 5.5, 2.5), (-1, 0, 0), {}, (3.0, row_of_voxels(3, 2, 1, 0), rocha04.WALL), [0, 0, 1, 2]),
        ((0.5, 5.0, 2.0), (1, 0, 0), {}, (6.5, row_of_voxels(*range(7)), rocha04.WALL), None),
        # From the boundary outwards a ray has no length.
        ((7.0, 5.5, 2.5), (1, 0, 0), {}, (0.0, flat_index([(6, 5, 2)], SIZE), rocha04.WALL), None),
        ((0.0, 5.5, 2.5), (-1, 0, 0), {}, (0.0, flat_index([(0, 5, 2)], SIZE), rocha04.WALL), None),
        ((3.5, 11.0, 2.5), (0, 1, 0), {}, (0.0, flat_index([(3, 10, 2)], SIZE), rocha04.WALL), None),
        ((3.5, 5.5, 5.0), (0, 0, 1), {}, (0.0, flat_index([(3, 5, 4)], SIZE), rocha04.WALL), None),
        (
            (7.0, 11.0, 5.0),
            (0, 0, -1),
            {},
            (5.0, flat_index([(6, 10, z) for z in (4, 3, 2, 1, 0)], SIZE), rocha04.WALL),
            None,
        ),
        # Through an edge a ray goes along x first, then y, then z.
        (
            (0.5, 0.5, 0.5),
            (1, 1, 1),
            {"length": 1.0},
            (1.0, flat_index([(0, 0, 0), (1, 0, 0), (1, 1, 0), (1, 1, 1)], SIZE), rocha04.OPEN),
            None,
        ),
        # A range that ends on a face is open and does not reach the voxel there, also at the wall.
        ((2.5, 5.5, 2.5), (1, 0, 0), {"length": 1.5}, (1.5, row_of_voxels(2, 3), rocha04.OPEN), None),
        ((2.5, 5.5, 2.5), (1, 0, 0), {"length": 4.5}, (4.5, row_of_voxels(*range(2, 7)), rocha04.OPEN), None),
        # A measured distance up to a face is a hit of the voxel there; one beyond the wall ends there.
        (
            (2.5, 5.5, 2.5),
            (1, 0, 0),
            {"length": 1.5, "behind": 2, "hit_at_length": True},
            (1.5, row_of_voxels(2, 3, 4, 5), rocha04.HIT),
            None,
        ),
        (
            (2.5, 5.5, 2.5),
            (1, 0, 0),
            {"length": 9.0, "behind": 2, "hit_at_length": True},
            (4.5, row_of_voxels(*range(2, 7)), rocha04.WALL),
            None,
        ),
    ],
)
def test_rays_through_empty_space_by_hand(start, direction, more, expected, entered):
    ours, distances = cast(NOTHING, start, direction, **more)
    assert ours == expected
    assert entered is None or distances.tolist() == entered


@pytest.mark.parametrize("signs", [(1, 1, 1), (-1, 1, 1), (1, -1, -1), (-1, -1, -1), (1, 1, 0), (0, -1, 1)])
def test_through_edges_and_corners_only_touched_voxels_come_extra(signs):
    """Exactly diagonal: the voxels that the reference crosses, and between them touched ones."""
    direction = np.array(signs, np.float64)
    start = np.array([3.5, 5.5, 2.5])
    theirs = rocha04.trace(lambda v: False, start, direction, SIZE, math.inf, 0)
    ours, entered = cast(NOTHING, start, direction)  # not of unit length, so that ties are exact
    crossed = flat_index(theirs.voxels, SIZE)
    assert ours.length == theirs.length
    assert [voxel for voxel in ours.voxels if voxel in crossed] == crossed
    left = np.append(entered[1:], ours.length)
    touched = [voxel for voxel, inside in zip(ours.voxels, left - entered, strict=True) if inside == 0.0]
    assert sorted(touched + crossed) == sorted(ours.voxels)
    an_edge = abs(direction).sum() - 1
    assert (len(crossed) - 1) * an_edge <= len(touched) <= len(crossed) * an_edge


def test_coverage_of_a_half_does_not_stop_a_ray():
    cover = NOTHING.copy()
    cover[4, 5, 2] = 0.5
    assert cast(cover, (2.25, 5.5, 2.5), (1.0, 0.0, 0.0))[0].end == rocha04.WALL
    cover[4, 5, 2] = np.nextafter(np.float32(0.5), np.float32(1.0))
    assert cast(cover, (2.25, 5.5, 2.5), (1.0, 0.0, 0.0))[0].end == rocha04.HIT


@pytest.mark.parametrize(
    ("covered", "x", "behind", "expected"),
    [
        ((2, 5), 2.25, 1, (2.75, row_of_voxels(2, 3, 4, 5), rocha04.HIT)),  # it leaves its own voxel freely
        ((6,), 4.5, 3, (1.5, row_of_voxels(4, 5, 6), rocha04.HIT)),  # nothing lies behind the last voxel
    ],
)
def test_hits_of_covered_voxels_by_hand(covered, x, behind, expected):
    cover = NOTHING.copy()
    cover[list(covered), 5, 2] = 1.0
    assert cast(cover, (x, 5.5, 2.5), (1.0, 0.0, 0.0), behind=behind)[0] == expected
