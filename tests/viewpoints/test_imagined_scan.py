"""Bits of imagined scans: those of `expected_scan` in known free space, less where walls have gaps."""

from __future__ import annotations

import math

import numpy as np
import pytest

from entropy_explore_env.belief.fields import Belief
from entropy_explore_env.belief.visibility import CONE, cone_of, mark_cones
from entropy_explore_env.scenarios import BOX
from entropy_explore_env.settings import Grid
from entropy_explore_env.viewpoints.evaluation import new_scratch, robot_model
from entropy_explore_env.viewpoints.expected_scan import expected_scan_bits
from entropy_explore_env.viewpoints.imagined_scan import imagined_bits
from tests.reference.scenes import random_belief

SIZE = (7, 11, 5)
MODEL = robot_model(BOX, BOX.kinds[0], 1, 0.1)
NO_CONES = np.zeros(0, CONE)


def imagined(belief, viewpoints, gap, cones=NO_CONES, model=MODEL, size=SIZE):
    scratch = new_scratch(Grid(size, 0.5), [model])
    bits = np.full(len(viewpoints), np.nan)
    imagined_bits(belief, model.scan, gap, viewpoints, cones, scratch, bits)
    assert not scratch.added.any() and not scratch.left.any()
    return bits


def drawn_viewpoints(count, size=SIZE, seed=0):
    rng = np.random.default_rng(seed)
    places = rng.uniform(0.1, 0.9, (count, 3)) * size
    return np.column_stack([places, rng.uniform(-math.pi, math.pi, count), rng.uniform(-1.0, 1.0, count)])


@pytest.mark.parametrize("seed", range(4))
def test_without_partly_covered_voxels_and_gaps_it_is_the_expected_scan(seed):
    mean, precision = random_belief(SIZE, seed)
    mean = np.where(mean > 0.8, mean, 0.0).astype(np.float32)
    belief = Belief(mean.reshape(-1), precision.reshape(-1), SIZE)
    viewpoints, cones = drawn_viewpoints(9, seed=seed), np.zeros(1, CONE)
    cones[0] = cone_of(viewpoints[0], 3.0, 0.6)
    scratch = new_scratch(BOX.grid, [MODEL])
    mark_cones(cones, SIZE, scratch.left, 1)
    expected = [expected_scan_bits(belief, MODEL.scan, each, scratch) for each in viewpoints]
    np.testing.assert_allclose(imagined(belief, viewpoints, 0.1, cones), expected, rtol=1e-5)


def row_belief(mean_of_second, known=True):
    """A row of 9 voxels along x: known and free but for the third, with its own mean."""
    size = (9, 1, 1)
    mean, precision = np.zeros(9, np.float32), np.full(9, 100.0, np.float32)
    mean[2] = mean_of_second
    if not known:
        precision[2] = 1.0 / 900.0
    return Belief(mean, precision, size), size


def one_ray(size):
    scan = MODEL.scan._replace(
        yaws=np.zeros(1), pitches=np.zeros(1), sensor_rays=1.0, max_range_m=4.5, voxels_behind=0
    )
    return MODEL._replace(scan=scan), np.array([[0.5, 0.5, 0.5, 0.0, 0.0]])


@pytest.mark.parametrize(("mean", "beyond"), [(0.0, 1.0), (0.1, 0.8), (0.5, 0.0)])
def test_a_partly_covered_voxel_stops_a_ray_with_twice_its_coverage(mean, beyond):
    """By hand: 3 voxels with the whole gain, 6 with what gets through."""
    belief, size = row_belief(mean)
    model, viewpoint = one_ray(size)
    gain = (model.scan.sigma_min + model.scan.sigma_slope_per_m * 4.25) ** -2
    expected = 1.5 * math.log2(1.0 + gain / 100.0) + 3.0 * math.log2(1.0 + beyond * gain / 100.0)
    assert imagined(belief, viewpoint, 0.9, model=model, size=size)[0] == pytest.approx(expected, rel=1e-5)


def test_an_unknown_voxel_beside_a_covered_one_hides_what_lies_behind():
    size = (9, 3, 1)
    mean, precision = np.zeros(size, np.float32), np.full(size, 100.0, np.float32)
    mean[4, 0, 0] = mean[4, 2, 0] = 1.0  # a wall, in which the middle was not hit
    precision[4, 1, 0] = 1.0 / 900.0
    precision[5:] = 1.0 / 900.0
    belief = Belief(mean.reshape(-1), precision.reshape(-1), size)
    model, viewpoint = one_ray(size)
    viewpoint[0, 1] = 1.5
    open_wall, closed = (imagined(belief, viewpoint, gap, model=model, size=size)[0] for gap in (0.1, 1.0))
    mean[4, 0, 0] = mean[4, 2, 0] = 0.0
    no_wall = imagined(belief, viewpoint, 1.0, model=model, size=size)[0]
    assert no_wall == pytest.approx(open_wall, rel=1e-6)
    gain = (model.scan.sigma_min + model.scan.sigma_slope_per_m * 4.25) ** -2
    known, unknown = 0.5 * math.log2(1.0 + gain / 100.0), 0.5 * math.log2(1.0 + gain * 900.0)
    assert closed == pytest.approx(4 * known + unknown, rel=1e-5)
