"""A mission's time series."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from entropy_explore_env.reports.recording import DrivenPaths, Recorder, poses_now
from entropy_explore_env.settings.robot import Robot
from entropy_explore_env.settings.robot_kind import RobotKind
from tests.reference.scenes import drawn, free_box, random_actions, seeds, started


def recorded(steps: int, robots: int = 3):
    """A recorder over some steps, and what the state of the first of three missions said at each moment."""
    missions = started(free_box(robots=robots), seed=5, missions=3)
    recorder, said, rng = Recorder(missions), [], np.random.default_rng(1)
    for step in range(steps + 1):
        if step:
            missions.step(*random_actions(missions, rng))
        recorder.note()
        state = missions.state.robots[0]
        said.append(
            (
                float(missions.state.missions[0]["time_s"]),
                state["entropy_bits"].copy(),
                int(state["scans"].sum()),
                int(state["measurements_sent"].sum()),
                state["scan_pose"][:, :3].copy(),
            )
        )
    return recorder, said


def test_a_recorder_keeps_every_moment_as_it_was():
    recorder, said = recorded(25)
    time_s, entropy_bits, scans, shared, scan_positions_m = (
        np.asarray(column) for column in zip(*said, strict=True)
    )
    series = recorder.series()
    assert (series.time_s.shape, series.time_s.dtype) == ((26,), np.float64)
    assert (series.entropy_bits.shape, series.entropy_bits.dtype) == ((26, 3), np.float64)
    assert (series.scan_positions_m.shape, series.scan_positions_m.dtype) == ((26, 3, 3), np.float64)
    assert series.scans.dtype.kind == series.shared.dtype.kind == "i"
    np.testing.assert_array_equal(series.time_s, time_s)
    np.testing.assert_array_equal(series.entropy_bits, entropy_bits)
    np.testing.assert_array_equal(series.scans.sum(axis=1), scans)
    np.testing.assert_array_equal(series.shared, shared)
    np.testing.assert_array_equal(series.scan_positions_m, scan_positions_m)
    assert scans[-1] > 20 and shared[-1] > 0
    assert len(np.unique(series.entropy_bits[:, 0])) > 5


WANDERERS = {
    "straight": {},
    "mixed": {"extra_kinds": (RobotKind(Robot(reach_m=2.0, max_speed_m_s=1.5, acceleration_m_s2=2.0)),)},
    "planned": {
        "world": "furnished",
        "robot": {"navigator": "planned", "reach_m": math.inf, "body_radius_m": 0.2},
        "sensor": {"scan_every_m": 0.4, "field_of_view_rad": (2.0, 0.5)},
    },
}


@pytest.mark.parametrize("period_s", [None, 0.3, 5.0])
@pytest.mark.parametrize("kind", WANDERERS)
def test_paths_are_those_that_were_driven(kind, period_s):
    """As long as the odometer says, under way and at rest, through free space only, corners and all."""
    missions = started(
        free_box(robots=3, decision_period_s=period_s, ending={"sigma_end": 1e-3}, **WANDERERS[kind]), seed=6
    )
    paths, stood, drives, rng = DrivenPaths(3), 0, set(), np.random.default_rng(2)
    paths.update(missions)
    for _ in range(60):
        missions.step(*random_actions(missions, rng))
        paths.update(missions)
        robots = missions.state.robots[0]
        drives |= set(enumerate(robots["depart_s"].tolist())) | {(robot, 0.0) for robot in range(3)}
        for robot, path in enumerate(paths.to_now(missions)):
            driven_m = np.linalg.norm(np.diff(path, axis=0), axis=1).sum()
            assert driven_m == pytest.approx(robots["distance_m"][robot], abs=1e-9)
            stood += bool(robots["deciding"][robot])
    assert stood > 15
    truth = missions.worlds[0].occupied
    for robot, path in enumerate(paths.to_now(missions)):
        np.testing.assert_array_equal(path[-1], poses_now(missions, 0)[robot, :3])
        shares = np.linspace(0.0, 1.0, 50)[:, None, None]
        between = path[:-1] + shares * (path[1:] - path[:-1])
        assert not truth[tuple(np.moveaxis(missions.grid.voxel_of(between), -1, 0))].any()
    assert (sum(map(len, paths.passed_m)) > len(drives)) == (kind == "planned")  # corners


@drawn(12)
@given(seeds, st.sampled_from(["straight", "planned"]), st.sampled_from(["on_scan", 0.45, 0.8]))
def test_drives_that_are_cut_short_count_as_far_as_they_were_driven(seed, navigator, redecide):
    """Robots that decide under way brake, turn off, meet each other, and run into what they did not know."""
    robot = {"navigator": navigator, "reach_m": 3.0, "acceleration_m_s2": 0.7, "redecide": redecide}
    sensor, ending = {"scan_every_m": 0.4}, {"sigma_end": 1e-3}
    scenario = free_box(world="furnished", robots=3, robot=robot, sensor=sensor, ending=ending)
    missions = started(scenario, seed=seed)
    paths, rng, robots = DrivenPaths(3), np.random.default_rng(seed), missions.state.robots[0]
    paths.update(missions)
    for _ in range(40):
        before_m = robots["distance_m"].copy()
        missions.step(*random_actions(missions, rng))
        paths.update(missions)
        driven_m = [np.linalg.norm(np.diff(path, axis=0), axis=1).sum() for path in paths.to_now(missions)]
        assert robots["distance_m"] == pytest.approx(driven_m, abs=1e-9)
        assert (robots["distance_m"] >= before_m - 1e-9).all()
    assert robots["distance_m"].max() > 0.0
