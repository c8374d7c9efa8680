"""Teams of several kinds of robots: each robot moves and senses as in a team of its own kind."""

import dataclasses
import math
import pickle

import numpy as np
import pytest

from entropy_explore_env.errors import SettingError
from entropy_explore_env.missions.rules import rules_of
from entropy_explore_env.missions.view import view_of
from entropy_explore_env.reports.metrics import information_floor
from entropy_explore_env.robots.motion import MoveEnd
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.robot import Robot
from entropy_explore_env.settings.robot_kind import RobotKind
from entropy_explore_env.settings.sensor import RangeSensor
from tests.missions.kinds import GROUND, SCOUT
from tests.reference.scenes import free_box, put, random_actions, started

SILENT = {"burst": 0, "announcements": False}
ENDLESS = {"sigma_end": 1e-3, "time_limit_s": math.inf}


def box_of(kinds, **changes):
    """The tiny box with a team of these kinds."""
    first, *others = kinds
    return free_box(
        robot=first.robot, sensor=first.sensor, extra_kinds=tuple(others), ending=ENDLESS, **changes
    )


KINDS = (GROUND, SCOUT)
MIXED = box_of(KINDS, robots=5, decision_period_s=0.7, channel=SILENT)


def test_kinds_take_turns_and_a_smaller_team_has_fewer():
    assert [MIXED.kind_of(robot) for robot in range(5)] == [GROUND, SCOUT, GROUND, SCOUT, GROUND]
    assert not MIXED.planar
    alone = with_settings(MIXED, {"robots": 1})
    assert alone.kinds == (GROUND,) and alone.planar
    assert MIXED.layer_of(GROUND.robot) == 1 and MIXED.layer_of(SCOUT.robot) is None
    assert with_settings(MIXED, {"grid": Grid((9, 6, 1), 0.5)}).planar


@pytest.mark.parametrize("world", ["empty", "furnished"])
@pytest.mark.parametrize("kind", [0, 1])
def test_each_robot_does_what_it_would_in_a_team_of_its_kind(kind, world):
    """Nothing is shared and nobody is in the way: beliefs, drives and noise are those of a team alike."""
    mixed = with_settings(MIXED, {"world": world})
    alike = box_of(KINDS[kind : kind + 1], robots=5, decision_period_s=0.7, channel=SILENT, world=world)
    one, other = started(mixed, seed=4), started(alike, seed=4)
    robots = [robot for robot in range(5) if robot % 2 == kind]
    for robot in range(5):
        put(one, robot, [*one.grid.centre_of([3, 2 + 2 * robot, 1]).tolist(), 0.1 * robot, 0.0])
        put(other, robot, one.state.robots[0, robot]["goal"])
    rng = np.random.default_rng(2)
    planar = kind == 0
    for _ in range(60):
        boxes, numbers = random_actions(one, rng)
        one.step(boxes, numbers)
        other.step(boxes[:, :, [0, 1, 3]] if planar else boxes, numbers)
        for robot in robots:
            for name in ("mean", "precision"):
                ours, theirs = getattr(one.state, name)[0, robot], getattr(other.state, name)[0, robot]
                np.testing.assert_array_equal(ours, theirs)
            for name in set(one.state.robots.dtype.names) - {
                "reward"
            }:  # a share of what the team has to gain
                np.testing.assert_array_equal(
                    one.state.robots[0, robot][name], other.state.robots[0, robot][name]
                )
    assert (one.state.robots[0]["scans"] > 5).all()
    assert len(set(one.state.robots[0]["scans"])) > 1


def test_a_second_kind_like_the_first_changes_nothing_but_the_word_for_it():
    alike = free_box(robots=4, robot={"body_radius_m": 0.2, "reach_m": 2.0}, world="furnished")
    named = with_settings(alike, {"extra_kinds": (RobotKind(alike.robot, alike.sensor),)})
    one, other = started(alike, seed=3), started(named, seed=3)
    rng = np.random.default_rng(5)
    for _ in range(50):
        actions = random_actions(one, rng)
        one.step(*actions)
        other.step(*actions)
    for ours, theirs in zip(one.state, other.state, strict=True):
        assert ours.tobytes() == theirs.tobytes()
    split, mixed = one.layout.split(one.observations), other.layout.split(other.observations)
    for name in split:
        if name != "self":
            np.testing.assert_array_equal(split[name], mixed[name])
    np.testing.assert_array_equal(mixed["self"][..., :10], split["self"])
    np.testing.assert_array_equal(mixed["self"][0, :, 10:], [[1, 0], [0, 1], [1, 0], [0, 1]])


@pytest.mark.parametrize("delay_s", [0.0, 0.4])
def test_what_is_heard_is_weighed_by_the_sensor_that_measured_it(delay_s):
    """Both maps are the same once one robot has told the other all, whose own sensor knows it better."""
    slow = RobotKind(SCOUT.robot, dataclasses.replace(SCOUT.sensor, scan_time_s=50.0))
    coarse = RobotKind(GROUND.robot, dataclasses.replace(GROUND.sensor, scan_time_s=0.5, range_noise_m=0.0))
    for pair in ((coarse, slow), (slow, coarse)):
        channel = {"burst": 1000, "i_min_bits": 0.0, "delay_s": delay_s}
        missions = started(box_of(pair, robots=2, channel=channel, decision_period_s=1.5), seed=1)
        teller = pair.index(coarse)
        place = missions.grid.centre_of([3, 5, 1]).tolist()
        put(missions, teller, [*place, 0.3, 0.0])
        stay = np.zeros((1, 2, 5))
        stay[:, :, 3] = 0.3 / math.pi
        missions.step(stay, np.zeros((1, 2), np.int64))
        state = missions.state
        assert list(state.robots[0]["scans"][[teller, 1 - teller]]) == [1, 0]
        assert state.robots[0, 1 - teller]["measurements_received"] == coarse.sensor.rays
        np.testing.assert_array_equal(state.precision[0, 0] > 0.01, state.precision[0, 1] > 0.01)
        np.testing.assert_allclose(state.precision[0, 0], state.precision[0, 1], rtol=1e-6)
        np.testing.assert_allclose(state.mean[0, 0], state.mean[0, 1], rtol=1e-5, atol=1e-6)
        hits = state.precision[0, 0].max()
        assert hits < 1.01 / coarse.sensor.sigma_min**2 * coarse.sensor.rays
        near = 1.0 / (coarse.sensor.sigma_min + coarse.sensor.sigma_slope_per_m * 2.5) ** 2
        assert state.precision[0, 0][state.precision[0, 0] > 0.01].min() > 0.9 * near


def with_bodies(*radii_m, reach_m=3.0):
    """One kind of flying robot for each radius."""
    robots = [Robot(reach_m=reach_m, body_radius_m=radius) for radius in radii_m]
    return [RobotKind(robot, RangeSensor((0.0, 0.0), 0.1)) for robot in robots]


def test_bodies_of_two_sizes_by_hand():
    """A is at x = 0.75 m, B with 0.4 m around it at 3.25 m, on a line along x in the middle of the box."""
    missions = started(box_of(with_bodies(0.1, 0.4), robots=2, grid=Grid((11, 7, 5), 0.5)))
    y, z = 1.75, 1.25
    put(missions, 0, [0.75, y, z, 0.0, 0.0])
    put(missions, 1, [3.25, y, z, math.pi, 0.0])
    boxes = np.zeros((1, 2, 5))
    boxes[0, 0, 0], boxes[0, 1, 3] = 1.0, 1.0  # A drives 3 m ahead, B stays and looks at it
    missions.step(boxes, np.zeros((1, 2), np.int64))
    a = missions.state.robots[0, 0]
    assert list(MoveEnd)[a["move_end"]] is MoveEnd.TEAMMATE
    assert a["goal"][0] == pytest.approx(3.25 - 0.5, abs=1e-5)
    while missions.state.robots[0]["scans"].min() == 0 or not a["deciding"]:
        missions.step(boxes * 0.0 + np.array([0, 0, 0, 0, 0.0]), np.zeros((1, 2), np.int64))
    assert missions.state.scan_returned[0, 0, 0] == 0  # B's body is in the way
    blocked = [
        missions.worlds[0].layout(missions.scenario, kind).collision_mask for kind in missions.scenario.kinds
    ]
    assert not blocked[0].any() and blocked[1][0].all() and not blocked[1][1:-1, 1:-1, 1:-1].any()
    np.testing.assert_array_equal(missions.state.collision, [each.ravel() for each in blocked])


def test_the_mask_and_the_actions_of_each_kind():
    kinds = (
        RobotKind(dataclasses.replace(GROUND.robot, reach_m=0.5), GROUND.sensor),
        RobotKind(dataclasses.replace(SCOUT.robot, reach_m=1.0), SCOUT.sensor),
    )
    for pitches in (3, 2):
        action = {"kind": "discrete", "yaws": 4, "pitches": pitches}
        scenario = box_of(kinds, robots=2, action=action, observation={"action_mask": True})
        missions, rules = started(scenario, seed=2), rules_of(scenario)
        for robot in range(2):
            put(missions, robot, [*missions.grid.centre_of([3, 5, 1 + robot]).tolist(), 0.0, 0.0])
        masks = missions.action_masks()[0].reshape(2, len(rules.actions.moves), 4, pitches)
        ground, scout = masks
        assert ground.sum() == 5 * 4  # to stay, or a voxel ahead, back, left or right; a gaze a yaw
        lengths = np.linalg.norm(rules.actions.moves, axis=1)
        assert not ground[(lengths > 1.0) | (rules.actions.moves[:, 2] != 0)].any()
        assert scout.sum() == scout.shape[0] * 4 * pitches == 33 * 4 * pitches
        for robot, mask in enumerate(masks.reshape(2, -1)):
            view = view_of(missions, 0, robot)
            for number in np.flatnonzero(mask)[:: 29 if robot else 3]:
                boxes, numbers = np.zeros((1, 2, 5)), np.zeros((1, 2), np.int64)
                numbers[0, robot] = number
                tried = pickle.loads(pickle.dumps(missions))
                tried.step(boxes, numbers)
                assert view.action_for(tried.state.robots[0, robot]["target"]) == number


def test_the_threshold_asks_for_what_any_robot_can_see():
    """Robots that look level see their own layer only; with one that flies the team sees everything."""
    flat_view = dataclasses.replace(GROUND.sensor, field_of_view_rad=(math.pi, 0.0))
    ground = box_of((RobotKind(GROUND.robot, flat_view),), robots=2)
    mixed = box_of((RobotKind(GROUND.robot, flat_view), SCOUT), robots=2)
    seen = [started(each).worlds[0].visible_voxels(each) for each in (ground, mixed)]
    assert seen[0] < seen[1] == 7 * 11 * 5
    ends = [started(each).state.missions[0]["entropy_end_bits"] for each in (ground, mixed)]
    assert ends[0] > ends[1]
    world = started(mixed).worlds[0]
    floors = [information_floor(box_of(kinds, robots=2), world) for kinds in ((GROUND, SCOUT), (SCOUT,))]
    assert floors[0] == pytest.approx(floors[1])  # the better eye decides


def test_what_does_not_fit_any_kind_is_refused():
    with pytest.raises(SettingError, match=r"Robot\.sensor_height_m = 9"):
        box_of((SCOUT, RobotKind(Robot(motion="planar", sensor_height_m=9.0))))
    far = RobotKind(Robot(reach_m=math.inf))
    with pytest.raises(SettingError, match=r"Action\.kind"):
        box_of((SCOUT, far), action={"kind": "discrete"})
    assert box_of((SCOUT, far), robots=1, action={"kind": "discrete"})
