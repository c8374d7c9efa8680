"""The state of many missions: NumPy arrays with leading axes mission E and robot A.

What belongs to one mission, robot, pair of robots or message lies in the fields of structured
arrays, so `state.robots["entropy_bits"]` is (E, A). Nothing else is carried from step to step:
pickle, deepcopy and replay follow from the arrays. Map frame, metres, radians, seconds, bits; a pose
or viewpoint is (x, y, z, yaw, pitch).
"""

from __future__ import annotations

import enum
from typing import Any, NamedTuple

import numpy as np

from entropy_explore_env.belief.pooling import Cells
from entropy_explore_env.compilation.kernels import record_type
from entropy_explore_env.missions.rules import POINT, collision_bodies
from entropy_explore_env.planner.records import CANDIDATE, EXPERIENCE
from entropy_explore_env.robots.landmarks import LANDMARK
from entropy_explore_env.robots.localization import COVARIANCE_NUMBERS, ESTIMATE
from entropy_explore_env.robots.map_summary import PARCEL, SUMMARY, summary_bytes
from entropy_explore_env.settings.scenario import Scenario


class MissionEnd(enum.Enum):
    """Why a mission is over; the value is a sentence for people."""

    RUNNING = "The mission goes on."
    MAPPED = "The entropy of the map, or of all maps, fell to the threshold."
    TIME_UP = "The simulated time reached its limit."
    CYCLES_UP = "The number of steps reached its limit."
    SEEN = "The team has seen as much of the world as the mission asks for."
    STOPPED = "All robots have stopped for good."
    EXHAUSTED = "All that robots can drive up to is known to each, and scans long showed nothing new beyond."

    @property
    def code(self) -> int:
        """Number of this end in arrays."""
        return list(MissionEnd).index(self)

    @property
    def reached_goal(self) -> bool:
        """Whether the mission came to what it asks for: then it is terminated. Others are truncated."""
        return self in (MissionEnd.MAPPED, MissionEnd.SEEN)


def goals_reached(ends: np.ndarray) -> np.ndarray:
    """Which of some missions came to what they ask for, bool, from the codes of their ends."""
    return (ends == MissionEnd.MAPPED.code) | (ends == MissionEnd.SEEN.code)


MISSION = record_type(
    [
        ("entropy_start_bits", "f8"),  # H(0), Rocha04 eq. 25
        ("entropy_end_bits", "f8"),  # H_th, the threshold that ends the mission
        ("time_s", "f8"),
        ("cycles", "i8"),  # steps so far
        ("end", "i8"),  # code of a MissionEnd
        ("enqueued", "i8"),  # delayed messages sent so far
        ("reached_s", "f8", (4,)),  # when the best map had lost each of PROGRESS; -1 = not yet
        # of the joint map, where the truth is tracked
        ("joint_bits", "f8"),  # its entropy
        ("explored", "i8"),  # voxels measured at all
        ("explored_visible", "i8"),  # of those that can be seen from where robots can be
        ("error", "f8"),  # sum of |expected - true coverage| over explored voxels
        ("wrong", "i8"),  # explored voxels on the wrong side of ½
        ("visible", "i8"),  # voxels that can be seen from where robots can be
        ("visible_free", "i8"),  # of those that are free
        ("explored_free", "i8"),  # of those that were measured
        ("seen_s", "f8", (5,)),  # when the share of SEEN_MARKS of what is visible was explored; -1 = not yet
        ("seen_m", "f8", (5,)),  # what the team had driven then; -1 likewise
        ("explored_end", "i8"),  # so many explored visible voxels end the mission, if so it ends,
        ("explored_free_end", "i8"),  # and so many free ones
        # since a scan showed something new, or since it was asked what is left:
        ("idle_scans", "i8"),  # the team's scans
        ("idle_from_m", "f8"),  # what the team had driven then
    ],
)

PROGRESS = (0.5, 0.9, 0.99, 1.0)
"""Shares of the bits that the mission asks for, at which the time is taken."""

SEEN_MARKS = (0.5, 0.9, 0.95, 0.99, 1.0)
"""Shares of what can be seen, at which time and driven path are taken where the truth is tracked."""

WAYPOINTS = 32
"""Most points that a planned path leads to, one after the other."""

ROBOT = record_type(
    [
        ("entropy_bits", "f8"),  # of its map, carried by H -= I (Rocha04, eq. 29)
        ("deciding", "?"),  # whether it chooses a viewpoint in the next step
        ("under_way", "?"),  # whether it does so while it drives on
        ("path_blocked", "?"),  # whether a scan under way showed that the rest of its path is blocked
        ("waiting", "?"),  # whether it stands still, or stood still until it decides, since a blocked drive
        ("origin", "f8", (5,)),  # pose at which the latest drive began
        ("goal", "f8", (5,)),  # pose at which it ends, or ended
        ("target", "f8", (5,)),  # viewpoint that was chosen, whether or not the drive ends there
        ("scan_pose", "f8", (5,)),  # pose of the latest scan
        ("path", "f8", (WAYPOINTS, 3)),  # points to which it meant to drive straight, one after the other
        ("waypoints", "i8"),  # how many there are; 0 = straight to the target
        ("path_end", "i8"),  # code of a MoveEnd: how a planned drive ends if nothing stops it
        ("corners", "i8"),  # how many of the points the drive passes before its goal
        ("path_m", "f8"),  # length of the drive
        ("depart_s", "f8"),  # start of the drive
        ("lead_s", "f8"),  # of its SpeedProfile
        ("scan_lead_m", "f8"),  # metres from its latest scan to the start of the drive
        ("decided_s", "f8"),  # when it decided last, whether or not that changed the drive
        ("redecide_s", "f8"),  # when it decides under way, or when it could since; inf = not before it stops
        ("next_scan_s", "f8"),  # when it scans next: under way, or at `ready_s`
        ("scans_under_way", "i8"),  # that it took in this drive
        ("ready_s", "f8"),  # end of the scan after it; of the wait, while it is waiting
        ("move_end", "i8"),  # code of a MoveEnd of the latest drive
        ("depth_m", "f8"),  # r̂ of the latest scan (RochaMI, eq. 4)
        ("half_angle_rad", "f8"),  # α̂ of it
        ("i_min_bits", "f8"),  # least utility that it sent of its latest scan
        ("next_i_min_bits", "f8"),  # that it will send of its next one
        ("own_bits", "f8"),  # taken from its map by its own scans in the latest step
        ("received_bits", "f8"),  # taken from its map by teammates' measurements in the latest step
        ("reward", "f8"),  # of the latest step
        ("sensor_rng", "u8", (1,)),  # random state of range noise
        ("channel_rng", "u8", (1,)),  # random state of message loss
        # counted from the mission's start
        ("distance_m", "f8"),
        ("scans", "i8"),
        ("measurements", "i8"),
        ("redundant", "i8"),  # measurements that brought less than its I_min to its own map
        ("gained_bits", "f8"),  # taken from its map by its own scans
        ("heard_bits", "f8"),  # taken from its map by teammates' measurements
        ("blocked_moves", "i8"),
        ("messages_sent", "i8"),
        ("measurements_sent", "i8"),
        ("bits_sent", "i8"),
        ("messages_received", "i8"),
        ("measurements_received", "i8"),
        ("bits_received", "i8"),
        ("messages_lost", "i8"),  # per teammate that a message did not reach by chance
        ("messages_out_of_range", "i8"),  # per teammate that was too far away for a message
    ],
)

FAULT = record_type(
    [
        # when each outage begins and ends; inf = never
        ("stop_s", "f8"),
        ("stop_until_s", "f8"),
        ("blind_s", "f8"),
        ("blind_until_s", "f8"),
        ("silent_s", "f8"),
        ("silent_until_s", "f8"),
        ("stopped", "?"),  # whether it has stopped, whether or not it works again
        ("sensor_rng", "u8", (1,)),  # random state of lost rays
        ("radio_rng", "u8", (1,)),  # random state of messages that go wrong
        # counted from the mission's start
        ("blind_scans", "i8"),
        ("rays_lost", "i8"),
        ("messages_silenced", "i8"),  # per teammate that a silent radio did not reach, and those not heard
        ("messages_garbled", "i8"),  # that arrived so
        ("messages_repeated", "i8"),  # that arrived twice
        ("messages_late", "i8"),  # that were sent late
    ],
)

COUNTED = ROBOT.names[ROBOT.names.index("distance_m") :] if ROBOT.names else ()
"""Fields of ROBOT that count from the mission's start."""

HEARD = record_type(
    [
        ("heard_s", "f8"),  # when the last message that arrived was sent; -1 = none did
        ("pose", "f8", (5,)),  # where its sender was
        ("announced_s", "f8"),  # when the last announcement that arrived was sent; -1 = none did
        ("announced", "f8", (7,)),  # its viewpoint, r̂ and α̂
    ],
)

MESSAGE = record_type(
    [
        ("due_s", "f8"),  # when it arrives; inf = a free slot
        ("sent_s", "f8"),
        ("serial", "i8"),  # order of sending
        ("sender", "i8"),
        ("count", "i8"),  # measurements in it; -1 = an announcement
        ("pose", "f8", (5,)),  # where the sender was
        ("announced", "f8", (7,)),
    ],
)

PHASES = record_type(
    [
        ("broadcasts", "i8"),  # how often the robots have broadcast
        ("collecting", "i8"),  # the buffer, 0 or 1, that takes in new batches; the other one is broadcast
    ],
)

BATCH = record_type(
    [
        ("pose", "f8", (5,)),  # where the scan was taken
        ("count", "i8"),  # measurements of it
    ],
)


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
    """(E, Q, A) bool: who will hear them."""
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


class InFlight(NamedTuple):
    """The delayed messages of one mission: slices of MissionState."""

    messages: np.ndarray
    """(Q,) MESSAGE."""
    recipients: np.ndarray
    """(Q, A) bool."""
    rays: np.ndarray
    """(Q, B, 5) float64."""
    covariances: np.ndarray
    """(Q, 10) float64."""


class PhaseBuffers(NamedTuple):
    """The buffers of one mission's broadcast in phases: slices of MissionState."""

    counts: np.ndarray
    """(A, 2) int64."""
    batches: np.ndarray
    """(A, 2, S) BATCH."""
    rays: np.ndarray
    """(A, 2, S, B, 5) float64."""
    heard: np.ndarray
    """(A, A) int8."""
    covariances: np.ndarray
    """(A, 2, S, 10) float64."""


def state_arrays(
    scenario: Scenario, missions: int, cells: int
) -> dict[str, tuple[tuple[int, ...], np.dtype[Any]]]:
    """Shape and type of each array of a MissionState.

    Args:
        scenario: The task.
        missions: E.
        cells: C, of the overview.
    """
    e, a, r = missions, scenario.robots, max(kind.sensor.rays for kind in scenario.kinds)
    v, q, b = scenario.grid.voxels, scenario.message_slots, scenario.batch_measurements
    s, tracked = scenario.phase_batches, scenario.grid.voxels if scenario.track_truth else 0
    proposed = a if scenario.action.kind == "candidates" else 0
    bodies, in_phases = collision_bodies(scenario), a if scenario.phase_batches else 0
    drifting, numbers = scenario.drifts, COVARIANCE_NUMBERS
    sharing, places = a if scenario.shares_summaries else 0, a * scenario.summary_slots
    arrays: dict[str, tuple[tuple[int, ...], Any]] = {
        "truth": ((e, v), np.float32),
        "collision": ((0 if bodies == [POINT] else e * len(bodies), v), np.float32),
        "mean": ((e, a, v), np.float32),
        "precision": ((e, a, v), np.float32),
        "pooled": ((e, a, 2, cells), np.float64),
        "joint_mean": ((e, tracked), np.float32),
        "joint_precision": ((e, tracked), np.float32),
        "visible": ((e, tracked), np.bool_),
        "drivable": ((e, v if scenario.ending.by_seen else 0), np.bool_),
        "missions": ((e,), MISSION),
        "robots": ((e, a), ROBOT),
        "heard": ((e, a, a), HEARD),
        "scan_range_m": ((e, a, r), np.float64),
        "scan_returned": ((e, a, r), np.int8),
        "scan_utility_bits": ((e, a, r), np.float64),
        "in_flight": ((e, q), MESSAGE),
        "in_flight_to": ((e, q, a), np.bool_),
        "in_flight_rays": ((e, q, b if q else 0, 5), np.float64),
        "phases": ((e,), PHASES),
        "phase_counts": ((e, in_phases, 2), np.int64),
        "phase_batches": ((e, in_phases, 2, s), BATCH),
        "phase_rays": ((e, in_phases, 2, s, b, 5), np.float64),
        "phase_heard": ((e, in_phases, a), np.int8),
        "faults": ((e, a if scenario.faults.happen else 0), FAULT),
        "candidates": ((e, proposed, scenario.action.candidates if proposed else 0), CANDIDATE),
        "experience": ((e, proposed), EXPERIENCE),
        "estimates": ((e, a if drifting else 0), ESTIMATE),
        "fiducials": ((e, scenario.fiducials.count if drifting else 0, 3), np.float64),
        "landmarks": ((e, a if drifting else 0, scenario.fiducials.own_number), LANDMARK),
        "in_flight_covariances": ((e, q if drifting else 0, numbers), np.float64),
        "phase_covariances": ((e, in_phases if drifting else 0, 2, s, numbers), np.float64),
        "own_mean": ((e, sharing, v), np.float32),
        "own_precision": ((e, sharing, v), np.float32),
        "summaries": ((e, sharing), SUMMARY),
        "in_flight_parcels": ((e, q if sharing else 0), PARCEL),
        "in_flight_summaries": ((e, places, summary_bytes(v) if places else 0), np.uint8),
    }
    return {name: (shape, np.dtype(kind)) for name, (shape, kind) in arrays.items()}


def new_state(scenario: Scenario, missions: int, cells: Cells) -> MissionState:
    """Arrays for E missions of a scenario, not yet reset; beliefs are pooled to the cells."""
    wanted = state_arrays(scenario, missions, len(cells.voxels))
    arrays = {name: np.zeros(shape, kind) for name, (shape, kind) in wanted.items()}
    if not arrays["collision"].size:
        arrays["collision"] = arrays["truth"]
    return MissionState(**arrays)
