"""Drives on planned paths by hand: poses and times, scans under way, what ends a drive early."""

import math

import numpy as np
import pytest

from entropy_explore_env.missions import episode
from entropy_explore_env.missions.poses import place_at, pose_at
from entropy_explore_env.missions.view import view_of
from entropy_explore_env.robots.motion import MoveEnd
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.worlds.world import World
from tests.reference.scenes import build, free_box, put, started, toward

FLAT = Grid((7, 11, 1), 0.5)
ALL_ROUND = {"field_of_view_rad": (2 * math.pi, 0.0), "angular_step_rad": math.pi / 90}
START, BEHIND = (0.75, 0.75, 0.25, 0.0, 0.0), (2.75, 0.75, 0.25, 1.0, 0.0)
LEG = math.sqrt(65.0) / 2  # from voxel (1, 1) to (2, 9), and from (4, 9) to (5, 1), in metres


def wall_with_a_gap():
    """Solid voxels: a wall across the flat box at x = 3, open from y = 9 on."""
    solid = np.zeros(FLAT.shape, bool)
    solid[3, :9] = True
    return solid


def planner(**changes):
    """Robots in the flat box that plan, turn at once, and choose places in the whole workspace."""
    robot = {
        "navigator": "planned",
        "reach_m": math.inf,
        "turn_rate_rad_s": math.inf,
        **changes.pop("robot", {}),
    }
    endless = {"sigma_end": 1e-4}
    return free_box(
        **{"robots": 1, "grid": FLAT, "sensor": ALL_ROUND, "ending": endless, **changes, "robot": robot}
    )


def know(missions, solid, robot=0):
    """Let a robot believe that these voxels, (X, Y, Z) bool, are covered and all others free."""
    missions.state.mean[0, robot] = solid.ravel()
    missions.state.precision[0, robot] = 1e4


def at_the_wall(**changes):
    """A robot before the wall that knows it."""
    missions = started(planner(**changes))
    build(missions, wall_with_a_gap())
    know(missions, wall_with_a_gap())
    put(missions, 0, START)
    return missions


def end_of(robot):
    return list(MoveEnd)[robot["move_end"]]


def test_a_path_around_a_wall_is_driven_without_stopping_at_its_corners():
    """At 0.5 m/s and 0.5 m/s²: 1 s up, (L - ½)/½ s along, 1 s down; then 0.5 s for the scan."""
    missions = at_the_wall()
    robots = toward(missions, BEHIND)
    robot, params = robots[0], missions.rules.params[0]
    length = 2 * LEG + 1.0
    assert end_of(robot) is MoveEnd.ARRIVED
    assert (robot["waypoints"], robot["corners"], robot["blocked_moves"]) == (3, 2, 0)
    assert robot["path"][:3] == pytest.approx(
        np.array([[1.25, 4.75, 0.25], [2.25, 4.75, 0.25], BEHIND[:3]]), abs=1e-6
    )
    assert robot["goal"] == pytest.approx(BEHIND, abs=1e-6)
    assert robot["distance_m"] == pytest.approx(robot["path_m"]) == pytest.approx(length)
    assert missions.state.missions[0]["time_s"] == pytest.approx(2.0 * length + 1.0 + 0.5)
    places = {
        0.0: (START[:2], 0),
        1.0: ((0.75 + 0.25 / math.sqrt(65), 0.75 + 2.0 / math.sqrt(65)), 0),  # ¼ m, 1 : 8
        2.0 * LEG + 0.5: ((1.25, 4.75), None),  # the first corner, at full speed
        2.0 * LEG + 1.5: ((1.75, 4.75), 1),  # ½ m farther
        2.0 * (LEG + 1.0) + 0.5: ((2.25, 4.75), None),
        2.0 * length: ((2.75 - 0.25 / math.sqrt(65), 0.75 + 2.0 / math.sqrt(65)), 2),  # ¼ m is left
        2.0 * length + 1.0: (BEHIND[:2], 2),
        2.0 * length + 1.5: (BEHIND[:2], 2),
    }
    for time_s, (place, passed) in places.items():
        assert pose_at(params, robot, time_s)[:2] == pytest.approx(place, abs=1e-6), time_s
        if passed is not None:
            assert place_at(params, robot, time_s)[3] == passed, time_s


def test_scans_under_way_are_taken_after_so_many_metres_and_counted():
    """Every 2 m of 9.06 m: at 4.5, 8.5, 12.5 and 16.5 s, and on arrival after 19.12 + 0.5 s."""
    missions = at_the_wall(decision_period_s=0.25, sensor={**ALL_ROUND, "scan_every_m": 2.0})
    robot, params, scans, poses = missions.state.robots[0, 0], missions.rules.params[0], [], []
    while not (robot["scans"] and robot["deciding"]):
        before = robot["scans"]
        assert missions.state.missions[0]["time_s"] < 25.0
        toward(missions, BEHIND)
        if robot["scans"] > before:
            scans.append(missions.state.missions[0]["time_s"])
            poses.append(robot["scan_pose"].copy())
            assert robot["own_bits"] > 0.0
            assert robot["measurements"] == 180 * robot["scans"] == 180 * len(scans)
    assert scans == [4.5, 8.5, 12.5, 16.5, 19.75]
    assert robot["ready_s"] == pytest.approx(2.0 * (2 * LEG + 1.0) + 1.5)
    for time_s, pose in zip(scans, poses, strict=True):
        assert pose == pytest.approx(pose_at(params, robot, time_s))
    along = np.array([0.5, 4.0]) / LEG
    assert poses[0][:2] == pytest.approx(np.array([0.75, 0.75]) + 2.0 * along)
    assert robot["gained_bits"] == pytest.approx(
        missions.state.missions[0]["entropy_start_bits"] - robot["entropy_bits"]
    )


def test_a_scan_where_the_drive_ends_is_taken_once():
    """Three metres, a scan every metre: under way after one and two, then on arrival."""
    missions = started(planner(sensor={**ALL_ROUND, "scan_every_m": 1.0}, robot={"navigator": "straight"}))
    put(missions, 0, START)
    robots = toward(missions, (0.75, 3.75, 0.25, 0.0, 0.0))
    assert robots["scans"][0] == 3
    assert robots["goal"][0, 1] == pytest.approx(3.75, abs=1e-6)


def test_scans_under_way_are_shared_and_heard_at_their_time():
    missions = started(planner(robots=2, sensor={**ALL_ROUND, "scan_every_m": 1.0}, decision_period_s=0.25))
    put(missions, 0, START)
    put(missions, 1, (2.75, 4.75, 0.25, 0.0, 0.0))
    heard = []
    for _ in range(18):  # 3 m take 7 s; robot 1 stands and scans every half a second
        toward(missions, (0.75, 3.75, 0.25, 0.0, 0.0), (2.75, 4.75, 0.25, 0.0, 0.0))
        heard.append(view_of(missions, 0, 1).teammates[0])
    robots = missions.state.robots[0]
    assert (robots["scans"][0], robots["messages_sent"][0]) == (2, 3)  # an announcement and two batches
    assert [view.heard_s for view in heard[:9]] == [0.0] * 9  # the announcement
    assert [view.heard_s for view in heard[9:17]] == [2.5] * 8  # 1 + (1 - ¼)/½ s
    assert heard[17].heard_s == 4.5
    assert heard[17].pose[:2] == pytest.approx([0.75, 2.75])
    assert robots["measurements_received"][1] == robots["measurements_sent"][0] > 0


BEYOND = (1.75, 5.25, 0.25, 0.5, 0.0)


def before_a_wall(open_from=7, **changes):
    """A robot that scans every metre, and does not know of the wall at y = 8 in its way to what is beyond."""
    missions = started(planner(sensor={**ALL_ROUND, "scan_every_m": 1.0}, **changes))
    solid = np.zeros(FLAT.shape, bool)
    solid[:open_from, 8] = True
    build(missions, solid)
    put(missions, 0, (1.75, 0.75, 0.25, 0.0, 0.0))
    return missions


def test_a_wall_seen_under_way_ends_the_drive_there_and_the_robot_decides_anew():
    missions = before_a_wall(open_from=6)
    robot = toward(missions, BEYOND)[0]  # nothing is known: it drives straight at the wall
    assert end_of(robot) is MoveEnd.SEEN
    assert missions.state.missions[0]["time_s"] == pytest.approx(2.5)
    assert robot["goal"] == pytest.approx([1.75, 1.75, 0.25, 0.5, 0.0])
    assert robot["target"] == pytest.approx(BEYOND, abs=1e-6)
    assert (robot["deciding"], robot["scans"], robot["blocked_moves"]) == (True, 1, 1)
    assert robot["distance_m"] == pytest.approx(1.0) == pytest.approx(robot["path_m"])
    assert view_of(missions, 0, 0).pose == pytest.approx(robot["goal"])
    for _ in range(8):
        if end_of(toward(missions, BEYOND)[0]) is MoveEnd.ARRIVED:
            break
    assert robot["goal"] == pytest.approx(BEYOND, abs=1e-6)
    assert end_of(robot) is MoveEnd.ARRIVED


def test_a_drive_counts_as_blocked_that_ends_before_what_is_not_there():
    """It comes to believe in a wall that is none, a metre before it scans."""
    sensor = {**ALL_ROUND, "scan_every_m": 1.0}
    missions = started(planner(decision_period_s=0.25, sensor=sensor))
    know(missions, np.zeros(FLAT.shape, bool))
    put(missions, 0, START)
    robot = toward(missions, (0.75, 4.75, 0.25, 0.0, 0.0))[0]
    assert (end_of(robot), robot["blocked_moves"]) == (MoveEnd.ARRIVED, 0)
    wall = np.zeros(FLAT.shape, bool)
    wall[:, 6] = True
    know(missions, wall)
    while not robot["scans"]:
        toward(missions, (0.75, 4.75, 0.25, 0.0, 0.0))
    assert (end_of(robot), robot["blocked_moves"], robot["deciding"]) == (MoveEnd.SEEN, 1, True)
    assert robot["path_m"] == pytest.approx(1.0) == pytest.approx(robot["distance_m"])


def test_the_end_of_a_path_counts_though_an_unseen_wall_ends_the_drive_before():
    """The wall is where the plan leads, not where the drive would stop."""
    missions = before_a_wall()
    assert end_of(toward(missions, BEYOND)[0]) is MoveEnd.SEEN
    robot = toward(missions, BEYOND)[0]  # now it knows that there is no path: up to the wall
    assert end_of(robot) is MoveEnd.NO_PATH
    assert robot["goal"][:3] == pytest.approx([1.75, 3.75, 0.25])
    assert robot["blocked_moves"] == 2
    robot = toward(missions, BEYOND)[0]  # nearer it cannot get
    assert (end_of(robot), robot["path_m"]) == (MoveEnd.NO_PATH, 0.0)
    assert robot["goal"] == pytest.approx([1.75, 3.75, 0.25, 0.5, 0.0])


def test_who_drives_straight_does_not_look_ahead():
    robot = toward(before_a_wall(robot={"navigator": "straight"}), BEYOND)[0]
    assert (end_of(robot), robot["scans"]) == (MoveEnd.OBSTACLE, 3)
    assert robot["goal"][1] == pytest.approx(3.75)


def test_a_path_ends_before_what_the_robot_did_not_know_of():
    missions = at_the_wall()
    solid = wall_with_a_gap()
    solid[5, 4] = True  # on the last leg: x = 5 there from y = 5.5 on
    missions.state.truth[0] = solid.ravel()
    robot = toward(missions, BEHIND)[0]
    assert end_of(robot) is MoveEnd.OBSTACLE
    assert (robot["corners"], robot["blocked_moves"]) == (2, 1)
    # It leaves (4.5, 9.5) towards (5.5, 1.5), enters x = 5 at y = 5.5, and voxel (5, 4) at y = 5.
    assert robot["goal"][:2] == pytest.approx([2.5 + 0.25 / 16, 2.5 + 0.25 / 2])
    assert robot["path_m"] == pytest.approx(LEG + 1.0 + 4.25 / 8.0 * LEG)
    assert robot["distance_m"] == pytest.approx(robot["path_m"])


@pytest.mark.parametrize(
    ("goal", "end", "height"), [(1.75, MoveEnd.NO_PATH, 1.25), (0.25, MoveEnd.GROUND, 0.75)]
)
def test_unknown_ground_ends_a_path_by_name_and_a_ceiling_is_known(monkeypatch, goal, end, height):
    """Ground that nobody knows of up to z = 0.5, and a ceiling at z = 1.5; the plan leads around a pillar."""
    grid = Grid((7, 11, 5), 0.5)
    ground = np.zeros(grid.shape, bool)
    ground[:, :, 0] = True
    world = World(grid, ground, "plain", ceiling=np.full((7, 11), 3, np.int32))
    monkeypatch.setattr(episode, "make_world", lambda *_: world)
    missions = started(planner(grid=grid))
    believed = np.zeros(grid.shape, bool)
    believed[3, 2:9] = True
    know(missions, believed)
    put(missions, 0, (0.75, 2.75, 1.25, 0.0, 0.0))
    robot = toward(missions, (2.75, 2.75, goal, 0.0, 0.0))[0]
    assert robot["waypoints"] > 1
    assert end_of(robot) is end
    assert robot["goal"][2] == pytest.approx(height, abs=0.25)
    assert not missions.state.collision[0].reshape(grid.shape)[tuple(grid.voxel_of(robot["goal"][:3]))]


def test_a_teammate_on_a_later_leg_ends_the_path_before_it():
    missions = started(planner(robots=2, robot={"body_radius_m": 0.2}))
    build(missions, wall_with_a_gap())
    know(missions, wall_with_a_gap())
    put(missions, 0, START)
    put(missions, 1, (2.25, 4.75, 0.25, 0.0, 0.0))  # at the second corner
    robot = toward(missions, BEHIND, (2.25, 4.75, 0.25, 0.0, 0.0))[0]
    assert end_of(robot) is MoveEnd.TEAMMATE
    assert robot["corners"] == 1
    assert robot["goal"][:2] == pytest.approx([2.25 - 0.4, 4.75], abs=1e-5)


@pytest.mark.parametrize(("after_s", "end"), [(1.0, MoveEnd.TEAMMATE), (12.0, MoveEnd.ARRIVED)])
def test_the_path_that_a_teammate_still_drives_is_closed_and_what_it_has_driven_is_free(after_s, end):
    """Robot 0 is sent around the wall and passes its second corner after 10.56 s; 1 wants to the first."""
    missions = started(planner(robots=2, robot={"body_radius_m": 0.2}, decision_period_s=0.5))
    build(missions, wall_with_a_gap())
    for robot in range(2):
        know(missions, wall_with_a_gap(), robot)
    put(missions, 0, START)
    put(missions, 1, (0.25, 3.25, 0.25, 0.0, 0.0))
    robots, there = missions.state.robots[0], (1.25, 4.75, 0.25, 0.0, 0.0)
    while missions.state.missions[0]["time_s"] < after_s or not robots["deciding"][1]:
        toward(missions, BEHIND, robots["goal"][1])
    toward(missions, BEHIND, there)
    assert not robots["deciding"][0]
    assert end_of(robots[1]) is end
    if end is MoveEnd.TEAMMATE:  # the first leg leads from (0.75, 0.75) to (1.25, 4.75)
        x, y = robots["goal"][1, :2] - np.array(START[:2])
        assert abs(x * 4.0 - y * 0.5) / LEG == pytest.approx(0.4, abs=1e-5)


def test_a_view_shows_the_path_ahead_as_it_was_planned():
    missions = at_the_wall(decision_period_s=2.0)
    solid = wall_with_a_gap()
    solid[5, 4] = True
    missions.state.truth[0] = solid.ravel()  # the drive will end early, which the robot does not know
    assert view_of(missions, 0, 0).path.shape == (0, 3)
    points = np.array([[1.25, 4.75, 0.25], [2.25, 4.75, 0.25], BEHIND[:3]])
    ahead = []
    for _ in range(8):
        toward(missions, BEHIND)
        view = view_of(missions, 0, 0)
        ahead.append(len(view.path))
        assert view.path == pytest.approx(points[3 - len(view.path) :], abs=1e-6)
        assert not view.path.flags.writeable
    assert ahead == [3, 3, 3, 3, 2, 1, 1, 0]  # corners after 8.56 and 10.56 s; it decides at 15.8 s
    straight = started(free_box(decision_period_s=0.25))
    put(straight, 0, (1.75, 1.75, 1.25, 0.0, 0.0))
    toward(straight, (1.75, 2.75, 1.25, 0.0, 0.0), (0.25, 0.25, 0.25, 0.0, 0.0))
    assert view_of(straight, 0, 0).path == pytest.approx(np.array([[1.75, 2.75, 1.25]]), abs=1e-6)
