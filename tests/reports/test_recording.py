"""A mission's time series."""

from __future__ import annotations

import numpy as np

from entropy_explore_env.reports.recording import Recorder
from tests.reference.scenes import free_box, random_actions, started


def recorded(steps: int, robots: int = 3):
    """A recorder over some steps, and what the state said at each moment."""
    missions = started(free_box(robots=robots), seed=5)
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
        assert recorder.latest_s == said[-1][0]
    return recorder, said


def test_a_recorder_keeps_every_moment_as_it_was():
    recorder, said = recorded(25)
    time_s, entropy_bits, scans, shared, places_m = (np.asarray(column) for column in zip(*said, strict=True))
    assert (recorder.time_s.shape, recorder.time_s.dtype) == ((26,), np.float64)
    assert (recorder.entropy_bits.shape, recorder.entropy_bits.dtype) == ((26, 3), np.float64)
    assert (recorder.places_m.shape, recorder.places_m.dtype) == ((26, 3, 3), np.float64)
    assert recorder.scans.shape == recorder.shared.shape == (26,)
    assert recorder.scans.dtype.kind == recorder.shared.dtype.kind == "i"
    np.testing.assert_array_equal(recorder.time_s, time_s)
    np.testing.assert_array_equal(recorder.entropy_bits, entropy_bits)
    np.testing.assert_array_equal(recorder.scans, scans)
    np.testing.assert_array_equal(recorder.shared, shared)
    np.testing.assert_array_equal(recorder.places_m, places_m)
    assert recorder.scans[-1] > 20 and recorder.shared[-1] > 0
    assert len(np.unique(recorder.entropy_bits[:, 0])) > 5


def test_one_moment_of_one_robot_has_the_same_axes():
    recorder, _ = recorded(0, robots=1)
    shapes = [
        getattr(recorder, name).shape for name in ("time_s", "entropy_bits", "scans", "shared", "places_m")
    ]
    assert shapes == [(1,), (1, 1), (1,), (1,), (1, 1, 3)]


def test_a_recorder_follows_the_first_mission_only():
    missions = started(free_box(robots=2), seed=5, missions=3)
    recorder, alone = Recorder(missions), Recorder(started(free_box(robots=2), seed=5))
    rng = np.random.default_rng(1)
    for _ in range(8):
        boxes, numbers = random_actions(missions, rng)
        missions.step(boxes, numbers)
        alone.missions.step(boxes[:1], numbers[:1])
        recorder.note()
        alone.note()
    np.testing.assert_array_equal(recorder.entropy_bits, alone.entropy_bits)
    np.testing.assert_array_equal(recorder.places_m, alone.places_m)
