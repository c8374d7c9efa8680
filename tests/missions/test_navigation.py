"""Teams that plan: bodies never overlap, and neither threads, batches nor pickling change what they do."""

from __future__ import annotations

import math
import pickle
from collections import Counter

import numpy as np
import pytest

from entropy_explore_env.envs.conformance import check_conformance
from entropy_explore_env.missions.poses import pose_at
from entropy_explore_env.missions.simulation import Missions
from entropy_explore_env.robots.motion import MoveEnd
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.scenarios import OFFICE, ROOM_FURNISHED, SCENARIOS, TERRAIN
from entropy_explore_env.worlds.world import World
from tests.reference.scenes import free_box, random_actions, started, wander

NO_PARTS = {"panorama": False, "self_state": False, "team": False, "patch": True, "patch_shape": (1, 1, 1)}
ENDLESS = {"sigma_end": 1e-3}
PLANNED = {"navigator": "planned"}
WANDERERS = free_box(
    robots=3,
    world="furnished",
    robot={**PLANNED, "reach_m": math.inf, "body_radius_m": 0.2},
    sensor={"scan_every_m": 0.4, "field_of_view_rad": (2.0, 0.5)},
    channel={"delay_s": 0.7, "i_min_bits": 0.0},
    decision_period_s=0.7,
    ending=ENDLESS,
)
CROWDS = {
    "flat": with_settings(
        OFFICE,
        {
            "robots": 5,
            "robot": {"reach_m": 6.0, "body_radius_m": 0.25},
            "sensor": {"angular_step_rad": math.pi / 30},
            "decision_period_s": None,
        },
    ),
    "furnished": free_box(
        robots=5, robot={**PLANNED, "body_radius_m": 0.24, "reach_m": 3.0}, world="furnished"
    ),
    "room": with_settings(
        ROOM_FURNISHED,
        {
            "robots": 5,
            "robot": {**PLANNED, "body_radius_m": 0.4, "reach_m": 9.0, "max_speed_m_s": 1.0},
            "decision_period_s": 0.1,
            "sensor": {"angular_step_rad": math.pi / 12, "scan_every_m": 0.5},
        },
    ),
}


@pytest.mark.parametrize("crowd", CROWDS)
def test_bodies_never_overlap_on_planned_paths(crowd):
    """At any time within a step; with scans under way, which may end a drive, when a step ends."""
    missions = started(with_settings(CROWDS[crowd], {"ending": ENDLESS, "observation": NO_PARTS}), seed=6)
    grid, radius = missions.grid, missions.scenario.robot.body_radius_m
    blocked = missions.worlds[0].layout(missions.scenario).collision_mask > 0
    robots, closest, before_s, ends = missions.state.robots[0], [math.inf], 0.0, Counter()
    corners, looks = 0, 9 if math.isinf(missions.scenario.sensor.scan_every_m) else 1

    def look(_step):
        nonlocal before_s, corners
        now_s = missions.state.missions[0]["time_s"]
        for time_s in np.linspace(now_s, before_s, looks, endpoint=False):
            places = np.array([pose_at(missions.rules.params[0], robot, time_s)[:3] for robot in robots])
            apart = np.linalg.norm(places[:, None] - places[None], axis=-1)[np.triu_indices(len(places), 1)]
            closest[0] = min(closest[0], apart.min())
            assert apart.min() >= 2 * radius
            voxels = grid.voxel_of(places)
            assert ((voxels >= 0) & (voxels < grid.shape)).all()
            assert not blocked[tuple(voxels.T)].any()
        before_s, corners = now_s, max(corners, robots["corners"].max())
        ends.update(list(MoveEnd)[end].name for end in robots["move_end"][robots["deciding"]])

    wander(missions, 900 if crowd == "room" else 150, 3, look)
    assert closest[0] < 2.2 * radius  # they did meet
    assert corners > 0
    # Far goals in a crowd are seldom reached.
    assert ends["TEAMMATE"] and ends["NO_PATH"] and ends["ARRIVED"] + ends["SEEN"]


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


def test_threads_batches_and_pickling_change_nothing():
    """Four missions on two threads, and pickled half way, are four missions by themselves."""
    batch = Missions(WANDERERS, 4, threads=2)
    alone = [Missions(WANDERERS) for _ in range(4)]
    for mission in range(4):
        batch.reset(mission, mission)
        alone[mission].reset(0, mission)
    rng = np.random.default_rng(0)
    for step in range(40):
        boxes, numbers = random_actions(batch, rng)
        batch.step(boxes, numbers)
        for mission, one in enumerate(alone):
            one.step(boxes[mission : mission + 1], numbers[mission : mission + 1])
        if step == 20:
            batch.close()
            batch = pickle.loads(pickle.dumps(batch))
            assert len(batch._compiled_step.navigators) == 2
    for mission, one in enumerate(alone):
        for name, all_of_them, own in zip(batch.state._fields, batch.state, one.state, strict=True):
            assert all_of_them[mission].tobytes() == own[0].tobytes(), name
        np.testing.assert_array_equal(batch.observations[mission], one.observations[0])
    robots = batch.state.robots
    assert (robots["scans"] > 10).all()
    assert robots["corners"].max() > 0
    batch.close()


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


def test_walls_make_the_scenarios_plan():
    planned = {name for name, scenario in SCENARIOS.items() if scenario.robot.navigator == "planned"}
    assert planned == set(SCENARIOS) - {
        "room",
        "room-furnished",
        "box-7x11x5",
        "terrain",
        "terrain-smooth",
        "terrain-rough",
        "cliff",
    }


@pytest.mark.parametrize(
    ("scenario", "robots", "kind"),
    [
        ("office", 1, "continuous"),
        ("office", 5, "continuous"),
        ("office", 2, "discrete"),
        ("room-furnished", 4, "discrete"),
        ("room-furnished", 3, "continuous"),
    ],
)
def test_teams_that_plan_conform(in_this_process, scenario, robots, kind):
    reach, said = {"reach_m": 1.0} if kind == "discrete" else {}, []
    check_conformance(
        scenario,
        steps=20,
        seed=robots,
        robots=robots,
        robot={**PLANNED, **reach},
        sensor={"scan_every_m": 0.5},
        action={"kind": kind},
        report=said.append,
    )
    assert len(said) == in_this_process


@pytest.mark.parametrize("world", ["terrain", "terrain-rough"])
def test_whoever_plans_knows_the_exposure_surface_and_never_meets_it(world):
    """Flights to anywhere: those above the surface end below it with no path, and no drive runs into it."""
    settings = {
        "grid": Grid((40, 30, 20), 1.0),
        "world": world,
        "robots": 2,
        "robot": {**PLANNED, "reach_m": math.inf},
        "decision_period_s": None,
        "ending": {**ENDLESS, "time_limit_s": 400.0},
    }
    missions = started(with_settings(TERRAIN, settings))
    ends, rng = Counter(), np.random.default_rng(0)
    for _ in range(60):
        missions.step(*random_actions(missions, rng))
        ends.update(missions.state.robots["move_end"].ravel().tolist())
    assert ends[MoveEnd.CEILING.code] == 0
    assert ends[MoveEnd.NO_PATH.code] > 0 and ends[MoveEnd.ARRIVED.code] > 0
