"""Whether a line is free for a body, how soon a viewpoint is reached, and what is expected there."""

from __future__ import annotations

import math

import numpy as np
import pytest

from entropy_explore_env.belief.fields import Belief
from entropy_explore_env.belief.visibility import CONE, cone_of
from entropy_explore_env.scenarios import BOX
from entropy_explore_env.settings import RangeSensor
from entropy_explore_env.viewpoints.evaluation import (
    Outlook,
    evaluate_viewpoints,
    expected_outlook,
    is_line_free,
    new_scratch,
    robot_model,
    sees_all_around,
)
from entropy_explore_env.viewpoints.expected_scan import new_scan_scratch
from tests.reference.scenes import random_belief

SIZE = (7, 11, 5)


def line_free(mean, start, finish, radius):
    belief = Belief(mean.ravel(), mean.ravel(), SIZE)
    extent = np.asarray(finish, float) - start
    return is_line_free(belief, np.asarray(start, float), extent, radius, new_scan_scratch(1, 60, 1))


def test_lines_leave_room_for_the_body():
    mean = np.zeros(SIZE, np.float32)
    mean[3, 6, 2] = 0.9
    south, north = (3.5, 2.5, 2.5), (3.5, 9.5, 2.5)
    assert not line_free(mean, south, north, 0.2)
    aside = [(2.2, 2.5, 2.5), (2.2, 9.5, 2.5)]  # 0.8 before the face of the solid voxel
    assert line_free(mean, *aside, 0.2) and line_free(mean, *aside, 0.7)
    assert not line_free(mean, *aside, 0.9)
    assert line_free(mean, south, (3.5, 4.5, 2.5), 1.2)  # ends 1.5 before it
    assert not line_free(mean, south, (3.5, 5.0, 2.5), 1.2)
    assert not line_free(mean, (0.5, 2.5, 2.5), (0.5, 9.5, 2.5), 0.6)  # along the wall, into it
    assert line_free(mean, south, south, 3.0)  # nothing is driven


def test_a_viewpoint_behind_an_obstacle_is_worth_nothing_unless_the_line_does_not_matter():
    model = robot_model(BOX, BOX.kinds[0])
    scratch = new_scratch(BOX.grid, [model])
    x, y, z = BOX.grid.shape
    mean, precision = np.zeros(BOX.grid.shape, np.float32), np.full(BOX.grid.shape, 0.01, np.float32)
    mean[:, y // 2] = 1.0
    here = np.array([0.5 * x, 1.5, 0.5 * z, 0.0, 0.0])
    beyond, turned = here.copy(), here.copy()
    beyond[1], turned[3] = y - 1.5, math.pi / 2
    belief, viewpoints = Belief(mean.ravel(), precision.ravel(), BOX.grid.shape), np.array([beyond, turned])
    found = expected_outlook(belief, model, here, viewpoints, np.zeros(0, CONE), scratch)
    assert found.bits[0] == 0.0 and found.bits[1] > 0.0
    assert found.seconds[0] > found.seconds[1] >= model.drive.scan_time_s
    anywhere = model._replace(drive=model.drive._replace(line_must_be_free=False))
    everywhere = expected_outlook(belief, anywhere, here, viewpoints, np.zeros(0, CONE), scratch)
    assert everywhere.bits[0] > 0.0 and everywhere.bits[1] == found.bits[1]


@pytest.mark.parametrize(("degrees", "all_around"), [(360.0, True), (350.0, True), (340.0, False)])
def test_a_sensor_sees_all_around_if_its_rays_leave_no_gap(degrees, all_around):
    sensor = RangeSensor((math.radians(degrees), 0.0), math.radians(10.0))
    assert sees_all_around(sensor) == all_around


def test_what_is_left_to_teammates_counts_nothing_and_is_forgotten_afterwards():
    """On the spot, so that no line has to be free; the cone holds all that there is, or nothing."""
    size = BOX.grid.shape
    model = robot_model(BOX, BOX.kinds[0])
    mean, precision = random_belief(size, 3)
    belief = Belief(mean.reshape(-1), precision.reshape(-1), size)
    here, scratch = np.array([3.5, 5.5, 2.5]), new_scratch(BOX.grid, [model])
    viewpoints = np.array([[*here, yaw, 0.0] for yaw in (0.0, 2.0)])
    everywhere = np.array([cone_of(np.array([*here, 0.0, 0.0]), math.inf, math.pi)])
    told = []
    for cones in (np.zeros(0, CONE), everywhere, np.zeros(0, CONE)):
        outlook = Outlook(np.full(2, np.nan), np.full(2, np.nan))
        at = np.array([*here, 0.0, 0.0])
        evaluate_viewpoints(belief, model.scan, model.drive, at, viewpoints, cones, scratch, outlook)
        told.append(outlook.bits)
    assert (told[0] > 0.0).all() and (told[1] == 0.0).all()
    np.testing.assert_array_equal(told[0], told[2])
