"""Teams that plan: bodies never overlap, and neither threads, batches nor pickling change what they do."""

import math
from collections import Counter

import numpy as np
import pytest

from entropy_explore_env.missions.simulation import Missions
from entropy_explore_env.robots.motion import MoveEnd
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.worlds.world import World
from tests.missions.kinds import WANDERERS
from tests.reference.scenes import free_box, random_actions, started, wander

ENDLESS = {"sigma_end": 1e-3}
PLANNED = {"navigator": "planned"}


@pytest.mark.parametrize("radius_m", [0.0, 0.06])
@pytest.mark.parametrize(("shape", "motion"), [((23, 31, 1), "planar"), ((13, 17, 9), "free")])
def test_who_knows_the_world_is_stopped_by_nothing_on_a_planned_path(shape, motion, radius_m):
    """Also where voxel centres are not exact in metres: no rounding leads through a corner."""
    ends = Counter()
    robot = {**PLANNED, "motion": motion, "reach_m": math.inf, "body_radius_m": radius_m}
    grid = Grid(shape, 0.1, (-3.3, 7.7, -0.4))
    for seed in range(8):
        solid = np.random.default_rng(seed).random(shape) < (0.12 if shape[2] == 1 else 0.06)
        box = free_box(robots=1, robot={**robot, "sensor_height_m": 0.05}, ending=ENDLESS, grid=grid)
        missions = Missions(box, given=[World(grid, solid, "known")])
        missions.reset(0, seed)
        rng = np.random.default_rng(seed)
        for _ in range(40):
            missions.mean[0], missions.precision[0] = solid, 1e9
            missions.step(*random_actions(missions, rng))
            ends[list(MoveEnd)[missions.state.robots[0, 0]["move_end"]].name] += 1
    assert set(ends) == {"ARRIVED", "NO_PATH"} and ends["ARRIVED"] > 40


def test_the_memory_of_plans_is_not_pickled_and_taken_only_where_robots_plan():
    missions = started(WANDERERS)
    assert "_navigators" not in missions.__getstate__()
    wide = with_settings(WANDERERS, {"robot": {"body_radius_m": 0.4}})
    assert Missions(wide)._compiled_step.work[0].footprints.size > 0
    straight = Missions(with_settings(wide, {"robot": {"navigator": "straight"}}))
    assert not straight._compiled_step.navigators[0] and straight._compiled_step.work[0].footprints.size == 0


def test_messages_of_scans_under_way_find_free_slots():
    """A robot may then send far more often than it arrives."""
    settings = {"sensor": {"scan_every_m": 0.05}, "channel": {"delay_s": 3.0}}
    missions = started(with_settings(WANDERERS, settings))
    assert missions.scenario.message_slots == 2 * 3 * (30 + 2)  # 0.05 m at 0.5 m/s is 0.1 s
    wander(missions, 30, 0)
    assert (missions.state.robots["scans"] > 100).all()
