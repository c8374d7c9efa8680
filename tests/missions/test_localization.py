"""Missions in which robots drift: by hand, beside exact ones, in teams, copied, batched, drawn, refused."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.missions.poses import pose_at
from entropy_explore_env.missions.simulation import Missions
from entropy_explore_env.missions.view import view_of
from entropy_explore_env.missions.view_observation import ViewObserver
from entropy_explore_env.reports.metrics import mission_figures
from entropy_explore_env.robots.channel import BITS_PER_BATCH, BITS_PER_COVARIANCE
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.channel import BITS_PER_MEASUREMENT
from entropy_explore_env.settings.localization import Localization
from entropy_explore_env.settings.robot_kind import RobotKind
from tests.reference.scenes import build, drawn, free_box, put, seeds, started, toward, wander

SOME = {
    "xy_m_per_sqrt_m": 0.05,
    "z_m_per_sqrt_m": 0.02,
    "yaw_rad_per_sqrt_m": 0.02,
    "yaw_rad_per_sqrt_rad": 0.02,
}
STAY = (1.75, 1.75, 1.25, 0.0, 0.0)
DRIFTING = {"robot": {"localization": SOME}}
RATES = ("xy_per_m", "z_per_m", "yaw_per_m", "yaw_per_rad")
CHANNELS = ({}, {"delay_s": 0.7}, {"phase_s": 1.5, "repeats": 2})


def frozen(scenario, **kept):
    """Missions of robots that could drift, and do not: kernels are those of robots that drift."""
    missions = started(scenario, **kept)
    params = missions.rules.localization
    assert params is not None
    for name in RATES:
        params[name] = 0.0
    return missions


@drawn(12)
@given(
    seeds,
    st.sampled_from(CHANNELS),
    st.sampled_from(["straight", "planned"]),
    st.sampled_from(["at_stop", "on_scan", 0.6]),
    st.booleans(),
)
def test_without_any_error_a_mission_is_that_of_exact_robots_bit_for_bit(
    seed, channel, navigator, redecide, planar
):
    robot = {"navigator": navigator, "redecide": redecide, "motion": "planar" if planar else "free"}
    changes = {
        "world": "furnished",
        "robots": 3,
        "sensor": {"scan_every_m": 0.4, "range_noise_m": 0.05, "max_range_m": 2.0},
        "channel": {"i_min_bits": 0.0, **channel},
        "observation": {"overview": True, "patch": True, "drive": True},
    }
    exact = started(free_box(robot=robot, **changes), seed=seed)
    drifting = free_box(robot={**robot, "localization": SOME}, fiducials={"number": 3}, **changes)
    other = frozen(drifting, seed=seed)
    for missions in (exact, other):
        wander(missions, 15, 1)
    assert (exact.observations == other.observations).all()
    for name in ("mean", "precision", "scan_range_m", "scan_utility_bits", "in_flight_rays", "phase_rays"):
        assert (getattr(exact.state, name) == getattr(other.state, name)).all(), name
    for field in exact.state.robots.dtype.names or ():
        if not field.startswith("bits_"):
            assert (exact.state.robots[field] == other.state.robots[field]).all(), field
    estimates = other.state.estimates
    assert (estimates["error"] == 0.0).all() and (estimates["covariance"] == 0.0).all()
    for robot_number in range(3):
        views = [view_of(missions, 0, robot_number) for missions in (exact, other)]
        assert (views[0].pose == views[1].pose).all() and (views[0].path == views[1].path).all()
        assert (views[0].scan.pose == views[1].scan.pose).all()


def test_an_error_of_a_voxel_moves_the_map_by_a_voxel():
    """The robot believes to be an edge farther along y; what it sees before the walls comes out so."""
    sensor, turned = {"max_range_m": 1.2}, {"turn_rate_rad_s": math.inf}
    maps = []
    for error in (0.0, 0.5):
        missions = frozen(free_box(robots=1, sensor=sensor, robot={**turned, "localization": SOME}))
        put(missions, 0, STAY)
        missions.state.estimates["error"][0, 0] = 0.0, error, 0.0, 0.0
        here = np.add(STAY, (0.0, error, 0.0, 0.0, 0.0))
        assert view_of(missions, 0, 0).pose.tolist() == here.tolist()
        robots = toward(missions, np.add(here, (0.0, 0.5, 0.0, 0.3, 0.1)))
        assert robots["goal"][0] == pytest.approx([1.75, 2.25, 1.25, 0.3, 0.1], abs=1e-6)
        assert robots["target"][0][1] == pytest.approx(2.25 + error, abs=1e-6)
        maps.append((missions.mean[0, 0].copy(), missions.precision[0, 0].copy()))
    (exact, known), (moved, as_known) = maps
    assert (known > known.min()).sum() > 5
    np.testing.assert_allclose(moved[:, 1:], exact[:, :-1], atol=1e-5)
    np.testing.assert_allclose(as_known[:, 1:], known[:, :-1], rtol=1e-4)


def test_a_robot_that_is_wrong_about_its_yaw_drives_and_looks_elsewhere():
    """A quarter turn off: meaning to drive along x, and to look so, it drives and looks along -y."""
    missions = frozen(free_box(robots=1, robot={"turn_rate_rad_s": math.inf, "localization": SOME}))
    put(missions, 0, (1.75, 2.75, 1.25, 0.5, 0.0))
    missions.state.estimates["error"][0, 0, 3] = math.pi / 2
    assert view_of(missions, 0, 0).pose[3] == pytest.approx(0.5 + math.pi / 2)
    robots = toward(missions, (2.25, 2.75, 1.25, 0.0, 0.0))
    assert robots["goal"][0] == pytest.approx([1.75, 2.25, 1.25, -math.pi / 2, 0.0], abs=1e-6)
    view = view_of(missions, 0, 0)
    assert view.pose == pytest.approx([2.25, 2.75, 1.25, 0.0, 0.0], abs=1e-6)
    assert view.scan.pose == pytest.approx(view.pose, abs=1e-12)
    assert view.scan.range_m[view.scan.returned > 0].mean() == pytest.approx(
        2.25, rel=0.05
    )  # to the wall y = 0
    assert missions.mean[0, 0, 6, 5, 2] == pytest.approx(0.0, abs=1e-3)  # which it takes for one beyond x


def test_a_robot_that_a_fault_stops_is_as_uncertain_as_what_it_has_driven_makes_it():
    """½ m in 1.5 s, then it stops for good; 5 cm per √m."""
    only_xy = {"localization": {"xy_m_per_sqrt_m": 0.05}, "turn_rate_rad_s": math.inf}
    stops = {"stop": {"at_s": 1.5, "robots": (0,)}}
    channel = {"content": "summaries", "reach": "line_of_sight"}  # as where all is on: compiled for both
    missions = started(
        free_box(robots=2, robot=only_xy, faults=stops, channel=channel, fiducials={"own_number": 1})
    )
    put(missions, 0, (1.75, 1.75, 1.25, 0.0, 0.0))
    put(missions, 1, STAY)
    for _ in range(5):
        toward(missions, (1.75, 2.75, 1.25, 0.0, 0.0), STAY)
    variance = np.diag(missions.state.estimates[0, 0]["covariance"])
    assert variance[:2] == pytest.approx(0.05**2 * 0.5) and variance[2:] == pytest.approx(0.0)


def test_true_walls_stop_a_robot_that_believes_to_be_elsewhere():
    solid = np.zeros((7, 11, 5), bool)
    solid[:, 5] = True
    missions = frozen(free_box(robots=1, robot={"turn_rate_rad_s": math.inf, "localization": SOME}))
    build(missions, solid)
    put(missions, 0, (1.75, 2.25, 1.25, 0.0, 0.0))
    missions.state.estimates["error"][0, 0, 1] = -0.5
    robots = toward(missions, (1.75, 2.75, 1.25, 0.0, 0.0))  # truly at 2.75 is the wall
    assert robots["blocked_moves"][0] == 1 and robots["goal"][0][1] < 2.5
    assert view_of(missions, 0, 0).pose[1] == pytest.approx(robots["goal"][0][1] - 0.5)


def test_an_estimate_beyond_the_workspace_is_taken_into_it():
    missions = frozen(free_box(robots=1, robot={"localization": SOME}))
    put(missions, 0, (3.2, 5.2, 0.3, 0.0, 0.0))
    missions.state.estimates["error"][0, 0] = 2.0, -30.0, -1.0, 0.0
    assert view_of(missions, 0, 0).pose[:3] == pytest.approx([3.5, 0.0, 0.0], abs=1e-6)
    for _ in range(12):
        robots = toward(missions, (3.4, 0.1, 0.1, 0.4, 0.2))
        view, estimate = view_of(missions, 0, 0), missions.state.estimates[0, 0]
        assert ((view.pose[:3] >= 0.0) & (view.pose[:3] < [3.5, 5.5, 2.5])).all()
        assert view.pose[:3] == pytest.approx(estimate["place"] + estimate["error"][:3])
    assert robots["scans"][0] == 12 and np.isfinite(missions.mean).all()


def test_an_estimate_that_leaves_the_workspace_between_two_scans_is_taken_into_it():
    robot = {"localization": SOME, "redecide": 0.3, "turn_rate_rad_s": math.inf, "reach_m": 9.0}
    missions = frozen(free_box(robots=1, robot=robot))
    put(missions, 0, (1.75, 1.75, 1.25, 0.0, 0.0))
    missions.state.estimates["error"][0, 0] = 0.0, 0.0, 0.0, 0.1  # so that it believes to drive to x = 3.4
    robots = toward(missions, (3.4, 1.75, 1.25, 0.0, 0.0))
    assert (robots["scans"][0], robots["under_way"][0]) == (0, True)
    missions.state.estimates["error"][0, 0, :3] = 2.0, -3.0, 1.5
    robots = toward(missions, view_of(missions, 0, 0).target)
    estimate = missions.state.estimates[0, 0]
    assert (robots["scans"][0], robots["under_way"][0]) == (0, True)
    assert estimate["place"] + estimate["error"][:3] == pytest.approx([3.5, 0.0, 2.5], abs=1e-6)


@pytest.mark.parametrize("channel", CHANNELS)
def test_teammates_fuse_in_the_sender_s_frame_with_the_sender_s_covariance(channel):
    """Robot 0, an edge off and uncertain, scans; robot 1 sees nothing itself and holds the same map."""
    told = {}
    for uncertain in (0.0, 0.5):
        scenario = free_box(
            robot={"turn_rate_rad_s": math.inf, "localization": SOME, "body_radius_m": 0.0},
            channel={"burst": 100, "i_min_bits": 0.0, "announcements": False, **channel},
            decision_period_s=1.0,
        )
        blind = RobotKind(scenario.robot, dataclasses.replace(scenario.sensor, min_range_m=99.0))
        missions = frozen(with_settings(scenario, {"extra_kinds": (blind,)}))
        put(missions, 0, STAY)
        put(missions, 1, (0.75, 4.75, 1.25, 0.0, 0.0))
        missions.state.estimates["error"][0, 0] = 0.0, 0.5, 0.0, 0.0
        missions.state.estimates["covariance"][0, 0] = np.diag([uncertain, 0.0, 0.0, 0.1 * uncertain]) ** 2
        for _ in range(5):
            robots = toward(missions, view_of(missions, 0, 0).pose, (0.75, 4.75, 1.25, 0.0, 0.0))
        assert missions.state.heard[0, 1, 0]["pose"] == pytest.approx([1.75, 2.25, 1.25, 0.0, 0.0])
        bits = BITS_PER_BATCH + BITS_PER_COVARIANCE + BITS_PER_MEASUREMENT * 28
        assert robots["bits_received"][1] == robots["messages_received"][1] * bits
        batches = int(robots["measurements_received"][1]) // 28
        own, mates = missions.precision[0]
        prior = float(missions.rules.params["prior_precision"][0])
        seen, scans = own > 2.0 * prior, int(robots["scans"][0])
        np.testing.assert_allclose(  # of as many scans: the latest may be under way
            (mates[seen] - prior) / batches, (own[seen] - prior) / scans, rtol=1e-3
        )
        np.testing.assert_allclose(missions.mean[0, 1], missions.mean[0, 0], atol=1e-2)
        told[uncertain] = float(own[seen].max()) / scans
    assert told[0.5] < 0.3 * told[0.0]


@pytest.mark.parametrize("flat", [False, True])
def test_errors_are_as_large_as_robots_hold_them_to_be(flat):
    """Normalised squares of 150 missions' errors far from walls, of 3 numbers or 4: within 99.9 % of χ²."""
    drift = {"xy_m_per_sqrt_m": 0.02, "z_m_per_sqrt_m": 0.03, "yaw_rad_per_sqrt_m": 0.01}
    drift |= {"yaw_rad_per_sqrt_rad": 0.02}
    scenario = free_box(
        grid={"shape": (27, 31, 21)},
        robots=1,
        robot={"localization": drift, "motion": "planar" if flat else "free"},
        sensor={"field_of_view_rad": (2 * math.pi, math.pi / 3), "angular_step_rad": math.pi / 6},
        fiducials={"number": 0 if flat else 4},
    )
    missions = Missions(scenario, 150)
    missions.reset_some(range(150), list(range(150)))
    for mission in range(150):
        put(missions, 0, (6.75, 7.75, 0.75 if flat else 5.25, 0.0, 0.0), mission)
    wander(missions, 25, 3)
    numbers = [0, 1, 3] if flat else [0, 1, 2, 3]
    squares = 0.0
    for estimate in missions.state.estimates[:, 0]:
        error, covariance = estimate["error"][numbers], estimate["covariance"][np.ix_(numbers, numbers)]
        squares += error @ np.linalg.inv(covariance) @ error
    freedom = 150 * len(numbers)
    assert abs(squares - freedom) < 3.3 * math.sqrt(2 * freedom)
    estimates = missions.state.estimates
    assert (estimates["sightings"] > 0).any() != flat and (estimates["error"][..., :2] != 0.0).all()


def test_exact_robots_cost_nothing():
    exact = free_box(fiducials={"number": 2})
    assert not exact.drifts and not Localization().drifts and free_box(**DRIFTING).drifts
    missions = started(exact)
    assert missions.rules.localization is None and missions.estimates is None
    assert (view_of(missions, 0, 0).covariance == 0.0).all()
    assert "localization" not in mission_figures(missions, 0)


def test_what_a_robot_sees_and_says_is_where_it_believes_to_be():
    """Views, observations and policies' observations of a drifted robot are made from its estimate alone."""
    scenario = free_box(robots=2, fiducials={"number": 2}, decision_period_s=1.0, **DRIFTING)
    missions = started(scenario)
    wander(missions, 30, 0)
    state = missions.state
    observer = ViewObserver(scenario, scenario.observation, scenario.action)
    time_s = float(state.missions["time_s"][0])
    for robot in range(2):
        view, own = view_of(missions, 0, robot), state.robots[0, robot]
        estimate = state.estimates[0, robot]
        pose = np.array(pose_at(missions.rules.params[robot], own, time_s))
        assert (np.abs(view.pose - pose)[[0, 1, 3]] > 1e-4).all() and view.pose[4] == pose[4]
        assert (view.covariance == estimate["covariance"]).all() and not view.covariance.flags.writeable
        assert (view.fiducials_m == state.fiducials[0]).all()
        np.testing.assert_array_equal(observer.observe(view), missions.observations[0, robot])
        mate = view_of(missions, 0, 1 - robot).teammates[robot]
        sent = np.array([estimate["scan_pose"], mate.pose])
        assert (mate.pose != own["scan_pose"]).any() and np.abs(sent[0] - sent[1])[:3].max() < 1.0


def test_infos_and_figures_say_how_wrong_robots_are():
    scenario = free_box(decision_period_s=1.0, max_cycles=12, **DRIFTING)
    env = EntropyExploreEnv(scenario)
    _, told = env.reset(seed=0)
    assert {info["pose_error_m"] for info in told.values()} == {0.0}
    rng = np.random.default_rng(0)
    while env.agents:
        actions = {agent: rng.uniform(-1, 1, 5).astype(np.float32) for agent in env.agents}
        _, _, _, _, infos = env.step(actions)
    figures = env.figures()["localization"]
    estimates, robots = env.missions.state.estimates[0], env.missions.state.robots[0]
    assert figures["rms_error_m"] == math.sqrt(estimates["squared_m2"].sum() / robots["scans"].sum())
    assert figures["rms_error_rad"] == math.sqrt(estimates["squared_rad2"].sum() / robots["scans"].sum())
    errors = [info["pose_error_m"] for info in infos.values()]
    assert figures["mean_error_m"] == pytest.approx(np.mean(errors)) and min(errors) > 0.0
    assert min(info["pose_error_rad"] for info in infos.values()) > 0.0
