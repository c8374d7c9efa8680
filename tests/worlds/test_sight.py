"""What a team can see from places that its bodies reach."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from entropy_explore_env.missions.reset_options import ResetOptions
from entropy_explore_env.missions.simulation import Missions
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.scenarios import SCENARIOS
from entropy_explore_env.worlds import sight
from entropy_explore_env.worlds.given import in_given_worlds
from entropy_explore_env.worlds.sight import _are_visible, _is_open, visible_from
from entropy_explore_env.worlds.world import World

EDGE_M = 0.1


def two_rooms(gap):
    """Rooms of 12 × 9 and 10 × 9 voxels, a wall between them with a gap of so many voxels."""
    solid = np.zeros((23, 9, 1), bool)
    solid[12] = True
    solid[12, 4 : 4 + gap] = False
    return World(Grid(solid.shape, EDGE_M), solid, "rooms")


def asked(world, body_m, **settings):
    changes = {"robots": 2, "robot": {"body_radius_m": body_m}, "ending": {"seen_share": 1.0}}
    return in_given_worlds(with_settings(SCENARIOS["office"], {**changes, **settings}), [world])


def poses(*voxels):
    found = np.zeros((len(voxels), 5))
    found[:, :3] = (np.array([(*voxel, 0) for voxel in voxels]) + 0.5) * EDGE_M
    return found


LEFT, RIGHT = poses((3, 2), (3, 6)), poses((18, 2), (18, 6))


def test_bodies_that_pass_see_all_that_is_connected():
    world = two_rooms(3)
    scenario = asked(world, 0.14)
    assert (visible_from(world, scenario, LEFT) == world.visible(scenario)).all()


@pytest.mark.parametrize("starts", [LEFT, RIGHT])
def test_behind_a_gap_counts_what_beams_through_it_reach(starts):
    """A gap of one voxel in row 4, bodies that need three: from column 11 or so, a fan opens behind it."""
    world = two_rooms(1)
    scenario = asked(world, 0.14)
    seen = visible_from(world, scenario, starts)[:, :, 0]
    here, there = (seen[:12], seen[13:]) if starts is LEFT else (seen[13:], seen[:12][::-1])
    assert here.all() and seen[12, 4]
    assert there[:, 4].all()  # straight on
    assert not there[0, [0, 1, 7, 8]].any()  # beside the gap, behind the wall
    assert (np.diff(there.sum(axis=1)) >= 0).all()  # the fan widens
    assert (there == there[:, ::-1]).all()


def test_a_robot_on_each_side_sees_both_rooms():
    world = two_rooms(1)
    both = np.stack((LEFT[0], RIGHT[0]))
    scenario = asked(world, 0.14)
    assert (visible_from(world, scenario, both) == world.visible(scenario)).all()


def test_the_sensors_range_counts():
    world = two_rooms(1)
    seen = visible_from(world, asked(world, 0.14, sensor={"max_range_m": 0.5}), LEFT)[:, :, 0]
    assert seen[14, 4] and not seen[20:, 4].any()


def test_lines_of_sight_by_hand():
    """From (0, 0) to (2, 1): through (1, 0) or (1, 1), as x crosses at 1/4 and 3/4, y at 1/2."""
    free = np.ones((3, 2, 1), bool)
    start, step = (0, 0, 0), (2, 1, 0)
    assert _is_open(free, start, step)
    for crossed in ((1, 0), (1, 1)):
        free[...] = True
        free[crossed] = False
        assert not _is_open(free, start, step)
    free[...] = True
    free[2, 0] = free[0, 1] = False
    assert _is_open(free, start, step)


@pytest.mark.parametrize(("ending", "counted"), [({"seen_share": 0.9}, True), ({}, False)])
def test_only_missions_that_end_by_it_count_so(ending, counted):
    world = two_rooms(1)
    scenario = with_settings(
        asked(world, 0.14), {"ending": {"seen_share": None, **ending}, "track_truth": True}
    )
    missions = Missions(scenario, given=(world,))
    missions.reset(0, seed=0, options=ResetOptions(LEFT))
    expected = visible_from(world, scenario, LEFT) if counted else world.visible(scenario)
    assert missions.state.missions["visible"][0] == expected.sum()
    assert expected.sum() < world.visible(scenario).sum() or not counted


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10**6), st.sampled_from([(31, 22, 1), (19, 8, 11), (12, 26, 5)]), st.floats(3.0, 40.0))
def test_places_that_are_ruled_out_by_blocks_see_nothing(seed, shape, range_):
    """Rooms with holes in their walls, and clutter: as if every place were tried for every voxel."""
    rng = np.random.default_rng(seed)
    free = rng.random(shape) > rng.choice([0.0, 0.02, 0.2])
    for axis in (0, 1):
        wall = [slice(None)] * 3
        wall[axis] = rng.integers(shape[axis])
        free[tuple(wall)] = rng.random(shape)[tuple(wall)] < 0.05
    places = free & (rng.random(shape) < 0.01)
    places[shape[0] // 2 :] = False
    voxels, at = np.argwhere(free & ~places), np.argwhere(places)
    expected = [
        any(
            ((place - voxel) ** 2).sum() <= range_**2 and _is_open(free, tuple(voxel), tuple(place - voxel))
            for place in at
        )
        for voxel in voxels
    ]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sight, "_AT_ONCE", 100)
        assert _are_visible(voxels, places, free, range_).tolist() == expected
