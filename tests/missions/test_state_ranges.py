"""Saved states with numbers that no mission can hold: refused by name, and nothing changes."""

from __future__ import annotations

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
from entropy_explore_env.reports.state_digest import state_digest
from tests.missions.kinds import walked
from tests.reference.scenes import free_box, started

LATE, ALL = "late messages", "everything at once"
SPOILED = [
    (LATE, "robots.corners", 10**8),
    (LATE, "robots.corners", 1),  # of a straight drive
    (LATE, "robots.waypoints", 33),
    (LATE, "robots.waypoints", -1),
    (LATE, "robots.goal", math.nan),
    (LATE, "robots.origin", 1e9),
    (LATE, "robots.scan_pose", -math.inf),
    (LATE, "robots.target", 1e4),
    (LATE, "robots.path", math.nan),
    (LATE, "robots.move_end", 99),
    (LATE, "robots.path_end", -1),
    (LATE, "robots.ready_s", math.inf),
    (LATE, "robots.next_scan_s", math.nan),
    (LATE, "robots.redecide_s", math.nan),
    (LATE, "robots.depart_s", 1e6),
    (LATE, "robots.messages_received", -(2**62)),
    (LATE, "robots.entropy_bits", math.nan),
    (LATE, "robots.half_angle_rad", 4.0),
    (LATE, "missions.time_s", -1.0),
    (LATE, "missions.time_s", 10_001.0),
    (LATE, "missions.end", 99),
    (LATE, "missions.seen_s", -2.0),
    (LATE, "missions.seen_m", math.nan),
    (LATE, "missions.explored_end", -1),
    (LATE, "missions.explored_free_end", 10**9),
    (LATE, "missions.cycles", -1),
    (LATE, "missions.explored", 386),
    (LATE, "heard.announced_s", math.nan),
    (LATE, "heard.pose", 1e9),
    (LATE, "in_flight.count", 9),
    (LATE, "in_flight.count", -2),
    (LATE, "in_flight.sender", 2),
    (LATE, "in_flight.due_s", -math.inf),
    (LATE, "in_flight.serial", 2**62),
    (LATE, "in_flight_rays", math.nan),
    (LATE, "in_flight_rays", 1e9),
    (LATE, "mean", math.nan),
    (LATE, "mean", 1.1),
    (LATE, "precision", 0.0),
    (LATE, "precision", math.inf),
    (LATE, "pooled", math.nan),
    (LATE, "joint_precision", -1.0),
    (LATE, "scan_returned", 3),
    (LATE, "scan_range_m", math.nan),
    (LATE, "scan_utility_bits", -2.0),
    (LATE, "observations", math.nan),
    (LATE, "episodes", -1),
    ("need", "backlog_poses", 1e9),
    ("need", "backlog_rays", math.nan),
    ("need", "backlog_bits", -2.0),
    ("need", "backlog_sent_s", 1e9),
    ("need", "backlog_heard_s", -1.0),
    ("phases", "phases.broadcasts", -1),
    ("phases", "phases.collecting", 2),
    ("phases", "phase_counts", 1000),
    ("phases", "phase_heard", 4),
    ("phases", "phase_batches.count", 9),
    ("phases", "phase_rays", math.inf),
    ("summaries", "summaries.sent_s", 1e9),
    ("summaries", "summaries.sent", -1),
    ("summaries", "summaries.low", -1),
    ("summaries", "summaries.high", 12),
    ("summaries", "in_flight_parcels.place", 1000),
    ("summaries", "in_flight_parcels.bytes", 10**8),
    ("summaries", "in_flight_parcels.bytes", -1),
    ("summaries", "own_mean", math.nan),
    ("summaries", "own_precision", -1.0),
    ("drift", "estimates.place", math.nan),
    ("drift", "estimates.place", -3.0),
    ("drift", "estimates.error", 1e9),
    ("drift", "estimates.covariance", math.inf),
    ("drift", "estimates.covariance", -1.0),
    ("drift", "estimates.covariance", np.diag([1.0, 1.0, 1.0], 1)),
    ("drift", "estimates.covariance", np.eye(4) + 3.0 * np.diag([1.0, 0.0, 0.0], 1)),
    ("drift", "estimates.covariance", 2.0 * np.ones((4, 4)) - np.eye(4)),
    ("drift", "estimates.packed", 1e99),
    ("drift", "estimates.scan_pose", 1e3),
    ("drift", "estimates.yaw", 50.0),
    ("drift", "estimates.driven_m", -5.0),
    ("drift", "estimates.sightings", -1),
    ("drift", "estimates.squared_m2", -1.0),
    (ALL, "landmarks.score", 2.5),
    (ALL, "landmarks.sightings", -1),
    (ALL, "landmarks.place", 99.0),
    (ALL, "landmarks.seen_from", math.nan),
    (ALL, "landmarks.covariance", math.inf),
    ("faults", "faults.stop_s", math.nan),
    ("faults", "faults.stop_until_s", -1.0),
    ("faults", "faults.blind_s", -1.0),
    ("faults", "faults.rays_lost", -1),
    ("faults", "faults.messages_late", 2**60),
    ("candidates", "candidates.viewpoint", 1e9),
    ("candidates", "candidates.goal", math.nan),
    ("candidates", "candidates.goal", 13.0),
    ("candidates", "candidates.kind", 4),
    ("candidates", "candidates.bits", -1.0),
    ("candidates", "experience.exponent", math.nan),
    ("candidates", "experience.exponent", -1.0),
    ("candidates", "experience.decided_s", -1.0),
    ("candidates", "experience.decided_s", math.inf),
    ("candidates", "experience.decided_bits", math.nan),
    ("candidates", "experience.failures", -1),
    ("candidates", "experience.goal", -13.0),
    ("candidates", "experience.failed", math.inf),
    ("candidates", "experience.share", 1.5),
    ("candidates", "experience.far_at", math.nan),
    ("candidates", "experience.most_bits", math.nan),
    ("candidates", "experience.most_bits", -1.0),
    ("candidates", "experience.blocked", -1),
]


def everything(missions):
    digests = [state_digest(missions, mission) for mission in range(2)]
    return digests, missions.seeds, missions.episodes, missions.observations.tobytes()


@functools.cache
def saved(kind):
    """Two missions, of which every number is one that missions hold, and others that are to become them."""
    missions, others = walked(kind, 12), walked(kind, 5, 8)
    return snapshot(missions), others, copy.deepcopy(everything(others))


@pytest.mark.parametrize(("kind", "place", "value"), SPOILED)
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
