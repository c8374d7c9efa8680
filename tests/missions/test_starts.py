"""Where robots start: in voxel centres with room, apart from each other, near the first one if asked."""

import math

import numpy as np
import pytest

from entropy_explore_env.errors import WorldError
from entropy_explore_env.missions.simulation import Missions
from tests.reference.scenes import NO_PARTS, TIGHT, free_box, started


def test_starts_are_voxel_centres_with_room_apart_from_each_other():
    seen = set()
    for seed in range(20):
        missions = started(TIGHT, seed=seed)
        poses, grid = missions.state.robots[0]["goal"], missions.grid
        voxels = grid.voxel_of(poses[:, :3])
        np.testing.assert_allclose(grid.centre_of(voxels), poses[:, :3])
        blocked = missions.worlds[0].layout(missions.scenario).collision_mask > 0
        assert not blocked[tuple(voxels.T)].any()
        apart = np.linalg.norm(poses[:, None, :3] - poses[None, :, :3], axis=-1)
        assert apart[np.triu_indices(5, 1)].min() >= 0.7
        assert (poses[:, 4] == 0.0).all()
        assert (np.abs(poses[:, 3]) <= math.pi).all()
        seen.add(poses.tobytes())
    assert len(seen) == 20


def test_robots_start_near_the_first_one_where_the_scenario_says_so():
    for seed in range(20):
        near, anywhere = (
            started(free_box(robots=4, start_radius_m=radius_m), seed=seed) for radius_m in (0.8, math.inf)
        )
        places = near.state.robots[0]["goal"][:, :3]
        assert np.linalg.norm(places - places[0], axis=1).max() <= 0.8
        assert (near.state.robots[0]["goal"][0] == anywhere.state.robots[0]["goal"][0]).all()
    with pytest.raises(WorldError, match=r"Scenario\.robots = 4: expected at most"):
        started(free_box(robots=4, start_radius_m=0.3, robot={"body_radius_m": 0.2}))


def test_more_robots_than_there_is_room_for_are_refused_before_anything_changes():
    crowd = free_box(robots=60, robot={"body_radius_m": 0.6}, observation=NO_PARTS)
    missions = Missions(crowd)
    with pytest.raises(WorldError, match=r"Scenario\.robots = 60: expected at most"):
        missions.reset(0, 1)
    assert missions.worlds == [None]
    assert not missions.state.precision.any()
    too_big = Missions(free_box(robot={"body_radius_m": 1.3}))
    with pytest.raises(WorldError, match=r"room for a body with a radius of 1\.3 m"):
        too_big.reset(0, 1)
