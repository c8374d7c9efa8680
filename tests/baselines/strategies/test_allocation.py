"""Which robot is allocated which candidate, and which makes room: by hand, and beside a slow reference."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from baselines.experiments.mission import scripted
from baselines.strategies.allocation import ExplorationConfig
from baselines.strategies.rules.per_time_visibility import PerTimeVisibility
from entropy_explore_env.frontiers.frontier_map import KNOWN_SIGMA, FrontierConfig
from entropy_explore_env.frontiers.knowledge import under_way
from entropy_explore_env.frontiers.voxel_frontiers import VoxelFrontiers
from entropy_explore_env.missions.view import view_of
from entropy_explore_env.robots.motion import driving_time
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.scenarios import BOX, find_scenario
from tests.reference import sawhney as reference
from tests.reference.scenes import build, build_known, free_box, put, started


def corridor(places, heard=True):
    """Robots in a corridor along y of which the middle is known: unexplored at both ends."""
    missions = started(free_box(robots=len(places), robot={"reach_m": 50.0, "body_radius_m": 0.0}))
    solid = np.ones(missions.grid.shape, bool)
    solid[3, :, 2] = False
    build_known(missions, solid, [(3, y, 2) for y in places])
    unknown = [0, 1, 9, 10]
    missions.mean[0, :, 3, unknown, 2], missions.precision[0, :, 3, unknown, 2] = 0.5, 1e-3
    if heard:
        hear_all(missions)
    return missions


def hear_all(missions):
    """Let all robots have heard where all others stand, who announced nothing."""
    heard = missions.state.heard[0]
    heard["heard_s"], heard["announced_s"] = 0.0, -1.0
    heard["pose"] = missions.state.robots[0]["origin"]


def chosen(missions, spacing_m, **config):
    """The strategy, and the voxels to which it sends robots that have scanned once."""
    frontiers = FrontierConfig(spacing_m=spacing_m)
    strategy = PerTimeVisibility(ExplorationConfig(once=True, frontiers=frontiers, **config))
    strategy.reset(missions.scenario, np.random.default_rng(0))
    views = [view_of(missions, 0, robot) for robot in range(missions.scenario.robots)]
    for view in views:
        strategy.observe(view)
        strategy._memories[view.robot].scanned = True
    return strategy, [tuple(missions.grid.voxel_of(strategy.choose(view)[:3]).tolist()) for view in views]


def sent(missions, **config):
    """Layers along y to which robots go that have scanned once."""
    return [voxel[1] for voxel in chosen(missions, 0.5, **config)[1]]


def test_robots_that_stop_at_the_same_time_share_the_frontiers():
    assert sent(corridor((4, 6))) == [2, 8]
    assert sent(corridor((3, 4))) == [2, 8]  # the second would be nearer to the first one's, too
    assert sent(corridor((4, 3))) == [8, 2]
    assert sent(corridor((3, 4)), promises=False) == [2, 2]
    assert sent(corridor((3, 4)), metric="nearest", promises=False) == [2, 2]
    assert sent(corridor((3, 4), heard=False)) == [2, 2]  # nothing was heard: each for itself


@pytest.mark.parametrize(("apart", "moves"), [(1, True), (2, False)])
def test_a_robot_that_waits_makes_room_for_a_teammate_that_touches_it(apart, moves):
    """The teammate is on its way to the unexplored end behind the robot, which itself knows all."""
    missions = corridor((5, 5 + apart))
    missions.mean[0, 0][3, :, 2], missions.precision[0, 0] = 0.0, 1e4
    seen = missions.state.heard[0, 0, 1]
    seen["announced_s"] = 1.0
    seen["announced"][:3] = missions.grid.centre_of(np.array([3, 2, 2]))
    assert (sent(missions)[0] < 5) is moves


def test_a_path_leaves_known_space_only_where_the_robot_stands_in_none():
    """Once a path cut a corner that the body does not pass, since all around the robot was taken for free."""
    missions = started(free_box(robot={"body_radius_m": 1.2 * BOX.grid.voxel_size_m}))
    size = missions.grid.shape  # 7 × 11 × 5 voxels; the body touches the 26 around its own
    missions.mean[0, 0], missions.precision[0, 0] = 0.0, 1e4
    missions.mean[0, 0][4:] = 1.0
    candidates = VoxelFrontiers(missions.scenario, missions.scenario.kind_of(0), FrontierConfig())
    candidates.update(view_of(missions, 0, 0), KNOWN_SIGMA)
    stands = np.isfinite(candidates.traversal_cost).reshape(size)
    assert stands[1:3, 1:10, 1:4].all() and stands.sum() == 2 * 9 * 3
    assert candidates.open_start(int(np.ravel_multi_index((2, 5, 2), size))) == []
    opened = candidates.open_start(int(np.ravel_multi_index((3, 5, 2), size)))
    beside = {(3, y, z) for y in (4, 5, 6) for z in (1, 2, 3)}
    assert {tuple(int(i) for i in np.unravel_index(voxel, size)) for voxel in opened} == beside
    candidates.close(opened)
    np.testing.assert_array_equal(np.isfinite(candidates.traversal_cost).reshape(size), stands)


def test_promises_stand_until_the_scan_is_heard():
    missions = corridor((3, 4))  # V/t: 2/3.5 s at the near end, halved once promised; 2/5.5 s
    seen = missions.state.heard[0, 1, 0]
    seen["announced_s"] = 5.0
    seen["announced"][:3] = missions.grid.centre_of(np.array([3, 2, 2]))
    seen["heard_s"] = 5.0
    assert sent(missions)[1] == 8
    view = view_of(missions, 0, 1)
    assert under_way(view, view.teammates[0], 0)
    seen["heard_s"] = 6.0
    view = view_of(missions, 0, 1)
    assert not under_way(view, view.teammates[0], 0)
    seen["announced_s"] = seen["heard_s"] = 6.0
    kind, longest_m = missions.scenario.kind_of(0), sum(missions.grid.size_m)
    drive_s = driving_time(longest_m, kind.robot.max_speed_m_s, kind.robot.acceleration_m_s2)
    for late_s, lost in ((1.9 * drive_s, False), (2.1 * drive_s + kind.sensor.scan_time_s, True)):
        view = dataclasses.replace(view_of(missions, 0, 1), time_s=6.0 + late_s)
        assert under_way(view, view.teammates[0], 0) is not lost
    seen["announced_s"] = seen["heard_s"] = -1.0
    assert sent(missions)[1] == 2


def test_allocation_is_the_paper_s_loop():
    """Beside the slow reference, in a plan of which little is known: three robots that have all stopped."""
    shape = (14, 12, 1)
    rng = np.random.default_rng(3)
    changes = {
        "grid": Grid(shape, 0.5),
        "robots": 3,
        "robot": {"reach_m": math.inf, "body_radius_m": 0.0, "unknown_cost": 1e4},
        "sensor": {"max_range_m": 2.6},
    }
    scenario = with_settings(scripted(find_scenario("cluttered")), changes)
    for _ in range(6):
        missions = started(scenario)
        solid = np.zeros(shape, bool)
        build(missions, solid)
        known = np.zeros(shape, bool)
        known[2 : int(rng.integers(6, 11)), 1 : int(rng.integers(5, 10))] = True
        for robot in range(3):
            pose = np.zeros(5)
            pose[:3] = missions.grid.centre_of(np.array([3 + robot, 2 + int(rng.integers(0, 2)), 0]))
            put(missions, robot, pose)
            missions.mean[0, robot] = np.where(known, 0.0, 0.5)
            missions.precision[0, robot] = np.where(known, 1e4, 1e-3)
        hear_all(missions)
        check_against_reference(missions, known)


def check_against_reference(missions, known):
    strategy, places = chosen(missions, 1.0)
    views = [view_of(missions, 0, robot) for robot in range(3)]
    candidates = strategy._memories[0].cells
    voxels = candidates.listed()
    state = np.where(known, 0, 3)
    directions, reach = candidates._rays, candidates.reach
    shape, edge = known.shape, missions.grid.voxel_size_m
    where = {int(v): np.stack(np.unravel_index(int(v), shape)) for v in voxels}
    sees = {v: reference.seen_voxels(state, place + 0.5, directions, reach) for v, place in where.items()}
    kind = missions.scenario.kind_of(0)

    def value(robot, place, promised):
        here = missions.grid.voxel_of(views[robot].pose[:3])
        dx, dy = sorted(np.abs(where[place] - here)[:2])
        length_m = (dy - dx + math.sqrt(2) * dx) * edge  # nothing is in the way in a known rectangle
        v, a = kind.robot.max_speed_m_s, kind.robot.acceleration_m_s2
        drive_s = 2 * math.sqrt(length_m / a) if length_m < v * v / a else length_m / v + v / a
        seen = reference.weighed(sees[place], promised)
        return seen / (drive_s + kind.sensor.scan_time_s) if seen else -math.inf

    wanted = reference.allocated(range(3), list(where), value, sees.__getitem__, {})
    assert places == [tuple(where[wanted[robot]].tolist()) for robot in range(3)]
