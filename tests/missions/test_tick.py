"""One step by hand: driving, messages on their way, bodies in the way."""

import math

import numpy as np
import pytest

from entropy_explore_env.missions import episode
from entropy_explore_env.missions.scanning import note_scan
from entropy_explore_env.missions.state import LatestScans
from entropy_explore_env.missions.view import view_of
from entropy_explore_env.robots.motion import MoveEnd
from entropy_explore_env.robots.range_sensor import Return
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.worlds.world import World
from tests.reference import rocha04
from tests.reference.scenes import build, free_box, put, standing, started, toward, wander

ONE_RAY = {"field_of_view_rad": (0.0, 0.0)}


def test_a_drive_takes_its_time_and_scans_at_its_end():
    """1 m at 0.5 m/s and 0.5 m/s²: 1 s up, 1 s along, 1 s down; then 0.5 s for the scan."""
    missions = standing((1.75, 1.75, 1.25, 0.0, 0.0), robot={"turn_rate_rad_s": math.inf})
    robots = toward(missions, (1.75, 2.75, 1.25, 1.0, -0.5))
    assert missions.state.missions[0]["time_s"] == pytest.approx(3.5)
    assert robots["goal"][0] == pytest.approx([1.75, 2.75, 1.25, 1.0, -0.5], abs=1e-6)
    assert robots["distance_m"][0] == pytest.approx(1.0)


def test_turning_happens_while_driving_and_may_take_longer():
    missions = standing((1.75, 1.75, 1.25, 3.0, 0.0), robot={"turn_rate_rad_s": 0.5})
    toward(missions, (1.75, 2.75, 1.25, -2.0, 0.25))  # 1.2832 rad through straight behind
    turn_s = (2 * math.pi - 5.0) / 0.5
    assert missions.state.missions[0]["time_s"] == pytest.approx(max(turn_s, 3.0) + 0.5)
    slow = standing((1.75, 1.75, 1.25, 0.0, 0.0), robot={"turn_rate_rad_s": 0.1})
    toward(slow, (1.75, 2.75, 1.25, 1.0, 0.0))
    assert slow.state.missions[0]["time_s"] == pytest.approx(10.5)


def test_a_robot_stops_before_what_is_solid_and_says_why():
    missions = started(free_box(robots=1))
    solid = np.zeros((7, 11, 5), bool)
    solid[3, 7, 2] = True
    build(missions, solid)
    put(missions, 0, (1.75, 2.75, 1.25, 0.0, 0.0))
    robots = toward(missions, (1.75, 3.7, 1.25, 0.0, 0.0))  # voxel 7 begins at 3.5
    assert list(MoveEnd)[robots["move_end"][0]] is MoveEnd.OBSTACLE
    assert robots["goal"][0, :3] == pytest.approx([1.75, 3.25, 1.25])
    assert robots["target"][0, :3] == pytest.approx([1.75, 3.7, 1.25])
    robots = toward(missions, (1.75, 3.4, 1.25, 0.0, 0.0))
    assert list(MoveEnd)[robots["move_end"][0]] is MoveEnd.ARRIVED
    robots = toward(missions, (0.8, 3.4, 1.25, 0.0, 0.0))
    robots = toward(missions, (-0.1, 3.4, 1.25, 0.0, 0.0))
    assert list(MoveEnd)[robots["move_end"][0]] is MoveEnd.WALL
    assert robots["goal"][0, 0] == pytest.approx(0.25)  # the middle of voxel 0
    assert robots["blocked_moves"][0] == 2


def test_a_rover_stops_where_the_ground_ends_and_says_so(monkeypatch):
    """Ground up to z = 1 for y < 3.5, without the corner where x < 1; the rover's circle must be carried."""
    ground = np.zeros((7, 11, 5), bool)
    ground[:, :7, :2] = True
    ground[:2, 5:, 1] = False
    world = World(Grid((7, 11, 5), 0.5), ground, "step")
    monkeypatch.setattr(episode, "make_world", lambda *_: world)
    rover = {"motion": "planar", "sensor_height_m": 1.75, "above_ground_m": 0.75, "body_radius_m": 0.3}
    missions = standing((2.25, 1.25, 1.75, 0.0, 0.0), robot={**rover, "reach_m": 4.0, "tilts": True})
    robots = toward(missions, (2.25, 4.75, 1.75, 0.0, 0.9))
    assert list(MoveEnd)[robots["move_end"][0]] is MoveEnd.EDGE
    assert robots["goal"][0] == pytest.approx([2.25, 2.75, 1.75, 0.0, 0.9])  # voxel 6 touches the edge at 3.5
    robots = toward(missions, (2.25, 1.75, 1.75, 0.0, 0.9))
    assert list(MoveEnd)[robots["move_end"][0]] is MoveEnd.ARRIVED
    robots = toward(missions, (1.75, 1.75, 1.75, 0.0, -0.4))
    assert robots["goal"][0, 4] == pytest.approx(-0.4)
    robots = toward(missions, (0.75, 2.4, 1.75, 0.0, 0.0))
    assert list(MoveEnd)[robots["move_end"][0]] is MoveEnd.EDGE
    flying = {"motion": "free", "above_ground_m": 0.75, "reach_m": 4.0}
    missions = standing((2.25, 1.25, 1.75, 0.0, 0.0), robot=flying)
    assert list(MoveEnd)[toward(missions, (2.25, 4.75, 1.75, 0.0, 0.0))["move_end"][0]] is MoveEnd.ARRIVED


def test_a_robot_stays_between_ground_and_ceiling_and_says_which_of_them_stopped_it(monkeypatch):
    """Ground up to z = 0.5; closed to robots, not to rays, from z = 2 on."""
    ground = np.zeros((7, 11, 5), bool)
    ground[:, :, 0] = True
    world = World(Grid((7, 11, 5), 0.5), ground, "plain", ceiling=np.full((7, 11), 4, np.int32))
    monkeypatch.setattr(episode, "make_world", lambda *_: world)
    missions = standing((1.75, 2.75, 1.25, 0.0, 0.0))
    robots = toward(missions, (1.75, 2.75, 2.2, 0.0, 0.0))
    assert list(MoveEnd)[robots["move_end"][0]] is MoveEnd.CEILING
    assert robots["goal"][0, 2] == pytest.approx(1.75)
    robots = toward(missions, (1.75, 2.75, 1.2, 0.0, 0.0))
    robots = toward(missions, (1.75, 2.75, 0.3, 0.0, math.pi / 2))
    assert list(MoveEnd)[robots["move_end"][0]] is MoveEnd.GROUND
    assert robots["goal"][0, 2] == pytest.approx(0.75)
    assert missions.state.scan_range_m[0, 0] == pytest.approx(0.25, rel=0.05)  # rays end on the ground …
    robots = toward(missions, (1.75, 2.75, 0.75, 0.0, -math.pi / 2))
    assert missions.state.scan_range_m[0, 0] == pytest.approx(1.75, rel=0.05)  # … and pass the ceiling


def test_a_robot_stops_before_a_teammate_and_before_the_path_that_it_still_drives():
    missions = standing(
        (1.75, 1.25, 1.25, 0.0, 0.0), (1.75, 2.75, 1.25, 0.0, 0.0), robot={"body_radius_m": 0.2}
    )
    # Robot 0 chooses first: from y = 1.25 to 1.95; robot 1 then may come to 1.95 + 0.4.
    robots = toward(missions, (1.75, 1.95, 1.25, 0.0, 0.0), (1.75, 1.8, 1.25, 0.0, 0.0))
    assert [list(MoveEnd)[code] for code in robots["move_end"]] == [MoveEnd.ARRIVED, MoveEnd.TEAMMATE]
    assert robots["goal"][1, 1] == pytest.approx(2.35, abs=1e-5)
    assert robots["goal"][1, 1] - robots["goal"][0, 1] >= 0.4


def test_bodies_of_no_size_block_nobody_and_hide_nothing():
    missions = standing(
        (1.75, 1.25, 1.25, math.pi / 2, 0.0),
        (1.75, 2.25, 1.25, math.pi / 2, 0.0),
        robot={"body_radius_m": 0.0},
        sensor=ONE_RAY,
    )
    robots = toward(missions, (1.75, 2.25, 1.25, math.pi / 2, 0.0), (1.75, 2.25, 1.25, math.pi / 2, 0.0))
    wander(missions, 1, 0)
    assert robots["blocked_moves"].tolist()[0] == 0
    assert (missions.state.scan_returned[0] == Return.HIT).all()


def test_a_teammate_between_a_robot_and_the_wall_leaves_no_measurement():
    """Robot 0 looks along y at robot 1, three metres away; the wall is behind it."""
    missions = started(free_box(robot={"body_radius_m": 0.2}, sensor=ONE_RAY, channel={"i_min_bits": 0.0}))
    first, second = (1.75, 0.75, 1.25, math.pi / 2, 0.0), (1.75, 3.75, 1.25, math.pi / 2, 0.0)
    put(missions, 0, first)
    put(missions, 1, second)
    robots = toward(missions, first, second)
    assert missions.state.scan_returned[0, :, 0].tolist() == [Return.NOTHING, Return.HIT]
    assert robots["measurements"].tolist() == [0, 1]
    assert robots["measurements_sent"].tolist() == [0, 1]  # nothing is no measurement of no use
    assert robots["own_bits"][0] == 0.0
    assert robots["depth_m"].tolist() == pytest.approx([0.0, 1.75])
    # Robot 1 measured the wall at 5.5 m; robot 0 heard of it, and knows no more than that.
    assert robots["received_bits"][0] == robots["own_bits"][1] > 0.0
    known = np.flatnonzero(missions.state.precision[0, 0] != missions.state.precision[0, 0].min())
    assert known.tolist() == [(3 * 11 + y) * 5 + 2 for y in range(7, 11)]


def test_a_step_of_no_fixed_length_ends_with_the_next_arrival():
    missions = standing(
        (1.75, 1.25, 1.25, 0.0, 0.0),
        (0.75, 2.25, 1.25, 0.0, 0.0),
        robot={"turn_rate_rad_s": math.inf, "body_radius_m": 0.0},
    )
    near, far = (1.75, 1.375, 1.25, 0.0, 0.0), (1.75, 2.25, 1.25, 0.0, 0.0)
    robots = toward(missions, near, far)  # 0.125 m: 2·√0.25 = 1 s; 1 m: 3 s; and 0.5 s each
    assert missions.state.missions[0]["time_s"] == pytest.approx(1.5)
    assert robots["deciding"].tolist() == [True, False]
    robots = toward(missions, near, near)
    assert missions.state.missions[0]["time_s"] == pytest.approx(2.0)
    assert robots["scans"].tolist() == [2, 0]
    for _ in range(3):
        robots = toward(missions, near, near)
    assert missions.state.missions[0]["time_s"] == pytest.approx(3.5)
    assert robots["goal"][1, :3] == pytest.approx([1.75, 2.25, 1.25])
    assert robots["scans"].tolist() == [5, 1]  # both at the same instant


# --- Messages


def test_what_is_heard_of_a_teammate():
    missions = standing(
        (1.75, 1.25, 1.25, 0.0, 0.0), (0.75, 4.25, 1.25, 0.0, 0.0), robot={"turn_rate_rad_s": math.inf}
    )
    chosen = (1.75, 1.375, 1.25, 0.5, 0.25)
    toward(missions, chosen, (0.75, 4.25, 1.75, 0.0, 0.0))
    heard = view_of(missions, 0, 1).teammates[0]
    assert (heard.announced_s, heard.heard_s) == (0.0, pytest.approx(1.5))  # then its batch came
    assert heard.viewpoint == pytest.approx(chosen, abs=1e-6)
    assert heard.pose == pytest.approx(chosen, abs=1e-6)
    assert (heard.depth_m, heard.half_angle_rad) == (0.0, 0.0)  # it had not scanned yet
    toward(missions, chosen, chosen)
    heard, own = view_of(missions, 0, 1).teammates[0], missions.state.robots[0, 0]
    assert heard.announced_s == pytest.approx(1.5)
    assert heard.depth_m > 0.0
    sensor = missions.scenario.sensor
    assert heard.half_angle_rad == pytest.approx(
        math.acos(
            rocha_cosine((sensor.columns - 1) / 2 * sensor.angular_step_rad, 0.25, (sensor.rows - 1) / 2)
        ),
        abs=0.02,
    )
    assert own["depth_m"] > 0.0


def rocha_cosine(turn, pitch, rows):
    """Cosine between the gaze and the corner ray farthest from it."""
    gaze, step = rocha04.gaze(0.0, pitch), math.pi / 36
    corners = [rocha04.gaze(turn, pitch + sign * rows * step) for sign in (-1, 1)]
    return min(sum(a * b for a, b in zip(gaze, corner, strict=True)) for corner in corners)


def settled(channel, world, sensor, edge_m):
    """Two robots that scan for six steps and share everything, then turn for so long that all is heard."""
    settings = {
        "decision_period_s": 1.0,
        "world": world,
        "robot": {"turn_rate_rad_s": 0.02, "max_speed_m_s": 5.0, "acceleration_m_s2": 50.0},
        "channel": {"i_min_bits": 0.0, "burst": 1000, **channel},
        "sensor": {"angular_step_rad": math.pi / 24, **(sensor or {})},
        "grid": Grid((7, 11, 5), edge_m),
        "ending": {"sigma_end": 1e-3},  # not before all is heard
    }
    missions = started(free_box(**settings), seed=3)
    rng, received = np.random.default_rng(5), []
    for step in range(12):
        views = [view_of(missions, 0, robot) for robot in range(2)]
        wanted = [view.pose + np.array([*rng.uniform(-0.5, 0.5, 3), 0.0, 0.0]) for view in views]
        if step == 6:
            wanted = [view.pose + np.array([0.0, 0.0, 0.0, 2.0, 0.0]) for view in views]
        toward(missions, *wanted)
        received.append(missions.state.robots[0]["measurements_received"].sum())
    return missions, received


@pytest.mark.parametrize(
    ("world", "sensor", "edge_m"),
    [
        ("empty", None, 0.5),
        ("empty", {"max_range_m": 1.0}, 0.4),
        ("furnished", {"range_noise_m": 0.1}, 0.4),
        ("furnished", None, 0.5),
        ("furnished", {"field_of_view_rad": (6.0, 1.0)}, 0.4),
    ],
)
def test_delayed_messages_bring_what_immediate_ones_bring_but_later(world, sensor, edge_m):
    (soon, soon_received), (late, late_received) = (
        settled(channel, world, sensor, edge_m) for channel in ({}, {"delay_s": 2.75})
    )
    assert late_received[:2] == [0, 0]  # sent from 0.5 s on, heard from 3.25 s on
    assert all(late <= soon for soon, late in zip(soon_received, late_received, strict=True))
    assert soon_received[3] > late_received[3] > 0
    assert late_received[-1] == soon_received[-1] > 150
    assert (late.state.in_flight["due_s"] == np.inf).all()
    for counted in ("messages_received", "measurements_received", "bits_received", "messages_sent"):
        assert (soon.state.robots[counted] == late.state.robots[counted]).all()
    np.testing.assert_allclose(late.precision, soon.precision, rtol=1e-5)
    np.testing.assert_allclose(late.mean, soon.mean, atol=1e-5)
    np.testing.assert_allclose(
        late.state.robots["entropy_bits"], soon.state.robots["entropy_bits"], rtol=0, atol=1e-2
    )
    for field in ("heard_s", "pose", "announced_s", "announced"):
        np.testing.assert_array_equal(late.state.heard[field], soon.state.heard[field])


def test_a_delayed_message_arrives_at_its_time_to_the_instant():
    missions = started(free_box(decision_period_s=0.25, channel={"delay_s": 1.0}))
    for step in range(4):
        wander(missions, 1, step)
        assert (missions.state.robots[0]["messages_received"] == (step >= 3)).all()  # the announcements
    assert (missions.state.heard[0]["announced_s"] == [[-1.0, 0.0], [0.0, -1.0]]).all()


def test_a_measurement_of_no_less_than_i_min_is_not_redundant():
    """Equation 43 asks for at least I_min; what measured nothing is neither redundant nor sent."""
    missions = started(free_box(robots=2))
    state, scan = missions.state, missions._compiled_step.work[0].scan
    latest = LatestScans(state.scan_range_m[0], state.scan_returned[0], state.scan_utility_bits[0])
    state.robots["i_min_bits"] = 0.25
    scan.rays["returned"], scan.utility[:] = Return.HIT, 0.5
    scan.utility[:3] = 0.25, 0.125, 0.75
    scan.rays["returned"][3], scan.utility[3] = Return.NOTHING, 0.0
    note_scan(state.robots[0][1], latest, scan, 1)
    assert state.robots["redundant"].tolist() == [[0, 1]]
    assert scan.utility[:4].tolist() == [0.25, 0.125, 0.75, -1.0]
    assert state.scan_utility_bits[0, 1, :4].tolist() == [0.25, 0.125, 0.75, 0.0]
