"""Whether a line is free for a body, how soon a viewpoint is reached, and what is expected there."""

from __future__ import annotations

import math

import numpy as np
import pytest

from entropy_explore_env.belief.fields import Belief
from entropy_explore_env.belief.paths.lattice import new_lattice
from entropy_explore_env.belief.paths.planning import ANY_GOAL, search_paths
from entropy_explore_env.belief.paths.search import cost_to, new_search
from entropy_explore_env.settings.scenarios import BOX
from entropy_explore_env.settings.sensor import RangeSensor
from entropy_explore_env.viewpoints.evaluation import (
    DriveModel,
    line_is_free,
    new_scratch,
    robot_model,
    sees_all_around,
    straight_seconds,
    travel_seconds,
    voxel_at,
)
from entropy_explore_env.viewpoints.expected_scan import new_scan_scratch
from tests.belief.paths.graphs import belief_costs

SIZE = (7, 11, 5)
WALLED, EDGE_M = (9, 13, 1), 0.5
DRIVE = DriveModel(1.0, 1.0, math.pi / 2, 0.5, 0.0)


def line_free(mean, start, finish, radius):
    belief = Belief(mean.ravel(), mean.ravel(), SIZE)
    ends = np.array([start, finish], float)
    return line_is_free(belief, ends[0], ends[1], radius, new_scan_scratch(1, 60, 1))


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


def test_a_viewpoint_behind_an_obstacle_is_never_reached_straight():
    model = robot_model(BOX, BOX.kinds[0])
    scratch = new_scratch(BOX.grid, [model])
    x, y, z = BOX.grid.shape
    mean = np.zeros(BOX.grid.shape, np.float32)
    mean[:, y // 2] = 1.0
    belief = Belief(mean.ravel(), mean.ravel(), BOX.grid.shape)
    here = np.array([0.5 * x, 1.5, 0.5 * z, 0.0, 0.0])
    beyond, turned = here.copy(), here.copy()
    beyond[1], turned[3] = y - 1.5, math.pi / 2
    drive, edge_m = model.drive, BOX.grid.voxel_size_m
    assert math.isinf(straight_seconds(belief, edge_m, drive, here, beyond, scratch))
    turning = straight_seconds(belief, edge_m, drive, here, turned, scratch)
    assert turning == pytest.approx(0.5 * math.pi / drive.turn_rate_rad_s + drive.scan_time_s)


@pytest.mark.parametrize(("degrees", "all_around"), [(360.0, True), (350.0, True), (340.0, False)])
def test_a_sensor_sees_all_around_if_its_rays_leave_no_gap(degrees, all_around):
    sensor = RangeSensor((math.radians(degrees), 0.0), math.radians(10.0))
    assert sees_all_around(sensor) == all_around


@pytest.fixture
def search():
    """A robot at (1.5, 1.5); a wall at x = 4 that is open at y = 12."""
    mean = np.zeros(WALLED, np.float32)
    mean[4, :12] = 1.0
    costs = belief_costs(mean, np.full(WALLED, 100.0, np.float32), 1e-3)
    found, lattice = new_search(mean.size), new_lattice(WALLED)
    source = np.array([np.ravel_multi_index((1, 1, 0), WALLED)], np.int32)
    search_paths(found, lattice, costs, source, ANY_GOAL, math.inf)
    return found


def seconds_of(search, viewpoints, reach=math.inf):
    here = np.array([1.5, 1.5, 0.5, 0.0, 0.0])
    places = [(np.array(at), cost_to(search, voxel_at(WALLED, at))) for at in viewpoints]
    return [travel_seconds(DRIVE, EDGE_M, here, at, cost, reach) for at, cost in places]


def test_seconds_are_those_of_the_longer_of_drive_and_turn_and_of_the_scan(search):
    stay, turn, ahead, wall = seconds_of(
        search,
        [
            (1.5, 1.5, 0.5, 0.0, 0.0),
            (1.5, 1.5, 0.5, -math.pi / 2, 0.0),
            (1.5, 9.5, 0.5, 0.0, 0.0),
            (4.5, 3.5, 0.5, 0.0, 0.0),
        ],
    )
    assert (stay, turn) == pytest.approx((0.5, 1.5))
    assert ahead == pytest.approx(4.0 + 1.0 + 0.5)  # 4 m at 1 m/s, and a second for the ramps
    assert math.isinf(wall)


def test_paths_around_corners_are_longer_than_the_straight_line(search):
    (around,) = seconds_of(search, [(6.5, 1.5, 0.5, 0.0, 0.0)])
    steps = 2 * (8 + 3 * math.sqrt(2.0)) + 2 - 1  # up to the gap and down again; corners are not cut
    assert 0.9 * steps * EDGE_M < around - 1.5 < 1.1 * steps * EDGE_M


def test_long_paths_take_hops_of_equal_length_with_a_scan_each(search):
    (hops,) = seconds_of(search, [(1.5, 9.5, 0.5, 0.0, 0.0)], reach=4.0)
    assert hops == pytest.approx(2 * (2.0 + 1.0 + 0.5))
