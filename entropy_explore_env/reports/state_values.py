"""The state of a mission value by value, and its digest: names and grouping in the code do not matter to it.

Records refer to values by the names of their format, which stay when arrays and fields of the code are
renamed or grouped anew; `_ARRAYS` and `_FIELDS_TODAY` say where each of them is found today.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np

from entropy_explore_env.missions.simulation import Missions
from entropy_explore_env.missions.state import MissionState

_ARRAYS: Mapping[str, Callable[[MissionState], np.ndarray]] = MappingProxyType(
    {
        "truth": lambda state: state.truth,
        "blocked": lambda state: state.collision,
        "mean": lambda state: state.mean,
        "precision": lambda state: state.precision,
        "pooled": lambda state: state.pooled,
        "joint_mean": lambda state: state.joint_mean,
        "joint_precision": lambda state: state.joint_precision,
        "visible": lambda state: state.visible,
        "missions": lambda state: state.missions,
        "robots": lambda state: state.robots,
        "heard": lambda state: state.heard,
        "scan_range_m": lambda state: state.scan_range_m,
        "scan_returned": lambda state: state.scan_returned,
        "scan_utility_bits": lambda state: state.scan_utility_bits,
        "mail": lambda state: state.in_flight,
        "mail_to": lambda state: state.in_flight_to,
        "mail_rays": lambda state: state.in_flight_rays,
        "phases": lambda state: state.phases,
        "phase_waiting": lambda state: state.phase_counts,
        "phase_batches": lambda state: state.phase_batches,
        "phase_rays": lambda state: state.phase_rays,
        "phase_heard": lambda state: state.phase_heard,
    }
)
"""Name in records → the array (E, ...) that holds it today."""

_FIELDS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "missions": tuple(
            "entropy_start_bits entropy_end_bits time_s cycles end letters reached_s "
            "joint_bits explored explored_visible error wrong".split()
        ),
        "robots": tuple(
            "entropy_bits deciding waiting origin goal target scan_pose way waypoints way_end corners way_m "
            "depart_s next_scan_s way_scans ready_s move_end depth_m half_angle_rad i_min_bits "
            "next_i_min_bits own_bits received_bits reward sensor_chance channel_chance "
            "distance_m scans measurements redundant gained_bits heard_bits blocked_moves "
            "messages_sent measurements_sent bits_sent messages_received measurements_received bits_received "
            "messages_lost messages_out_of_range".split()
        ),
        "heard": ("heard_s", "pose", "announced_s", "announced"),
        "mail": ("due_s", "sent_s", "serial", "sender", "count", "pose", "announced"),
        "phases": ("broadcasts", "collecting"),
        "phase_batches": ("pose", "count"),
    }
)
"""Name in records → the fields of this array, by their names in records, in the order of the digest."""

FIELDS_UNDER_WAY = "under_way path_blocked lead_s scan_lead_m decided_s redecide_s".split()
"""Further fields of `robots`, where some robot decides under way."""

FIELDS_SEEN = ("explored_free", "seen_s", "seen_m")
"""Further fields of `missions`, where a mission ends by what was seen."""

FIELDS_FAULTS = (
    "stop_s stop_until_s blind_s blind_until_s silent_s silent_until_s stopped sensor_rng radio_rng "
    "blind_scans rays_lost messages_silenced messages_garbled messages_repeated messages_late".split()
)
"""Fields of `faults`, where the scenario has any."""

FIELDS_LOCALIZATION = (
    "place yaw driven_m error covariance packed scan_pose drift_rng sighting_rng sightings "
    "squared_m2 squared_rad2".split()
)
"""Fields of `estimates`, where some robot drifts."""

FIELDS_LANDMARKS = "place believed seen_from covariance score sightings used".split()
"""Fields of `landmarks`, where robots choose some in their own maps."""

ARRAYS_LOCALIZATION = ("fiducials", "in_flight_covariances", "phase_covariances")
"""Further arrays there."""

FIELDS_SUMMARIES = ("sent_s", "sent", "low", "high")
"""Fields of `summaries`, where robots send summaries."""

FIELDS_PARCELS = ("place", "bytes")
"""Fields of `in_flight_parcels`, likewise."""

ARRAYS_SUMMARIES = ("own_mean", "own_precision", "in_flight_summaries")
"""Further arrays there."""

_FIELDS_TODAY: Mapping[str, str] = MappingProxyType(
    {
        "missions.letters": "enqueued",
        "robots.way": "path",
        "robots.way_end": "path_end",
        "robots.way_m": "path_m",
        "robots.way_scans": "scans_under_way",
        "robots.sensor_chance": "sensor_rng",
        "robots.channel_chance": "channel_rng",
    }
)
"""`array.field` in records → the field's name today, where it is another one."""

FIELDS_CANDIDATES = ("viewpoint", "goal", "bits", "kind")
"""Fields of `candidates`, where actions are candidates."""

FIELDS_EXPERIENCE = (
    "candidates_rng most_bits going goal far_value looked_far far_at patience blocked failures "
    "failed share forget_at".split()
)
"""Fields of `experience`, likewise; without those that follow from times and bits: `decided_s`,
`decided_bits`, `exponent`."""

FOLLOWS_FROM_WORLD = ("blocked", "visible")
"""Values that the true world and the scenario determine; the digest leaves them out."""


def state_values(missions: Missions, mission: int) -> dict[str, np.ndarray]:
    """All values of a mission's state, by their names in records (`array` or `array.field`).

    Records of every format version are verified by these values: whatever is done to the state, each
    keeps its name, its place in this order, its shape without the axis E, and its type. Nobody else
    reads the state by name for a file.

    Args:
        missions: Missions of which one is read.
        mission: Which one.

    Returns:
        Name → array, a view of the state, in the order of the digest. The phases of the broadcast, what an
        ending by what was seen needs, what decisions under way need, faults, candidates, localization and
        summaries are there only where they are used.
    """
    values: dict[str, np.ndarray] = {}
    for name, read in _ARRAYS.items():
        if name.startswith("phase") and missions.scenario.channel.phase_s == 0.0:
            continue
        array = read(missions.state)
        for field in _FIELDS.get(name, ()):
            today = _FIELDS_TODAY.get(f"{name}.{field}", field)
            values[f"{name}.{field}"] = array[today][mission, ...]
        if name not in _FIELDS:
            values[name] = array[mission]
        if name == "missions" and missions.scenario.ending.by_seen:
            values.update({f"missions.{field}": array[field][mission, ...] for field in FIELDS_SEEN})
        if name == "robots" and any(kind.robot.redecide != "at_stop" for kind in missions.scenario.kinds):
            values.update({f"robots.{field}": array[field][mission, ...] for field in FIELDS_UNDER_WAY})
    if missions.scenario.faults.happen:
        values.update(
            {f"faults.{field}": missions.state.faults[field][mission, ...] for field in FIELDS_FAULTS}
        )
    if missions.scenario.action.kind == "candidates":
        proposed, kept = missions.state.candidates, missions.state.experience
        values.update({f"candidates.{field}": proposed[field][mission, ...] for field in FIELDS_CANDIDATES})
        values.update({f"experience.{field}": kept[field][mission, ...] for field in FIELDS_EXPERIENCE})
    if missions.scenario.drifts:
        estimates = missions.state.estimates
        values.update({f"estimates.{field}": estimates[field][mission, ...] for field in FIELDS_LOCALIZATION})
        values.update({name: getattr(missions.state, name)[mission] for name in ARRAYS_LOCALIZATION})
        if missions.scenario.fiducials.own_number:
            chosen = missions.state.landmarks
            values.update({f"landmarks.{field}": chosen[field][mission, ...] for field in FIELDS_LANDMARKS})
    if missions.scenario.shares_summaries:
        kept, parcels = missions.state.summaries, missions.state.in_flight_parcels
        values.update({f"summaries.{field}": kept[field][mission, ...] for field in FIELDS_SUMMARIES})
        values.update({f"parcels.{field}": parcels[field][mission, ...] for field in FIELDS_PARCELS})
        values.update({name: getattr(missions.state, name)[mission] for name in ARRAYS_SUMMARIES})
    return values


def state_digest(missions: Missions, mission: int) -> str:
    """SHA-256 of a mission's values in the order of `state_values`, without their names and shapes.

    Of each value: its kind (b, i, u, f4, f8), the number of its entries, and their bytes, whole numbers as
    64-bit ones, least byte first. What follows from the world is left out.
    """
    digest = hashlib.sha256()
    for name, value in state_values(missions, mission).items():
        if name not in FOLLOWS_FROM_WORLD:
            digest.update(value_bytes(value))
    return digest.hexdigest()


def value_bytes(value: np.ndarray) -> bytes:
    """A value as the digest takes it: see `state_digest`."""
    kind = value.dtype.kind
    stored = {"b": "|b1", "i": "<i8", "u": "<u8", "f": f"<f{value.dtype.itemsize}"}[kind]
    said = kind + (str(value.dtype.itemsize) if kind == "f" else "")
    return f"{said} {value.size}\n".encode() + np.ascontiguousarray(value, stored).tobytes()
