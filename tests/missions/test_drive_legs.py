"""Bodies neither overlap nor enter what is solid, wherever drives lead."""

from __future__ import annotations

import math

import numpy as np
import pytest

from entropy_explore_env.missions.poses import pose_at
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.scenarios import ROOM_FURNISHED
from tests.reference.scenes import TIGHT, free_box, started, wander

ENDLESS = {"sigma_end": 1e-4}
NO_PARTS = {"panorama": False, "self_state": False, "team": False}

CROWDS = {
    "big bodies in the tiny box": TIGHT,
    "small bodies, furnished": free_box(
        robots=5, robot={"body_radius_m": 0.24, "reach_m": 3.0}, world="furnished", observation=NO_PARTS
    ),
    "big bodies in a furnished room": with_settings(
        ROOM_FURNISHED,
        {
            "robots": 5,
            "robot": {"body_radius_m": 0.4, "reach_m": 6.0, "max_speed_m_s": 1.0},
            "decision_period_s": 1.1,
            "observation": NO_PARTS,
            "sensor": {"angular_step_rad": math.pi / 12},
        },
    ),
}


@pytest.mark.parametrize("crowd", CROWDS)
def test_bodies_never_overlap_and_never_stand_in_solid_voxels(crowd):
    """At any time, not only when a step ends: robots that departed with a step are looked at within it."""
    missions = started(with_settings(CROWDS[crowd], {"ending": ENDLESS}), seed=6)
    grid, radius = missions.grid, missions.scenario.robot.body_radius_m
    blocked = missions.worlds[0].layout(missions.scenario).collision_mask > 0
    robots, closest, before_s = missions.state.robots[0], [math.inf], 0.0

    def look(_step):
        nonlocal before_s
        now_s = missions.state.missions[0]["time_s"]
        for time_s in np.linspace(before_s, now_s, 9):
            places = np.array([pose_at(missions.rules.params[0], robot, time_s)[:3] for robot in robots])
            apart = np.linalg.norm(places[:, None] - places[None], axis=-1)[np.triu_indices(len(places), 1)]
            closest[0] = min(closest[0], apart.min())
            assert apart.min() >= 2 * radius
            voxels = grid.voxel_of(places)
            assert ((voxels >= 0) & (voxels < grid.shape)).all()
            assert not blocked[tuple(voxels.T)].any()
        before_s = now_s

    wander(missions, 100, 3, look)
    assert closest[0] < 2.2 * radius  # they did meet
    assert robots["blocked_moves"].min() > 5


@pytest.mark.parametrize("world", ["empty", "furnished"])
def test_round_numbers_do_not_bring_robots_into_walls_and_furniture(world):
    """Displacements of quarters of the reach end on faces between voxels, exactly."""
    missions = started(free_box(robots=1, world=world, observation=NO_PARTS), seed=6)
    truth, rng = missions.state.truth[0].reshape(missions.grid.shape), np.random.default_rng(0)
    for _ in range(200):
        boxes = rng.choice([-1.0, -0.5, -0.25, 0.0, 0.25, 0.5, 1.0], (1, 1, 5))
        missions.step(boxes, np.zeros((1, 1), np.int64))
        voxel = missions.grid.voxel_of(missions.state.robots[0, 0]["goal"][:3])
        assert ((voxel >= 0) & (voxel < missions.grid.shape)).all()
        assert truth[tuple(voxel)] == 0.0
