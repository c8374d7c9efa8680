"""Decisions under way by hand and on random drives: what they cost, what they leave as it was."""

import math

import numpy as np
import pytest

from entropy_explore_env.missions.poses import pose_at, speed_at
from entropy_explore_env.missions.redecision import CHOICE, braking_metres, keeps_speed, keeps_target
from entropy_explore_env.missions.view import view_of
from entropy_explore_env.robots.motion import MoveEnd
from tests.missions.test_driving import ALL_ROUND, BEHIND, LEG, at_the_wall, end_of, planner, wall_with_a_gap
from tests.reference.scenes import build, free_box, put, started, toward

START = (0.75, 0.75, 0.25, 0.0, 0.0)
FAR = (0.75, 4.75, 0.25, 0.0, 0.0)


def on_the_way(after_s=2.0, **changes):
    """A robot in the empty flat box, 0.5 m/s and 0.5 m/s², that drives up and decides again after 2 s."""
    robot = {"redecide": after_s, "navigator": "straight", **changes.pop("robot", {})}
    missions = started(planner(**changes, robot=robot))
    put(missions, 0, START)
    if missions.scenario.robots > 1:
        put(missions, 1, (2.75, 4.75, 0.25, 0.0, 0.0))
    robots = toward(missions, FAR, *[(2.75, 4.75, 0.25, 0.0, 0.0)] * (missions.scenario.robots - 1))
    while not robots["deciding"][0]:
        toward(missions, FAR, *[(2.75, 4.75, 0.25, 0.0, 0.0)] * (missions.scenario.robots - 1))
    assert (robots["under_way"][0], robots["scans"][0]) == (True, 0)
    assert missions.state.missions[0]["time_s"] == after_s
    return missions


def test_a_view_under_way_is_of_the_place_and_speed_now():
    view = view_of(on_the_way(), 0, 0)
    assert (view.deciding, view.under_way, view.speed_m_s, view.move_end) == (
        True,
        True,
        0.5,
        MoveEnd.UNDER_WAY,
    )
    assert view.pose == pytest.approx((0.75, 1.5, 0.25, 0.0, 0.0))  # ¼ m to speed up, and a second at ½ m/s
    assert view.target == pytest.approx(FAR, abs=1e-6)
    assert view.path == pytest.approx(np.array([FAR[:3]]), abs=1e-6)


@pytest.mark.parametrize(
    ("wanted", "arrives_s", "length_m", "rests"),
    [
        ((0.75, 3.75), 7.0, 2.25, False),  # the rest of a drive of 3 m: 1 s up, 5 s along, 1 s down
        ((0.75, 1.76), 3.02, 0.26, False),  # it can just come to rest: 1 cm at ½ m/s, and 1 s down
        ((2.75, 3.5), 2.0 + 2 * (math.sqrt(8.0) - 0.25) + 1.0, math.sqrt(8.0), False),  # 45° away
        ((2.75, 1.75), 3.0 + 5.0, 0.25 + 2.0, True),  # 90° from where it rests
        ((0.75, 0.75), 3.0 + 3.0, 0.25 + 1.0, True),  # back to the start
        ((0.75, 1.7), 3.0 + 2 * math.sqrt(0.1), 0.25 + 0.05, True),  # nearer than it can rest
    ],
)
@pytest.mark.parametrize("navigator", ["straight", "planned"])
def test_a_new_path_begins_at_the_speed_or_where_the_robot_has_braked(
    navigator, wanted, arrives_s, length_m, rests
):
    missions = on_the_way(robot={"navigator": navigator, "redecide": 2.0})
    missions.state.precision[0] = 1e4  # free space that is known
    missions.state.mean[0] = 0.0
    before = missions.state.missions[0]["time_s"]
    robots = toward(missions, (*wanted, 0.25, 0.0, 0.0))
    robot, params = robots[0], missions.rules.params[0]
    assert robot["depart_s"] == before == 2.0
    assert robot["path_m"] == pytest.approx(length_m, abs=1e-6)
    assert robot["departed_m"] == pytest.approx(0.75, abs=1e-6)
    assert (end_of(robot), robot["blocked_moves"]) == (MoveEnd.ARRIVED, 0)
    for _ in range(20):
        if robots[0]["scans"]:
            break
        toward(missions, view_of(missions, 0, 0).target)
    assert robots[0]["ready_s"] == pytest.approx(arrives_s + 0.5, abs=1e-6)
    assert robots[0]["goal"][:2] == pytest.approx(wanted, abs=1e-6)
    assert robots[0]["depart_s"] == 2.0  # what did not change did not begin anew
    if rests:
        assert pose_at(params, robots[0], 3.0)[:2] == pytest.approx((0.75, 1.75))
        assert speed_at(params, robots[0], 3.0) == pytest.approx(0.0, abs=1e-6)
        assert pose_at(params, robots[0], 2.5)[1] == pytest.approx(1.5 + 0.25 - 0.0625)
    else:
        assert speed_at(params, robots[0], 2.0) == pytest.approx(0.5)


def test_a_new_drive_that_something_cuts_short_ends_where_the_robot_can_rest():
    """A wall begins at x = 1, which it does not know: 30° to the right it would end after 0.45 m … of ½ m."""
    missions = on_the_way()
    solid = np.zeros(missions.grid.shape, bool)
    solid[2:] = True  # x ≥ 1
    build(missions, solid)
    robots = toward(missions, (1.75, 1.5 + math.sqrt(3.0), 0.25, 0.0, 0.0))
    robot = robots[0]
    assert end_of(robot) is MoveEnd.OBSTACLE
    assert (robot["blocked_moves"], robot["corners"]) == (1, 0)
    assert robot["path_m"] == pytest.approx(0.25) and robot["goal"][:2] == pytest.approx((0.75, 1.75))
    assert robot["ready_s"] == pytest.approx(3.5)
    robots = toward(missions, (0.75, 2.75, 0.25, 0.0, 0.0))
    assert (robot["blocked_moves"], robots["departed_m"][0]) == (1, pytest.approx(0.75 + 0.25))


def test_a_new_drive_that_ends_at_once_leads_around_the_corner_where_the_robot_brakes():
    """At ½ m/s, 0.1 m before a corner, it comes to rest 0.15 m behind it; the gate ahead has shut."""
    missions = at_the_wall(robot={"redecide": 2.0 * LEG + 0.3})
    robot, params = toward(missions, BEHIND)[0], missions.rules.params[0]
    assert (robot["under_way"], robot["corners"]) == (True, 2)
    solid = wall_with_a_gap()
    solid[3] = True
    build(missions, solid)
    now_s = float(missions.state.missions[0]["time_s"])
    robot = toward(missions, (2.25, 5.25, 0.25, 0.0, 0.0))[0]
    assert (end_of(robot), robot["corners"]) == (MoveEnd.OBSTACLE, 1)
    assert robot["path_m"] == pytest.approx(0.25, abs=1e-6)
    assert robot["path"][0, :2] == pytest.approx((1.25, 4.75), abs=1e-6)
    corner_s = now_s + (0.5 - math.sqrt(0.15)) / 0.5  # ½ t - ¼ t² = 0.1
    assert pose_at(params, robot, corner_s)[:2] == pytest.approx((1.25, 4.75), abs=1e-6)
    assert pose_at(params, robot, now_s + 1.0)[:2] == pytest.approx((1.40, 4.75), abs=1e-6)


def test_who_keeps_its_viewpoint_does_not_decide_again_before_its_time():
    """Steps of ½ s: it decides after 2 s, and then after 4."""
    missions, decided = on_the_way(decision_period_s=0.5), []
    for _ in range(4):
        robots = toward(missions, FAR)
        decided.append((bool(robots["deciding"][0]), bool(robots["under_way"][0])))
    assert decided == [(False, False)] * 3 + [(True, True)]


@pytest.mark.parametrize(("moved_m", "departs_s"), [(3e-4, 0.0), (1e-3, 2.0)])
def test_a_viewpoint_is_the_same_within_a_thousandth_of_a_voxel(moved_m, departs_s):
    """Voxels are ½ m: ½ mm counts."""
    missions = on_the_way()
    robots = toward(missions, (FAR[0] + moved_m, *FAR[1:]))
    assert robots["depart_s"][0] == departs_s


@pytest.mark.parametrize(
    ("viewpoint", "same"),
    [
        ((1.0, 2.0, 1.0, 0.5, -0.3), True),
        ((1.0, 2.0, 1.0, 0.5 - 2.0 * math.pi, -0.3), True),
        ((1.0, 2.0, 1.0, 0.5, 0.3), False),
        ((1.0, 2.0, 1.0, -0.5, -0.3), False),
        ((1.0, 2.0, 1.001, 0.5, -0.3), False),
        ((1.0, 2.0, 1.0, 0.502, -0.3), False),
    ],
)
def test_a_viewpoint_is_the_same_with_the_same_gaze(viewpoint, same):
    params, choice = started(free_box(robot={"reach_m": math.inf})).rules.params[0], np.zeros(1, CHOICE)[0]
    choice["viewpoint"] = viewpoint
    assert keeps_target(params, choice, np.array((1.0, 2.0, 1.0, 0.5, -0.3))) == same


def test_a_path_as_long_as_the_braking_distance_is_too_short_to_keep_the_speed():
    choice = np.zeros(1, CHOICE)[0]
    for length_m, keeps in ((0.25, False), (0.25 * (1.0 + 1e-6), True)):
        choice["path"][0] = length_m, 0.0, 0.0
        assert keeps_speed(choice, (0.25, 0.0, 0.0), 0.25) == keeps


def test_a_robot_that_comes_to_rest_within_a_billionth_of_a_metre_stands():
    """v²/2a at 1 m/s, of one that brakes with 5·10⁸ m/s², and with four fifths of that."""
    missions = on_the_way()
    params, robot = missions.rules.params[:1].copy(), missions.state.robots[0, 0]
    params["max_speed_m_s"] = 1.0
    for acceleration_m_s2, braking_m in ((5e8, 0.0), (4e8, 1.25e-9)):
        params["acceleration_m_s2"] = acceleration_m_s2
        assert speed_at(params[0], robot, 2.0) == 1.0
        assert braking_metres(params[0], robot, 2.0) == braking_m


def test_who_sees_its_path_blocked_decides_at_once_however_seldom_it_decides_else():
    sensor = {**ALL_ROUND, "scan_every_m": 0.3}
    missions = started(planner(sensor=sensor, robot={"redecide": 100.0, "unknown_cost": 1.0}))
    build(missions, wall_with_a_gap())
    put(missions, 0, START)
    robot = toward(missions, BEHIND)[0]
    assert (robot["scans"], robot["path_blocked"], robot["under_way"]) == (1, True, True)
    assert robot["redecide_s"] == missions.state.missions[0]["time_s"]


TOURS = (
    ((0.75, 4.75), (2.75, 4.75), (2.75, 0.75), (0.75, 0.75)),
    ((2.75, 2.25), (1.75, 2.75), (2.25, 1.75), (2.75, 3.25)),
)
ONLY_UNDER_WAY = ("decided_s", "redecide_s", "own_bits", "received_bits", "reward")
"""Fields of ROBOT that decisions under way change by themselves, and those of one step."""


def tour(missions, stops):
    """Drive the robots to their places in turn, asked on the way or not; their states at stops, and when."""
    robots, begun, states, times = missions.state.robots[0], [0] * missions.scenario.robots, [], []
    while min(begun) <= stops:
        wanted = []
        for robot, own in enumerate(robots):
            view = view_of(missions, 0, robot)
            if view.deciding and not view.under_way:
                begun[robot] += 1
                states.append((robot, own.copy(), missions.state.mean[0, robot].copy()))
                times.append(view.time_s)
            x, y = TOURS[robot][begun[robot] % 4]
            there = (x, y, view.pose[2], 0.3 * begun[robot], 0.0)
            wanted.append(view.target if view.under_way else there)
        toward(missions, *wanted)
    return states, times


@pytest.mark.parametrize(
    "robot",
    [
        {"navigator": "planned"},
        {"navigator": "straight"},
        {"navigator": "planned", "turn_rate_rad_s": 0.2},
        {"navigator": "straight", "reach_m": 2.5},
    ],
)
@pytest.mark.parametrize("redecide", ["on_scan", 0.3])
def test_a_decision_that_changes_nothing_leaves_drives_scans_and_messages_bit_for_bit(robot, redecide):
    """A team whose robots keep their viewpoints at every decision, beside one that is not asked under way."""
    sensor = {**ALL_ROUND, "scan_every_m": 0.6}
    channel = {"delay_s": 0.7, "loss_probability": 0.2}
    runs = []
    for when in ("at_stop", redecide):
        missions = started(
            planner(robots=2, sensor=sensor, channel=channel, robot={**robot, "redecide": when}), seed=3
        )
        put(missions, 0, START)
        put(missions, 1, (2.25, 1.75, 0.25, 0.0, 0.0))
        runs.append(tour(missions, 5))
    (stops, times), (others, other_times) = runs
    assert len(stops) >= 12 and other_times[: len(times)] == times
    names = [name for name in stops[0][1].dtype.names if name not in ONLY_UNDER_WAY]
    for (robot_number, own, mean), (other_number, other, other_mean) in zip(stops, others, strict=False):
        assert robot_number == other_number
        assert np.array_equal(mean, other_mean)
        for name in names:
            assert own[name].tobytes() == other[name].tobytes(), name


def test_a_path_that_a_scan_shows_to_be_blocked_is_planned_anew_without_a_stop():
    """The wall at x = 1.5 is seen on the way: the robot brakes and goes around it, to the same place."""
    sensor = {**ALL_ROUND, "scan_every_m": 0.3}
    missions = started(planner(sensor=sensor, robot={"redecide": "on_scan", "unknown_cost": 1.0}))
    build(missions, wall_with_a_gap())
    put(missions, 0, START)
    robot = toward(missions, BEHIND)[0]
    assert (robot["scans"], robot["path_blocked"], robot["under_way"]) == (1, True, True)
    assert robot["depart_s"] == 0.0 and robot["move_end"] == MoveEnd.OBSTACLE.code  # so it would have ended
    assert view_of(missions, 0, 0).move_end is MoveEnd.UNDER_WAY
    assert robot["messages_sent"] == 0
    now_s = float(missions.state.missions[0]["time_s"])
    robot = toward(missions, view_of(missions, 0, 0).target)[0]
    assert (robot["depart_s"], robot["path_blocked"]) == (now_s, False)
    assert robot["lead_s"] < 0.0 and robot["path"][0, 0] == pytest.approx(1.25, abs=1e-6)
    for _ in range(60):
        if not robot["under_way"]:
            break
        toward(missions, view_of(missions, 0, 0).target)
    assert robot["goal"] == pytest.approx(BEHIND, abs=1e-6)
    assert (end_of(robot), robot["blocked_moves"]) == (MoveEnd.ARRIVED, 0)
    assert robot["distance_m"] > 2 * LEG + 0.5 and robot["scans"] >= 30


def test_scans_under_way_are_as_far_apart_whatever_was_decided_between_them():
    """Every ½ m of the way driven: two decisions later, and on the way to rest before it turns back."""
    missions = on_the_way(0.9, sensor={**ALL_ROUND, "scan_every_m": 0.5})
    robot = missions.state.robots[0, 0]
    scans_m, ys = [], iter((3.75, 2.75, 4.25, 0.75, 0.75, 3.75))
    for _ in range(40):
        if not robot["under_way"]:
            break
        before = robot["scans"]
        toward(missions, (0.75, next(ys, 3.75), 0.25, 0.0, 0.0))
        if robot["scans"] > before:
            scans_m.append((int(robot["scans"]), float(robot["distance_m"])))
    assert len(scans_m) >= 6
    assert robot["scans"] == math.ceil(robot["distance_m"] / 0.5 - 1e-6)
    for scans, driven_m in scans_m:
        assert scans == math.floor(driven_m / 0.5 + 1e-6) or not robot["under_way"]


def test_a_robot_announces_a_changed_decision_only():
    missions = on_the_way(0.9, robots=2)
    sent = missions.state.robots[0]["messages_sent"]
    assert sent[0] == 1
    view = view_of(missions, 0, 0)
    toward(missions, view.target, (2.75, 4.75, 0.25, 0.0, 0.0))
    announced = view_of(missions, 0, 1).teammates[0]
    assert sent[0] == 1 and announced.announced_s == 0.0
    while not missions.state.robots[0, 0]["under_way"]:
        toward(missions, view.target, (2.75, 4.75, 0.25, 0.0, 0.0))
    now_s = float(missions.state.missions[0]["time_s"])
    toward(missions, (0.75, 2.75, 0.25, 0.0, 0.0), (2.75, 4.75, 0.25, 0.0, 0.0))
    announced = view_of(missions, 0, 1).teammates[0]
    assert announced.announced_s == now_s
    assert announced.viewpoint == pytest.approx((0.75, 2.75, 0.25, 0.0, 0.0), abs=1e-6)


@pytest.mark.parametrize("redecide", ["on_scan", 0.9])
def test_a_view_says_where_the_robot_would_scan(redecide):
    """A plan around the wall, and around again from the middle of a stretch between two scans."""
    sensor = {**ALL_ROUND, "scan_every_m": 0.6}
    missions = started(planner(sensor=sensor, robot={"redecide": redecide}))
    build(missions, wall_with_a_gap())
    missions.state.mean[0, 0], missions.state.precision[0, 0] = wall_with_a_gap().ravel(), 1e4
    put(missions, 0, START)
    robot, expected, found = missions.state.robots[0, 0], [], []
    assert view_of(missions, 0, 0).since_scan_m == 0.0
    toward(missions, BEHIND)
    for _ in range(60):
        view = view_of(missions, 0, 0)
        places = view.scan_places(view.path)
        if view.under_way and len(places):
            first = np.linalg.norm(places[0] - view.pose[:3])  # shorter than the path where that has a corner
            assert first <= 0.6 - view.since_scan_m + 1e-6
            expected.append((int(robot["scans"]) + 1, places[0]))
        scans = robot["scans"]
        toward(missions, view.target)
        if robot["scans"] > scans:
            found.append((int(robot["scans"]), robot["scan_pose"][:3].copy()))
        if not robot["under_way"]:
            break
    assert len(expected) >= 10
    for number, place in expected:
        scanned = dict(found)
        assert place == pytest.approx(scanned[number], abs=1e-6)
    view = view_of(missions, 0, 0)
    assert view.since_scan_m == 0.0 and view.path.shape == view.scan_places(view.path).shape == (0, 3)
    straight = view.scan_places(view.pose[None, :3] + [[0.0, 1.8, 0.0]])
    assert straight[:, 1] - view.pose[1] == pytest.approx([0.6, 1.2])  # the one at 1.8 m is that on arrival
