"""The belief of coverage against the paper's equations in (mean, σ) form."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from entropy_explore_env.belief.entropy import map_entropy_bits
from entropy_explore_env.belief.map_update import expected_utility, fuse_ray, fuse_row
from entropy_explore_env.belief.measurement_model import measured_coverage, measurement_precision
from entropy_explore_env.belief.raycast import NEVER_STOP, Line, cast_ray
from entropy_explore_env.settings.ending import gaussian_entropy_bits
from tests.reference import rocha04
from tests.reference.scenes import (
    as_arrays,
    as_reference,
    drawn,
    flat_index,
    random_belief,
    ray_space,
    rays,
    seeds,
)

SENSOR = rocha04.Sensor(0.25, 0.08, 0.006)


def precision_of(range_m, sensor=SENSOR):
    return measurement_precision(float(range_m), sensor.sigma_min, sensor.zeta_per_m, 1.0)


def cross(size, start, direction, length, behind=1):
    """The Crossing of a measured hit, and how many voxels it has."""
    crossing = ray_space(size, length, behind)
    cover = np.zeros(math.prod(size), np.float32)
    line = Line(tuple(start.tolist()), tuple(direction.tolist()), length)
    return crossing, cast_ray(cover, size, line, NEVER_STOP, True, behind, crossing).voxels


def measured(start, length, size, crossing, n, coverage):
    """Fill the coverage that a hit measures; returns its first voxel that may be covered."""
    return measured_coverage(tuple(start.tolist()), length, size, crossing, n, coverage)


def fuse(mean, precision, crossed, coverage, free, n, gain):
    return fuse_ray(mean.ravel(), precision.ravel(), crossed, coverage, free, n, gain)


@drawn(60)
@given(st.floats(0.0, 50.0), st.floats(1e-3, 5.0), st.floats(0.0, 0.5), st.sampled_from([0.5, 1.0, 2.0, 3.0]))
def test_the_precision_of_a_measurement_is_that_of_equation_5(range_m, sigma_min, zeta, exponent):
    """And of Sujan's eq. 4, by which noise grows with a power of the distance."""
    ours = measurement_precision(range_m, sigma_min, zeta, exponent)
    expected = rocha04.measured_sigma(range_m**exponent, sigma_min, zeta) ** -2
    assert ours == pytest.approx(expected, rel=1e-12)


@drawn(250)
@given(rays(), st.floats(0.05, 20.0), st.integers(0, 3))
def test_the_coverage_of_a_measurement_is_that_of_equation_4(ray, length, behind):
    size, start, direction = ray
    assume(rocha04.is_generic(start, direction, size, length))
    voxels = rocha04.trace(lambda v: False, start, direction, size, length, behind, True).voxels
    crossing, n = cross(size, start, direction, length, behind)
    coverage = np.full(len(crossing.voxels), np.nan, np.float32)
    free = measured(start, length, size, crossing, n, coverage)
    assert 0 <= free <= n
    coverage[:free] = 0.0
    expected = [rocha04.measured_mean(rocha04.centre_distance(start, voxel), length, 1.0) for voxel in voxels]
    assert coverage[:n] == pytest.approx(expected, abs=1e-6)
    assert np.isnan(coverage[n:]).all()


def test_the_coverage_of_a_measurement_along_an_axis():
    """From x = 0.5 the centres are 0, 1, 2, … away; a hit at 2.25 leaves voxel 2 a quarter covered."""
    start, direction = np.array([0.5, 5.5, 2.5]), np.array([1.0, 0.0, 0.0])
    crossing, n = cross((7, 11, 5), start, direction, 2.25, 2)
    coverage = np.zeros(len(crossing.voxels), np.float32)
    measured(start, 2.25, (7, 11, 5), crossing, n, coverage)
    assert crossing.voxels[:n].tolist() == flat_index([(x, 5, 2) for x in range(5)], (7, 11, 5))
    assert coverage[:n].tolist() == [0.0, 0.0, 0.25, 1.0, 1.0]


@drawn(250)
@given(rays(), seeds, st.floats(0.05, 20.0), st.integers(0, 2), st.booleans())
def test_fusing_a_ray_is_the_product_of_gaussians(ray, seed, length, behind, hit):
    size, start, direction = ray
    assume(rocha04.is_generic(start, direction, size, length))
    mean, precision = random_belief(size, seed)
    beliefs, before = as_reference(mean, precision), precision.copy()
    voxels = rocha04.trace(lambda v: False, start, direction, size, length, behind, True).voxels
    range_m = length * SENSOR.voxel_size_m
    expected_bits = rocha04.integrate(beliefs, voxels, start, range_m, hit, SENSOR)

    crossing, n = cross(size, start, direction, length, behind)
    coverage = np.full(len(crossing.voxels), np.nan, np.float32)
    free = measured(start, length, size, crossing, n, coverage) if hit else n
    promised = expected_utility(precision.ravel(), crossing.voxels, n, precision_of(range_m))
    bits = fuse(mean, precision, crossing.voxels, coverage, free, n, precision_of(range_m))

    expected_mean, expected_precision = as_arrays(beliefs, size)
    np.testing.assert_allclose(mean, expected_mean, rtol=0, atol=2e-6)
    np.testing.assert_allclose(precision, expected_precision, rtol=1e-5)
    assert bits == pytest.approx(expected_bits, rel=1e-5, abs=1e-5)
    assert promised == pytest.approx(expected_bits, rel=1e-5, abs=1e-5)
    drop = rocha04.map_entropy_bits(before.ravel() ** -0.5) - rocha04.map_entropy_bits(
        precision.ravel() ** -0.5
    )
    assert bits == pytest.approx(drop, rel=1e-4, abs=1e-3)
    off_the_ray = np.ones(size, bool)
    off_the_ray.ravel()[crossing.voxels[:n]] = False
    assert (precision[off_the_ray] == before[off_the_ray]).all()
    assert (precision >= before).all()
    assert (mean >= 0.0).all()
    assert (mean <= 1.0).all()


def test_figure_2():
    mean, precision = np.array([0.35], np.float32), np.array([0.075**-2], np.float32)
    promised = expected_utility(precision, np.zeros(1, np.int32), 1, 100.0)
    bits = fuse_ray(mean, precision, np.zeros(1, np.int32), np.array([0.4], np.float32), 0, 1, 100.0)
    assert (round(float(mean[0]), 3), round(float(precision[0]) ** -0.5, 3)) == (0.368, 0.06)
    assert round(bits, 3) == round(promised, 3) == 0.322


@pytest.mark.parametrize("n", [0, 1, 15, 16, 17, 31, 32, 33, 100])
def test_utility_of_long_rays_is_folded_without_loss(n):
    """The most extreme settings allowed: σ falls from 1e4 to 1e-4 in every voxel."""
    mean, precision = np.full(n, 0.5, np.float32), np.full(n, 1e-8, np.float32)
    crossed, coverage = np.arange(n, dtype=np.int32), np.zeros(n, np.float32)
    promised = expected_utility(precision, crossed, n, 1e8)
    bits = fuse_ray(mean, precision, crossed, coverage, n, n, 1e8)
    assert bits == pytest.approx(n * math.log2(1e8), rel=1e-6)
    assert promised == pytest.approx(n * math.log2(1e8), rel=1e-6)
    mean, precision = np.full(n, 0.5, np.float32), np.full(n, 1e-8, np.float32)
    bits = fuse_ray(mean, precision, crossed, coverage + np.float32(0.75), 0, n, 1e8)  # all of it covered
    assert bits == pytest.approx(n * math.log2(1e8), rel=1e-6)
    assert mean == pytest.approx(0.75) and precision == pytest.approx(1e8)


def test_a_row_of_voxels_is_fused_with_one_gaussian_by_hand():
    """Voxels of precisions 2 and 6, with coverage 1 of precision 2: twice as precise, and 4/3 times."""
    mean, precision = np.array([0.5, 0.0, 0.2, 0.7], np.float32), np.array([9, 2, 6, 9], np.float32)
    bits, shrink = fuse_row(mean, precision, 1, 3, np.float32(1.0), np.float32(2.0))
    assert (bits, shrink) == (0.0, pytest.approx(0.5 * 0.75))
    assert precision.tolist() == [9, 4, 8, 9]
    assert mean == pytest.approx([0.5, 0.5, 0.4, 0.7])


@pytest.mark.parametrize("n", [1, 6, 7, 8, 100])
def test_the_bits_of_long_rows_are_folded_without_loss(n):
    """σ falls from 1e4 to 1e-4 in every voxel."""
    mean, precision = np.full(n, 0.5, np.float32), np.full(n, 1e-8, np.float32)
    bits, shrink = fuse_row(mean, precision, 0, n, np.float32(0.75), np.float32(1e8))
    assert bits - 0.5 * math.log2(shrink) == pytest.approx(n * math.log2(1e8), rel=1e-6)
    assert (bits > 0.0) == (n > 6)  # seven ratios of 1e-16 are below what is folded
    assert mean == pytest.approx(0.75) and precision == pytest.approx(1e8)


def test_a_measurement_that_says_nothing_new_brings_nothing():
    """Precision saturates in float32: then neither it nor the entropy moves."""
    mean, precision = np.array([0.25], np.float32), np.array([1e12], np.float32)
    crossed, coverage = np.zeros(1, np.int32), np.ones(1, np.float32)
    assert fuse_ray(mean, precision, crossed, coverage, 0, 1, 100.0) == 0.0
    assert (mean[0], precision[0]) == (np.float32(0.25), np.float32(1e12))


@drawn(30)
@given(seeds, st.sampled_from([(7, 11, 5), (3, 8, 6), (9, 6, 1)]))
def test_the_entropy_of_a_map_is_that_of_equation_25(seed, size):
    _, precision = random_belief(size, seed)
    expected = rocha04.map_entropy_bits(precision.astype(np.float64).ravel() ** -0.5)
    assert map_entropy_bits(precision) == pytest.approx(expected, rel=1e-9)
    stacked = np.stack([precision, 4 * precision])[None]
    assert map_entropy_bits(stacked).shape == (1, 2)
    assert map_entropy_bits(stacked)[0] == pytest.approx([expected, expected - math.prod(size)], rel=1e-9)


def test_the_entropy_of_one_gaussian():
    for sigma in (30.0, 1.0, 0.03):
        assert gaussian_entropy_bits(sigma) == pytest.approx(rocha04.entropy_bits(sigma), rel=1e-12)


@drawn(30)
@given(seeds)
def test_the_order_of_measurements_does_not_matter_to_the_belief(seed):
    """Products commute: beliefs agree to rounding, and so does the entropy taken in all."""
    rng = np.random.default_rng(seed)
    size, start = (7, 11, 5), rng.uniform(0.5, 4.5, 3)
    rays_taken = []
    for _ in range(12):
        direction = np.array(rocha04.gaze(rng.uniform(-3, 3), rng.uniform(-1.5, 1.5)))
        length = float(rng.uniform(1.0, 8.0))
        crossing, n = cross(size, start, direction, length)
        coverage = np.zeros(len(crossing.voxels), np.float32)
        free = measured(start, length, size, crossing, n, coverage)
        rays_taken.append((crossing.voxels, coverage, free, n, precision_of(length * 0.25)))
    results = []
    for order in (range(12), rng.permutation(12)):
        mean, precision = random_belief(size, seed)
        bits = sum(fuse(mean, precision, *rays_taken[ray]) for ray in order)
        results.append((mean, precision, bits))
    np.testing.assert_allclose(results[0][0], results[1][0], atol=2e-6)
    np.testing.assert_allclose(results[0][1], results[1][1], rtol=2e-6)
    assert results[0][2] == pytest.approx(results[1][2], abs=1e-3)
