"""The state of many missions: NumPy arrays with leading axes mission E and robot A.

What belongs to one mission, robot, pair of robots or message lies in the fields of structured
arrays, so `state.robots["entropy_bits"]` is (E, A). Kernels carry nothing else from step to step:
pickle, deepcopy and replay follow from the arrays. Map frame, metres, radians, seconds, bits; a pose
or viewpoint is (x, y, z, yaw, pitch).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from entropy_explore_env.belief.pooling import Cells
from entropy_explore_env.missions.records import BATCH, FAULT, HEARD, MESSAGE, MISSION, PHASES, ROBOT
from entropy_explore_env.missions.rules import POINT, collision_bodies
from entropy_explore_env.planner.records import CANDIDATE, EXPERIENCE
from entropy_explore_env.robots.landmarks import LANDMARK
from entropy_explore_env.robots.localization import COVARIANCE_NUMBERS, ESTIMATE
from entropy_explore_env.robots.map_summary import PARCEL, SUMMARY, summary_bytes
from entropy_explore_env.robots.range_sensor import Return
from entropy_explore_env.robots.ranges import (
    FAR_POSE,
    FLAG,
    LARGEST_PRECISION,
    MOST,
    PAST,
    PLACE,
    SHARE,
    SIGNED,
    SPREAD,
    Values,
)
from entropy_explore_env.settings.scenario import Scenario

FROM_WORLD = ("truth", "collision", "visible", "drivable")
"""Arrays that follow from a mission's world, which its seed and what was given determine."""


class MissionState(NamedTuple):
    """Everything about E missions of A robots; V voxels, R rays of a scan, Q slots for messages."""

    truth: np.ndarray
    """(E, V) float32 true coverage, 0 or 1."""
    collision: np.ndarray
    """(E·N, V) float32 collision masks, a Collision each, for the N bodies that need one, mission by
    mission; `truth` itself where all bodies are small and there is no ceiling."""
    mean: np.ndarray
    """(E, A, V) float32 expected coverage by each robot's belief."""
    precision: np.ndarray
    """(E, A, V) float32 1/σ² of coverage by each robot's belief."""
    pooled: np.ndarray
    """(E, A, 2, C) float64 sums over the cells of the overview: see belief/pooling.py."""
    joint_mean: np.ndarray
    """(E, V) float32, the mean of the joint map; (E, 0) where the truth is not tracked."""
    joint_precision: np.ndarray
    """(E, V) float32, its 1/σ²."""
    visible: np.ndarray
    """(E, V) bool, what can be seen from where robots can be."""
    drivable: np.ndarray
    """(E, V) bool, of that what a robot can drive up to; (E, 0) where missions end by entropy."""
    missions: np.ndarray
    """(E,) MISSION."""
    robots: np.ndarray
    """(E, A) ROBOT."""
    heard: np.ndarray
    """(E, A, A) HEARD: what robot a heard from b."""
    scan_range_m: np.ndarray
    """(E, A, R) float64 distances of the latest scan; 0 where nothing was measured."""
    scan_returned: np.ndarray
    """(E, A, R) int8, a Return each."""
    scan_utility_bits: np.ndarray
    """(E, A, R) float64 utility of each ray of the latest scan."""
    in_flight: np.ndarray
    """(E, Q) MESSAGE: delayed messages that have not arrived."""
    in_flight_to: np.ndarray
    """(E, Q, A) bool: which robots will hear them."""
    in_flight_rays: np.ndarray
    """(E, Q, B, 5) float64: direction (3), distance in grid units, Return."""
    phases: np.ndarray
    """(E,) PHASES."""
    phase_counts: np.ndarray
    """(E, A, 2) int64, batches in each of a robot's two buffers; empty, like all that follows, where batches
    are sent at once."""
    phase_batches: np.ndarray
    """(E, A, 2, S) BATCH."""
    phase_rays: np.ndarray
    """(E, A, 2, S, B, 5) float64, as in `in_flight_rays`."""
    phase_heard: np.ndarray
    """(E, A, A) int8: whether b has what a broadcasts; see `missions/phases.py`."""
    faults: np.ndarray
    """(E, A) FAULT; (E, 0) where nothing goes wrong."""
    candidates: np.ndarray
    """(E, A, K) CANDIDATE, those proposed when a robot decided last; (E, 0, 0) where actions are others, as
    the next."""
    experience: np.ndarray
    """(E, A) EXPERIENCE, what a robot remembers for its candidates."""
    estimates: np.ndarray
    """(E, A) ESTIMATE; (E, 0), and the next four empty, where all robots know where they are."""
    fiducials: np.ndarray
    """(E, F, 3) float64, their places in the world."""
    landmarks: np.ndarray
    """(E, A, L) LANDMARK, those of robots' own maps."""
    in_flight_covariances: np.ndarray
    """(E, Q, 10) float64, of their senders' poses: see `robots.localization.pack_covariance`."""
    phase_covariances: np.ndarray
    """(E, A, 2, S, 10) float64, likewise."""
    own_mean: np.ndarray
    """(E, A, V) float32 expected coverage by what a robot measured itself since its latest summary; empty,
    like all that follow, where robots send no summaries."""
    own_precision: np.ndarray
    """(E, A, V) float32 its 1/σ²; 0 = not measured since then."""
    summaries: np.ndarray
    """(E, A) SUMMARY."""
    in_flight_parcels: np.ndarray
    """(E, Q) PARCEL, of each delayed message."""
    in_flight_summaries: np.ndarray
    """(E, A·K, M) uint8, summaries under way: K places of a robot, as `robots.map_summary` writes them."""
    backlog_poses: np.ndarray
    """(E, A, S, 5) float64, where the robots took their latest S scans, as they believe; empty, like all that
    follow, where they do not send by need. A robot's nth scan is kept in place n mod S."""
    backlog_rays: np.ndarray
    """(E, A, S, R, 5) float64, as in `in_flight_rays`."""
    backlog_bits: np.ndarray
    """(E, A, S, R) float64, utility of each ray; -1 where nothing was measured."""
    backlog_sent_s: np.ndarray
    """(E, A, S, R) float64, when each measurement was sent last; 0 = never."""
    backlog_heard_s: np.ndarray
    """(E, A, S, R, A) float64, when each robot heard each measurement first; 0 = never."""
    backlog_covariances: np.ndarray
    """(E, A, S, 10) float64, as in `in_flight_covariances`."""


class Beliefs(NamedTuple):
    """The beliefs of one mission's robots: slices of MissionState."""

    mean: np.ndarray
    """(A, V) float32."""
    precision: np.ndarray
    """(A, V) float32."""
    pooled: np.ndarray
    """(A, 2, C) float64."""


class JointMap(NamedTuple):
    """The joint map of one mission and what it is compared with: slices of MissionState."""

    mean: np.ndarray
    """(V,) float32."""
    precision: np.ndarray
    """(V,) float32."""
    visible: np.ndarray
    """(V,) bool."""
    drivable: np.ndarray
    """(V,) bool, or (0,)."""


class LatestScans(NamedTuple):
    """The latest scans of one mission's robots: slices of MissionState."""

    range_m: np.ndarray
    """(A, R) float64."""
    returned: np.ndarray
    """(A, R) int8."""
    utility_bits: np.ndarray
    """(A, R) float64."""


class StateArray(NamedTuple):
    """What an array of the state is like."""

    shape: tuple[int, ...]
    dtype: np.dtype[Any]
    values: Values | None = None
    """Its range; None where it follows from the world, is of a structured type, or means more than that."""


def state_arrays(scenario: Scenario, missions: int, cells: int) -> dict[str, StateArray]:
    """Return shape, type and range of each array of a MissionState.

    Args:
        cells: C, of the overview.
    """
    e, a, r = missions, scenario.robots, max(kind.sensor.rays for kind in scenario.kinds)
    v, q, b = scenario.grid.voxels, scenario.message_slots, scenario.batch_measurements
    s, tracked = scenario.phase_batches, scenario.grid.voxels if scenario.track_truth else 0
    proposed = a if scenario.action.kind == "candidates" else 0
    bodies, in_phases = collision_bodies(scenario), a if scenario.phase_batches else 0
    drifting, numbers = scenario.drifts, COVARIANCE_NUMBERS
    needing, kept = a if scenario.backlog_scans else 0, scenario.backlog_scans
    sharing, places = a if scenario.shares_summaries else 0, a * scenario.summary_slots
    arrays: dict[str, tuple[Any, ...]] = {
        "truth": ((e, v), np.float32),
        "collision": ((0 if bodies == [POINT] else e * len(bodies), v), np.float32),
        "mean": ((e, a, v), np.float32, SHARE),
        "precision": ((e, a, v), np.float32, Values("prior", LARGEST_PRECISION)),
        "pooled": ((e, a, 2, cells), np.float64, SIGNED),
        "joint_mean": ((e, tracked), np.float32, SHARE),
        "joint_precision": ((e, tracked), np.float32, Values("prior", LARGEST_PRECISION)),
        "visible": ((e, tracked), np.bool_),
        "drivable": ((e, v if scenario.ending.by_seen else 0), np.bool_),
        "missions": ((e,), MISSION),
        "robots": ((e, a), ROBOT),
        "heard": ((e, a, a), HEARD),
        "scan_range_m": ((e, a, r), np.float64, Values("shortest_m", "longest_m")),
        "scan_returned": ((e, a, r), np.int8, Values(min(Return), max(Return))),
        "scan_utility_bits": ((e, a, r), np.float64, Values(-1.0, MOST)),
        "in_flight": ((e, q), MESSAGE),
        "in_flight_to": ((e, q, a), np.bool_, FLAG),
        "in_flight_rays": ((e, q, b if q else 0, 5), np.float64),
        "phases": ((e,), PHASES),
        "phase_counts": ((e, in_phases, 2), np.int64, Values(0, "batches")),
        "phase_batches": ((e, in_phases, 2, s), BATCH),
        "phase_rays": ((e, in_phases, 2, s, b, 5), np.float64),
        "phase_heard": ((e, in_phases, a), np.int8, Values(0, 3)),
        "faults": ((e, a if scenario.faults.happen else 0), FAULT),
        "candidates": ((e, proposed, scenario.action.candidates if proposed else 0), CANDIDATE),
        "experience": ((e, proposed), EXPERIENCE),
        "estimates": ((e, a if drifting else 0), ESTIMATE),
        "fiducials": ((e, scenario.fiducials.count if drifting else 0, 3), np.float64, PLACE),
        "landmarks": ((e, a if drifting else 0, scenario.fiducials.own_number), LANDMARK),
        "in_flight_covariances": ((e, q if drifting else 0, numbers), np.float64, SPREAD),
        "phase_covariances": ((e, in_phases if drifting else 0, 2, s, numbers), np.float64, SPREAD),
        "own_mean": ((e, sharing, v), np.float32, SHARE),
        "own_precision": ((e, sharing, v), np.float32, Values(0.0, LARGEST_PRECISION)),
        "summaries": ((e, sharing), SUMMARY),
        "in_flight_parcels": ((e, q if sharing else 0), PARCEL),
        "in_flight_summaries": ((e, places, summary_bytes(v) if places else 0), np.uint8),
        "backlog_poses": ((e, needing, kept, 5), np.float64, FAR_POSE),
        "backlog_rays": ((e, needing, kept, r, 5), np.float64),
        "backlog_bits": ((e, needing, kept, r), np.float64, Values(-1.0, MOST)),
        "backlog_sent_s": ((e, needing, kept, r), np.float64, PAST),
        "backlog_heard_s": ((e, needing, kept, r, a), np.float64, PAST),
        "backlog_covariances": ((e, needing, kept if drifting else 0, numbers), np.float64, SPREAD),
    }
    return {
        name: StateArray(shape, np.dtype(kind), *values) for name, (shape, kind, *values) in arrays.items()
    }


def new_state(scenario: Scenario, missions: int, cells: Cells) -> MissionState:
    """Return arrays for E missions of a scenario, not yet reset; beliefs are pooled to the cells."""
    wanted = state_arrays(scenario, missions, len(cells.voxels))
    arrays = {name: np.zeros(each.shape, each.dtype) for name, each in wanted.items()}
    if not arrays["collision"].size:
        arrays["collision"] = arrays["truth"]
    return MissionState(**arrays)
