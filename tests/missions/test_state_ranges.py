"""Saved states with numbers that no mission can hold: refused by name, and nothing changes."""

from __future__ import annotations

import copy
import dataclasses
import math
import pickle

import numpy as np
import pytest

from entropy_explore_env.errors import EntropyExploreError, RecordError
from entropy_explore_env.missions.simulation import Missions
from entropy_explore_env.missions.snapshot import restore, snapshot
from entropy_explore_env.missions.state import FROM_WORLD
from entropy_explore_env.missions.state_ranges import check_ranges
from entropy_explore_env.reports.state_digest import state_digest
from tests.reference.scenes import free_box, started, wander

DELAYED = {"delay_s": 3.0, "i_min_bits": 0.0}
IN_PHASES = {"phase_s": 4.0, "i_min_bits": 0.0}
SUMMARIES = {"content": "summaries", "summary_every_s": 1.0, "delay_s": 3.0}
SPOILED = [
    ("robots", "corners", 10**8, DELAYED),
    ("robots", "corners", 1, DELAYED),  # of a straight drive
    ("robots", "waypoints", 33, DELAYED),
    ("robots", "waypoints", -1, DELAYED),
    ("robots", "goal", math.nan, DELAYED),
    ("robots", "origin", 1e9, DELAYED),
    ("robots", "scan_pose", -math.inf, DELAYED),
    ("robots", "target", 1e4, DELAYED),
    ("robots", "path", math.nan, DELAYED),
    ("robots", "move_end", 99, DELAYED),
    ("robots", "path_end", -1, DELAYED),
    ("robots", "ready_s", math.inf, DELAYED),
    ("robots", "next_scan_s", math.nan, DELAYED),
    ("robots", "redecide_s", math.nan, DELAYED),
    ("robots", "depart_s", 1e6, DELAYED),
    ("robots", "messages_received", -(2**62), DELAYED),
    ("robots", "entropy_bits", math.nan, DELAYED),
    ("robots", "half_angle_rad", 4.0, DELAYED),
    ("missions", "time_s", -1.0, DELAYED),
    ("missions", "time_s", 10_001.0, DELAYED),
    ("missions", "end", 99, DELAYED),
    ("missions", "seen_s", -2.0, DELAYED),
    ("missions", "seen_m", math.nan, DELAYED),
    ("missions", "explored_end", -1, DELAYED),
    ("missions", "explored_free_end", 10**9, DELAYED),
    ("missions", "cycles", -1, DELAYED),
    ("missions", "explored", 386, DELAYED),
    ("heard", "announced_s", math.nan, DELAYED),
    ("heard", "pose", 1e9, DELAYED),
    ("in_flight", "count", 9, DELAYED),
    ("in_flight", "count", -2, DELAYED),
    ("in_flight", "sender", 2, DELAYED),
    ("in_flight", "due_s", -math.inf, DELAYED),
    ("in_flight", "serial", 2**62, DELAYED),
    ("in_flight_rays", "", math.nan, DELAYED),
    ("in_flight_rays", "", 1e9, DELAYED),
    ("phases", "broadcasts", -1, IN_PHASES),
    ("phases", "collecting", 2, IN_PHASES),
    ("phase_counts", "", 1000, IN_PHASES),
    ("phase_heard", "", 4, IN_PHASES),
    ("phase_batches", "count", 9, IN_PHASES),
    ("phase_rays", "", math.inf, IN_PHASES),
    ("summaries", "sent_s", 1e9, SUMMARIES),
    ("summaries", "sent", -1, SUMMARIES),
    ("summaries", "low", -1, SUMMARIES),
    ("summaries", "high", 12, SUMMARIES),
    ("in_flight_parcels", "place", 10, SUMMARIES),
    ("in_flight_parcels", "bytes", 10**8, SUMMARIES),
    ("in_flight_parcels", "bytes", -1, SUMMARIES),
    ("own_mean", "", math.nan, SUMMARIES),
    ("own_precision", "", -1.0, SUMMARIES),
    ("mean", "", math.nan, DELAYED),
    ("mean", "", 1.1, DELAYED),
    ("precision", "", 0.0, DELAYED),
    ("precision", "", math.inf, DELAYED),
    ("pooled", "", math.nan, DELAYED),
    ("joint_precision", "", -1.0, DELAYED),
    ("scan_returned", "", 3, DELAYED),
    ("scan_range_m", "", math.nan, DELAYED),
    ("scan_utility_bits", "", -2.0, DELAYED),
    ("observations", "", math.nan, DELAYED),
    ("episodes", "", -1, DELAYED),
]


def walked(channel, steps=12, seed=1):
    overview = {"overview": True}
    missions = started(free_box(channel=channel, track_truth=True, observation=overview), seed, 2)
    wander(missions, steps, seed)
    return missions


def everything(missions):
    digests = [state_digest(missions, mission) for mission in range(2)]
    return digests, missions.seeds, missions.episodes, missions.observations.tobytes(), missions.worlds


@pytest.mark.parametrize(("name", "field", "value", "channel"), SPOILED)
def test_a_number_that_no_mission_holds_is_refused_by_name(name, field, value, channel):
    arrays, others = snapshot(walked(channel)), walked(channel, 5, 8)
    array = arrays[name][field] if field else arrays[name]
    before = copy.deepcopy(everything(others)[:4])
    array[(-1,) * array.ndim if name != "in_flight" else (1, 0)] = value
    if name == "in_flight" and field != "due_s":
        arrays[name]["due_s"][1, 0] = arrays["missions"]["time_s"][1]
    with pytest.raises(RecordError) as raised:
        restore(others, arrays)
    assert raised.value.field.startswith(f"{name}.{field}" if field else name)
    assert everything(others)[:4] == before


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("exponent", math.nan),
        ("exponent", -1.0),
        ("decided_s", -1.0),
        ("decided_s", math.inf),
        ("decided_bits", math.nan),
        ("most_bits", -1.0),
        ("failures", -1),
        ("share", 1.5),
    ],
)
def test_an_experience_that_no_robot_has_is_refused_by_name(field, value):
    missions = started(free_box(action={"kind": "candidates", "candidates": 6}), 3)
    missions.step(np.zeros((1, 2, 1)), np.zeros((1, 2), int))
    arrays = snapshot(missions)
    restore(missions, arrays)
    arrays["experience"][field][-1, -1] = value
    with pytest.raises(RecordError, match=rf"experience\.{field}"):
        restore(missions, arrays)


@pytest.mark.parametrize("channel", [DELAYED, IN_PHASES, SUMMARIES])
def test_a_state_as_it_was_is_taken_whenever_it_was_saved(channel):
    missions, others = walked(channel, 0), walked(channel, 5, 8)
    for step in range(40):
        restore(others, snapshot(missions))
        assert [state_digest(others, 0), state_digest(others, 1)] == everything(missions)[0]
        wander(missions, 1, step)


def test_starts_and_worlds_that_cannot_be_are_refused_and_change_nothing():
    missions = walked(DELAYED)
    arrays = snapshot(missions)
    before = copy.deepcopy(everything(missions)[:4])
    for name, value in (
        ("starts_1", np.full((2, 5), math.nan)),
        ("starts_1", np.full((2, 5), 1e9)),
        ("world_number_1", np.array(-1)),
        ("world_number_1", np.array(2**62)),
        ("world_1", np.zeros(100, np.uint8)),
        ("world_1", np.zeros(0, np.uint8)),
    ):
        with pytest.raises(EntropyExploreError, match="expected"):
            restore(missions, {**arrays, name: value})
        assert everything(missions)[:4] == before
    with pytest.raises(RecordError):
        restore(missions, {**arrays, "seeds": np.array(["1", "9" * 5000])})
    assert everything(missions)[:4] == before


def test_a_pickle_with_such_a_number_is_refused_too():
    missions = walked(DELAYED)
    again = pickle.loads(pickle.dumps(missions))
    assert everything(again)[0] == everything(missions)[0]
    missions.state.robots["corners"][1, 0] = 10**8
    with pytest.raises(RecordError) as raised:
        pickle.loads(pickle.dumps(missions))
    assert (raised.value.field, raised.value.value) == ("robots.corners[1, 0]", 10**8)
    never = pickle.loads(pickle.dumps(Missions(missions.scenario, 2)))
    assert never.episodes == [-1, -1]


def test_bytes_that_are_no_booleans_are_refused():
    arrays = snapshot(walked(DELAYED))
    arrays["in_flight_to"].view(np.uint8)[0, 0, 0] = 7
    with pytest.raises(RecordError, match=r"in_flight_to\[0, 0, 0\] = 7"):
        check_ranges(walked(DELAYED).scenario, arrays)


def test_a_summary_under_way_that_is_not_whole_is_refused():
    missions = walked(SUMMARIES, 30)
    arrays = snapshot(missions)
    mission, slot = np.argwhere(arrays["in_flight_parcels"]["bytes"] > 0)[0]
    place = arrays["in_flight_parcels"][mission, slot]["place"]
    check_ranges(missions.scenario, arrays)
    arrays["in_flight_summaries"][mission, place, 6] ^= 4
    with pytest.raises(RecordError, match=rf"in_flight_summaries\[{mission}, {place}\]"):
        check_ranges(missions.scenario, arrays)


def test_what_follows_from_the_world_is_in_no_saved_state():
    missions = walked(DELAYED)
    state = set(missions.state._fields)
    assert set(snapshot(missions)) & state == state - set(FROM_WORLD)


def test_free_places_of_landmarks_hold_zeros_wherever_the_workspace_is():
    changes = {"robot": {"localization": {"xy_m_per_sqrt_m": 0.1}}, "fiducials": {"own_number": 3}}
    scenario = free_box(**changes)
    grid = dataclasses.replace(scenario.grid, origin_m=(-40.0, 30.0, 5.0))
    scenario = dataclasses.replace(scenario, grid=grid)
    missions = started(scenario)
    arrays = missions.state._asdict()
    check_ranges(missions.scenario, arrays)
    assert not arrays["landmarks"]["used"].any() and (arrays["landmarks"]["place"] == 0.0).all()
