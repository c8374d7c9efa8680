"""The navigator: waypoints through a belief by hand, and that planned drives meet nothing that is known."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import ndimage

from entropy_explore_env.belief.paths.lattice import NO_FLY_NOWHERE
from entropy_explore_env.robots.motion import MoveEnd, line_believed_blocked
from entropy_explore_env.robots.navigator import lattice_of, new_navigator, plan_path
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.worlds.world import World
from tests.reference.scenes import drawn, free_box, ray_space, seeds

FLAT = Grid((7, 11, 1), 0.5)
PRIOR, KNOWN = np.float32(30.0**-2), np.float32(1e4)


def planner(grid=FLAT, **robot):
    return free_box(robots=1, grid=grid, robot={"navigator": "planned", "reach_m": math.inf, **robot})


def plan(scenario, solid, start, goal, known=None, places=32, closed=None):
    """Waypoints (N, 3) and end of a plan through what is `known`; `closed` lies above the ceiling."""
    mean = solid.astype(np.float32).ravel()
    precision = np.full(mean.shape, KNOWN) if known is None else np.where(known.ravel(), KNOWN, PRIOR)
    points = np.full((places, 3), np.nan)
    closed = NO_FLY_NOWHERE if closed is None else closed.ravel()
    navigator = new_navigator(scenario, scenario.robot)
    count, code = plan_path(navigator, mean, precision, closed, start, goal, points)
    assert np.isnan(points[count:]).all()
    return points[:count], list(MoveEnd)[code]


def wall(open_from=9, shape=FLAT.shape):
    solid = np.zeros(shape, bool)
    solid[3, :open_from] = True
    return solid


@pytest.mark.parametrize(("cost", "corners"), [(1.0, 0), (3.0, 0), (6.0, 2)])
def test_unknown_space_is_passed_where_the_path_around_costs_more(cost, corners):
    """Two unknown columns on the line of four edges cost 2·cost + 2; around them it is about 10."""
    known = np.ones(FLAT.shape, bool)
    known[3, :6] = False
    known[2, :6] = False
    points, end = plan(
        planner(unknown_cost=cost), np.zeros(FLAT.shape, bool), (1.5, 1.5, 0.5), (5.5, 1.5, 0.5), known
    )
    assert end is MoveEnd.ARRIVED
    assert (points[:, 1].max() > 5.0) == (corners > 0)


def only(free):
    solid = np.ones(FLAT.shape, bool)
    solid[free] = False
    return solid


OPEN, SHUT = wall(), wall(open_from=11)
AROUND = [(2.5, 9.5, 0.5), (4.5, 9.5, 0.5)]
PLANS = [
    # Through known free space it is one line, around a wall one with two corners.
    (OPEN, (1.2, 1.7, 0.5), (2.9, 10.1, 0.5), 32, [(2.9, 10.1, 0.5)], MoveEnd.ARRIVED),
    (OPEN, (1.2, 1.7, 0.5), (1.2, 1.7, 0.5), 32, [(1.2, 1.7, 0.5)], MoveEnd.ARRIVED),
    (OPEN, (1.5, 1.5, 0.5), (5.2, 1.9, 0.5), 32, [*AROUND, (5.2, 1.9, 0.5)], MoveEnd.ARRIVED),
    # One with more corners than places ends at the last of them.
    (OPEN, (1.5, 1.5, 0.5), (5.5, 1.5, 0.5), 2, AROUND, MoveEnd.CORNERS),
    # Where no path is known it leads to the nearest place: goals in the wall, behind it and outside.
    (SHUT, (1.5, 1.5, 0.5), (3.5, 4.2, 0.5), 32, [(2.5, 4.5, 0.5)], MoveEnd.NO_PATH),
    (SHUT, (1.5, 1.5, 0.5), (5.5, 4.5, 0.5), 32, [(2.5, 4.5, 0.5)], MoveEnd.NO_PATH),
    (SHUT, (1.5, 1.5, 0.5), (-0.7, 4.5, 0.5), 32, [(0.5, 4.5, 0.5)], MoveEnd.NO_PATH),
    (SHUT, (1.5, 1.5, 0.5), (1.5, 13.0, 0.5), 32, [(1.5, 10.5, 0.5)], MoveEnd.NO_PATH),
    # The robot stays where it cannot get nearer, and the nearest place may be at any edge.
    (SHUT, (2.7, 4.6, 0.5), (5.5, 4.5, 0.5), 32, [(2.7, 4.6, 0.5)], MoveEnd.NO_PATH),
    (only(np.s_[6:]), (6.5, 1.5, 0.5), (5.5, 8.5, 0.5), 32, [(6.5, 8.5, 0.5)], MoveEnd.NO_PATH),
    (only(np.s_[:1]), (0.5, 1.5, 0.5), (1.5, 8.5, 0.5), 32, [(0.5, 8.5, 0.5)], MoveEnd.NO_PATH),
    (only(np.s_[:, 10:]), (1.5, 10.5, 0.5), (5.5, 9.5, 0.5), 32, [(5.5, 10.5, 0.5)], MoveEnd.NO_PATH),
    (only(np.s_[:, :1]), (1.5, 0.5, 0.5), (5.5, 1.5, 0.5), 32, [(5.5, 0.5, 0.5)], MoveEnd.NO_PATH),
]


@pytest.mark.parametrize(("solid", "start", "goal", "places", "expected", "end"), PLANS)
def test_plans_by_hand(solid, start, goal, places, expected, end):
    points, found = plan(planner(), solid, start, goal, places=places)
    assert (points.tolist(), found) == ([list(point) for point in expected], end)


DRIFT = {"xy_m_per_sqrt_m": 0.01}


def test_a_margin_keeps_paths_of_robots_that_drift_clear_of_what_is_covered():
    """Body 0.1 m in voxels of 0.5 m: beside the wall is free for it, with 0.5 m more it is not."""
    solid, ends = wall(open_from=8), ((1.5, 1.5, 0.5), (5.5, 1.5, 0.5))
    nearest = {}
    for margin_m in (0.0, 0.5):
        scenario = planner(localization={**DRIFT, "margin_m": margin_m})
        points, end = plan(scenario, solid, *ends)
        assert end is MoveEnd.ARRIVED
        nearest[margin_m] = points[:-1, 1].min()
    assert nearest == {0.0: 8.5, 0.5: 9.5}
    exact = planner(localization={"margin_m": 0.5})
    assert plan(exact, solid, *ends)[0].tolist() == plan(planner(), solid, *ends)[0].tolist()


def test_who_keeps_a_margin_drives_straight_to_a_near_goal_to_which_it_knows_no_path():
    """In a channel too narrow for its margin; a goal 6 voxels away is near, one at 7 is not."""
    solid = np.zeros(FLAT.shape, bool)
    solid[:, [0, 2]] = True
    for margin_m, y, ends in (
        (0.0, 7.5, MoveEnd.NO_PATH),
        (0.5, 7.5, MoveEnd.ARRIVED),
        (0.5, 8.5, MoveEnd.NO_PATH),
    ):
        scenario = planner(localization={**DRIFT, "margin_m": margin_m})
        points, end = plan(scenario, solid, (3.5, 1.5, 0.5), (3.5, y, 0.5))
        assert end is ends
        assert (points.tolist() == [[3.5, y, 0.5]]) == (ends is MoveEnd.ARRIVED)
    outside, end = plan(scenario, solid, (3.5, 1.5, 0.5), (3.5, -1.5, 0.5))
    assert end is MoveEnd.NO_PATH and (outside >= 0.0).all()


def test_planar_robots_keep_their_height_and_may_pass_under_what_is_above_them():
    grid, solid = Grid((7, 11, 5), 0.5), np.zeros((7, 11, 5), bool)
    solid[3, :9, 1:3] = True
    solid[5, 5, 4] = True
    scenario = planner(grid, motion="planar", sensor_height_m=0.8)
    points, end = plan(scenario, solid, (1.5, 5.5, 1.6), (5.5, 5.5, 1.6))
    assert end is MoveEnd.ARRIVED
    assert (points[:, 2] == 1.6).all()
    assert points[:, 1].max() == 9.5
    flying, _ = plan(planner(grid), solid, (1.5, 5.5, 1.5), (5.5, 5.5, 1.5))
    assert flying[:, 2].max() > 3.0 or flying[:, 2].min() < 1.0


@pytest.mark.parametrize(("radius", "closed_from", "below"), [(0.2, 3, [4]), (0.4, 4, [3, 4, 5])])
@pytest.mark.parametrize("cliff", [1, 5])
def test_planners_know_the_ceiling_and_of_the_ground_what_was_seen(radius, closed_from, below, cliff):
    """At x = 4 the body must pass below layer 3; an unknown cliff at x = 6 changes nothing in the plan."""
    grid, solid = Grid((9, 7, 6), 0.5), np.zeros((9, 7, 6), bool)
    solid[:, :, 0] = True
    believed, ceiling = solid.copy(), np.full(grid.shape[:2], 6, np.int32)
    solid[5, :, 1:cliff], ceiling[4] = True, closed_from
    closed = World(grid, solid, "step", ceiling).no_fly_mask(radius)
    scenario, start, goal = planner(grid, body_radius_m=radius), (1.5, 3.5, 4.5), (7.5, 3.5, 2.5)
    points, end = plan(scenario, believed, start, goal, closed=closed)
    assert end is MoveEnd.ARRIVED and len(points) > 1
    stops = np.vstack([start, points])
    line = np.concatenate([np.linspace(a, b, 50) for a, b in itertools.pairwise(stops)])
    there = np.isin(np.floor(line[:, 0]), below)
    assert there.any() and line[there, 2].max() < 3.0 + 1e-9
    assert len(plan(scenario, believed, start, goal)[0]) == 1  # as nothing is believed to be in the way


def test_who_leaves_a_tight_start_does_not_leave_it_upwards_through_the_ceiling():
    """A body of 0.4 m touches a wall at its side; upwards is the nearest way out, and closed."""
    grid, solid = Grid((9, 7, 6), 0.5), np.zeros((9, 7, 6), bool)
    solid[4, 3, 2], closed = True, np.zeros(grid.shape, bool)
    closed[:, :, 4:] = True
    scenario, start = planner(grid, body_radius_m=0.4), (3.5, 3.5, 3.5)
    for above, highest in ((None, 4.5), (closed, 3.5)):
        points, end = plan(scenario, solid, start, (3.5, 3.5, 4.5), closed=above)
        assert points[:, 2].max() == highest
        assert end is (MoveEnd.ARRIVED if above is None else MoveEnd.NO_PATH)


@drawn(80)
@given(seeds, st.sampled_from([(7, 11, 1), (7, 11, 5)]), st.sampled_from([0.2, 0.3, 0.55]))
def test_who_knows_the_world_meets_nothing_and_gets_wherever_a_path_leads(seed, shape, radius):
    """Random worlds, known by heart: a plan is driven to its end, through voxels in which the body fits."""
    rng = np.random.default_rng(seed)
    scenario = planner(Grid(shape, 0.5), body_radius_m=radius)
    occupied = rng.random(shape) < rng.choice([0.05, 0.2, 0.4])
    occupied[tuple(n // 2 for n in shape)] = False
    room = World(scenario.grid, occupied, "random").collision_mask(radius) == 0
    if not room.any():
        return
    free = np.argwhere(room)
    here, there = free[rng.integers(len(free), size=2)]
    start, goal = here + 0.5, there + rng.uniform(0.02, 0.98, 3)
    if scenario.planar:
        goal[2] = 0.5
    points, end = plan(scenario, occupied, tuple(start), tuple(goal))
    parts, _ = ndimage.label(room)
    connected = parts[tuple(here)] == parts[tuple(there)]
    assert (end is MoveEnd.ARRIVED) == connected
    corners = np.vstack([start, points])
    crossing = ray_space(shape)
    for begin, finish in itertools.pairwise(corners):
        for share in np.linspace(0.0, 1.0, 41):
            place = np.minimum((begin + share * (finish - begin)).astype(int), np.array(shape) - 1)
            assert room[tuple(place)]
        assert not line_believed_blocked(
            occupied.ravel().astype(np.float32),
            shape,
            lattice_of(scenario, scenario.robot).footprint,
            radius / 0.5,
            tuple(begin.tolist()),
            tuple(finish.tolist()),
            crossing,
        )
    if not connected:
        reached = np.argwhere(parts == parts[tuple(here)])
        nearest = ((reached - there) ** 2).sum(axis=1).min()
        assert ((np.floor(points[-1]) - there) ** 2).sum() == nearest


def test_what_lies_within_the_body_s_reach_blocks_a_line():
    """A body of 1.2 edges on a line along y through x = 3: covered voxels one and two columns beside it."""
    size = (7, 11, 1)
    crossing = ray_space(size)
    wide = planner(body_radius_m=0.6)
    ball = lattice_of(wide, wide.robot).footprint

    def blocked(covered, begin_y):
        mean = np.full(size, 0.5, np.float32)
        mean[covered] = 0.51
        return line_believed_blocked(
            mean.ravel(), size, ball, 1.2, (3.5, begin_y, 0.5), (3.5, 8.5, 0.5), crossing
        )

    assert blocked((3, 6, 0), 1.5)
    assert blocked((4, 6, 0), 1.5)
    assert not blocked((5, 6, 0), 1.5)
    assert not blocked((3, 1, 0), 1.5)  # it stands in there
    assert blocked((3, 9, 0), 1.5)  # the body's front at the end
    assert not blocked((3, 10, 0), 1.5)
    assert not blocked((4, 1, 0), 1.5)  # it touches that already, and leaves
    assert blocked((4, 2, 0), 1.5)  # that, too, but it would touch it still where it touched nothing
    assert blocked((3, 2, 0), 1.5)  # not through it
