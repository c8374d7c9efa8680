"""Saved states with numbers that no mission can hold: refused by name, and nothing changes."""

import copy
import dataclasses
import functools
import math
import pickle

import numpy as np
import pytest

from entropy_explore_env.errors import EntropyExploreError, RecordError
from entropy_explore_env.missions.faults import OUTAGES
from entropy_explore_env.missions.simulation import Missions
from entropy_explore_env.missions.snapshot import restore, snapshot
from entropy_explore_env.missions.state import FROM_WORLD, state_arrays
from entropy_explore_env.missions.state_ranges import check_ranges
from tests.missions.kinds import KINDS, everything, walked
from tests.reference.scenes import free_box, started

LATE, ALL = "late messages", "everything at once"
SPOILED = {
    LATE: {
        "robots.corners": [1],  # one corner is that of no straight drive
        "robots.waypoints": [33],
        "robots.origin": [1e9],
        "robots.target": [1e4],
        "robots.move_end": [99],
        "robots.ready_s": [math.inf],
        "robots.depart_s": [1e6],
        "robots.departed_m": [-1.0],
        "robots.half_angle_rad": [4.0],
        "missions.time_s": [-1.0, 10_001.0],
        "missions.end": [99],
        "missions.seen_s": [-2.0],
        "missions.explored_free_end": [10**9],
        "missions.explored": [386],
        "heard.pose": [1e9],
        "in_flight.count": [9, -2],
        "in_flight.sender": [2],
        "in_flight_rays": [1e9],
        "mean": [1.1],
        "precision": [0.0],
        "scan_returned": [3],
        "scan_utility_bits": [-2.0],
        "observations": [math.nan],
        "episodes": [-1],
    },
    "need": {"backlog_poses": [1e9], "backlog_bits": [-2.0], "backlog_sent_s": [1e9]},
    "phases": {
        "phases.collecting": [2],
        "phase_counts": [1000],
        "phase_heard": [4],
        "phase_batches.count": [9],
    },
    "summaries": {
        "summaries.sent_s": [1e9],
        "summaries.high": [12],
        "in_flight_parcels.place": [1000],
        "in_flight_parcels.bytes": [10**8, -1],
        "own_precision": [-1.0],
    },
    "drift": {
        "estimates.place": [-3.0],
        "estimates.error": [1e9],
        "estimates.covariance": [
            -1.0,
            np.diag([1.0, 1.0, 1.0], 1),
            np.eye(4) + 3.0 * np.diag([1.0, 0.0, 0.0], 1),
            2.0 * np.ones((4, 4)) - np.eye(4),
        ],
        "estimates.scan_pose": [1e3],
        "estimates.yaw": [50.0],
        "estimates.driven_m": [-5.0],
    },
    ALL: {"landmarks.score": [2.5], "landmarks.place": [99.0]},
    "faults": {"faults.stop_until_s": [-1.0]},
    "candidates": {
        "candidates.goal": [13.0],
        "candidates.kind": [4],
        "candidates.bits": [-1.0],
        "experience.exponent": [-1.0],
        "experience.goal": [-13.0],
        "experience.share": [1.5],
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


ENDLESS = {
    "in_flight.due_s",
    "robots.redecide_s",
    *("robots.ready_s", "robots.next_scan_s"),  # of robots that stop for good
    *(f"faults.{name}{end}_s" for name in OUTAGES for end in ("", "_until")),
}
"""Fields that may be infinite: what never happens."""


def extremes_of(kind, endless):
    if kind.kind == "f":
        return (math.nan, -math.inf) if endless else (math.nan, -math.inf, math.inf)
    about = np.iinfo(kind)
    return (about.max,) if about.min == 0 else (about.min, about.max)


@pytest.mark.parametrize("kind", KINDS)
def test_no_field_takes_what_is_no_number_or_beyond_all_ranges(kind):
    missions = walked(kind, 12)
    arrays, checked = missions.state._asdict(), 0
    for name, declared in state_arrays(missions.scenario, 0, 0).items():
        if name in FROM_WORLD or (declared.values is None and not declared.dtype.names):
            continue
        for field in declared.dtype.names or ("",):
            array = copy.deepcopy(arrays[name])
            numbers = array[field] if field else array
            if not numbers.size or numbers.dtype in (bool, np.uint64):  # any number is a generator's state
                continue
            for value in extremes_of(numbers.dtype, f"{name}.{field}" in ENDLESS):
                numbers[(-1,) * numbers.ndim] = value
                with pytest.raises(RecordError) as raised:
                    check_ranges(missions.scenario, {**arrays, name: array})
                assert raised.value.field.startswith(f"{name}.{field}" if field else name)
                checked += 1
    assert checked > 100


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
