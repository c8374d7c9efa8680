"""Saved states with numbers that no mission can hold: refused by name, and nothing changes."""

import copy
import dataclasses
import functools
import math
import pickle

import numpy as np
import pytest

from entropy_explore_env.errors import EntropyExploreError, RecordError
from entropy_explore_env.missions.simulation import Missions
from entropy_explore_env.missions.snapshot import restore, snapshot
from entropy_explore_env.missions.state_ranges import check_ranges
from tests.missions.kinds import everything, walked
from tests.reference.scenes import free_box, started

LATE, ALL = "late messages", "everything at once"
SPOILED = {
    LATE: {
        "robots.corners": [10**8, 1],  # one corner is that of no straight drive
        "robots.waypoints": [33, -1],
        "robots.goal": [math.nan],
        "robots.origin": [1e9],
        "robots.scan_pose": [-math.inf],
        "robots.target": [1e4],
        "robots.path": [math.nan],
        "robots.move_end": [99],
        "robots.path_end": [-1],
        "robots.ready_s": [math.inf],
        "robots.next_scan_s": [math.nan],
        "robots.redecide_s": [math.nan],
        "robots.depart_s": [1e6],
        "robots.departed_m": [-1.0],
        "robots.messages_received": [-(2**62)],
        "robots.entropy_bits": [math.nan],
        "robots.half_angle_rad": [4.0],
        "missions.time_s": [-1.0, 10_001.0],
        "missions.end": [99],
        "missions.seen_s": [-2.0],
        "missions.seen_m": [math.nan],
        "missions.explored_end": [-1],
        "missions.explored_free_end": [10**9],
        "missions.cycles": [-1],
        "missions.explored": [386],
        "heard.announced_s": [math.nan],
        "heard.pose": [1e9],
        "in_flight.count": [9, -2],
        "in_flight.sender": [2],
        "in_flight.due_s": [-math.inf],
        "in_flight.serial": [2**62],
        "in_flight_rays": [math.nan, 1e9],
        "mean": [math.nan, 1.1],
        "precision": [0.0, math.inf],
        "pooled": [math.nan],
        "joint_precision": [-1.0],
        "scan_returned": [3],
        "scan_range_m": [math.nan],
        "scan_utility_bits": [-2.0],
        "observations": [math.nan],
        "episodes": [-1],
    },
    "need": {
        "backlog_poses": [1e9],
        "backlog_rays": [math.nan],
        "backlog_bits": [-2.0],
        "backlog_sent_s": [1e9],
        "backlog_heard_s": [-1.0],
    },
    "phases": {
        "phases.broadcasts": [-1],
        "phases.collecting": [2],
        "phase_counts": [1000],
        "phase_heard": [4],
        "phase_batches.count": [9],
        "phase_rays": [math.inf],
    },
    "summaries": {
        "summaries.sent_s": [1e9],
        "summaries.sent": [-1],
        "summaries.low": [-1],
        "summaries.high": [12],
        "in_flight_parcels.place": [1000],
        "in_flight_parcels.bytes": [10**8, -1],
        "own_mean": [math.nan],
        "own_precision": [-1.0],
    },
    "drift": {
        "estimates.place": [math.nan, -3.0],
        "estimates.error": [1e9],
        "estimates.covariance": [
            math.inf,
            -1.0,
            np.diag([1.0, 1.0, 1.0], 1),
            np.eye(4) + 3.0 * np.diag([1.0, 0.0, 0.0], 1),
            2.0 * np.ones((4, 4)) - np.eye(4),
        ],
        "estimates.packed": [1e99],
        "estimates.scan_pose": [1e3],
        "estimates.yaw": [50.0],
        "estimates.driven_m": [-5.0],
        "estimates.sightings": [-1],
        "estimates.squared_m2": [-1.0],
    },
    ALL: {
        "landmarks.score": [2.5],
        "landmarks.sightings": [-1],
        "landmarks.place": [99.0],
        "landmarks.seen_from": [math.nan],
        "landmarks.covariance": [math.inf],
    },
    "faults": {
        "faults.stop_s": [math.nan],
        "faults.stop_until_s": [-1.0],
        "faults.blind_s": [-1.0],
        "faults.rays_lost": [-1],
        "faults.messages_late": [2**60],
    },
    "candidates": {
        "candidates.viewpoint": [1e9],
        "candidates.goal": [math.nan, 13.0],
        "candidates.kind": [4],
        "candidates.bits": [-1.0],
        "experience.exponent": [math.nan, -1.0],
        "experience.decided_s": [-1.0, math.inf],
        "experience.decided_bits": [math.nan],
        "experience.failures": [-1],
        "experience.goal": [-13.0],
        "experience.failed": [math.inf],
        "experience.share": [1.5],
        "experience.far_at": [math.nan],
        "experience.most_bits": [math.nan, -1.0],
        "experience.blocked": [-1],
    },
}
CASES = [
    (kind, place, value)
    for kind, places in SPOILED.items()
    for place, values in places.items()
    for value in values
]


@functools.cache
def saved(kind):
    """Two missions, of which every number is one that missions hold, and others that are to become them."""
    missions, others = walked(kind, 12), walked(kind, 5, 8)
    return snapshot(missions), others, copy.deepcopy(everything(others))


@pytest.mark.parametrize(("kind", "place", "value"), CASES)
def test_a_number_that_no_mission_holds_is_refused_by_name(kind, place, value):
    whole, others, before = saved(kind)
    arrays, (name, _, field) = copy.deepcopy(whole), place.partition(".")
    array = arrays[name][field] if field else arrays[name]
    if name == "in_flight":
        arrays[name]["due_s"][1, 0] = arrays["missions"]["time_s"][1]
        array[1, 0] = value
    else:
        array[(-1,) * (array.ndim - np.ndim(value))] = value
    with pytest.raises(RecordError) as raised:
        restore(others, arrays)
    assert raised.value.field.startswith(place)
    assert everything(others) == before


def test_starts_and_worlds_that_cannot_be_are_refused_and_change_nothing():
    arrays, missions, before = saved(LATE)
    for name, value in (
        ("starts_1", np.full((2, 5), math.nan)),
        ("starts_1", np.full((2, 5), 1e9)),
        ("world_number_1", np.array(-1)),
        ("world_number_1", np.array(2**62)),
        ("world_1", np.zeros(100, np.uint8)),
        ("world_1", np.zeros(0, np.uint8)),
        ("seeds", np.array(["1", "9" * 5000])),
        ("seeds", np.array(["1", "-2"])),
        ("seeds", np.array(["1", "2", "3"])),
        ("mean", arrays["mean"][:, :1]),
        ("mean", arrays["mean"].astype(np.float64)),
        ("mean", None),
    ):
        with pytest.raises(EntropyExploreError, match="expected"):
            restore(missions, {**arrays, name: value})
        assert everything(missions) == before


def test_a_pickle_with_such_a_number_is_refused_too():
    missions = walked(LATE, 12)
    again = pickle.loads(pickle.dumps(missions))
    assert everything(again)[0] == everything(missions)[0]
    missions.state.robots["corners"][1, 0] = 10**8
    with pytest.raises(RecordError) as raised:
        pickle.loads(pickle.dumps(missions))
    assert (raised.value.field, raised.value.value) == ("robots.corners[1, 0]", 10**8)
    never = pickle.loads(pickle.dumps(Missions(missions.scenario, 2)))
    assert never.episodes == [-1, -1]


def test_bytes_that_are_no_booleans_are_refused():
    arrays, missions, _ = saved(LATE)
    arrays = copy.deepcopy(arrays)
    arrays["in_flight_to"].view(np.uint8)[0, 0, 0] = 7
    with pytest.raises(RecordError, match=r"in_flight_to\[0, 0, 0\] = 7"):
        check_ranges(missions.scenario, arrays)


def test_a_summary_under_way_that_is_not_whole_is_refused():
    missions = walked("summaries", 30)
    arrays = snapshot(missions)
    mission, slot = np.argwhere(arrays["in_flight_parcels"]["bytes"] > 0)[0]
    place = arrays["in_flight_parcels"][mission, slot]["place"]
    check_ranges(missions.scenario, arrays)
    arrays["in_flight_summaries"][mission, place, 6] ^= 4
    with pytest.raises(RecordError, match=rf"in_flight_summaries\[{mission}, {place}\]"):
        check_ranges(missions.scenario, arrays)


def test_free_places_of_landmarks_hold_zeros_wherever_the_workspace_is():
    changes = {"robot": {"localization": {"xy_m_per_sqrt_m": 0.1}}, "fiducials": {"own_number": 3}}
    scenario = free_box(**changes)
    grid = dataclasses.replace(scenario.grid, origin_m=(-40.0, 30.0, 5.0))
    missions = started(dataclasses.replace(scenario, grid=grid))
    arrays = missions.state._asdict()
    check_ranges(missions.scenario, arrays)
    assert not arrays["landmarks"]["used"].any() and (arrays["landmarks"]["place"] == 0.0).all()


def test_a_landmark_that_was_chosen_at_the_edge_of_the_workspace_may_be_beyond_it_by_rounding():
    arrays, missions, _ = saved(ALL)
    arrays, low = copy.deepcopy(arrays), missions.grid.origin_m[0]
    arrays["landmarks"]["seen_from"][0, 1, 2, 0] = low - 1e-12
    check_ranges(missions.scenario, arrays)
    arrays["landmarks"]["seen_from"][0, 1, 2, 0] = low - 1e-3
    with pytest.raises(RecordError, match=r"landmarks\.seen_from"):
        check_ranges(missions.scenario, arrays)
