"""What the values of a mission's state can be: a saved state with other numbers is refused by name.

Kernels take the state as it is. A count of corners that no path has would lead them beyond their arrays, and
a place outside the workspace, or a number that is none, to observations that are none. The ranges keep
kernels within their arrays and observations finite; they do not prove that a mission came there.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

from entropy_explore_env.errors import RecordError
from entropy_explore_env.missions.faults import COUNTED, OUTAGES
from entropy_explore_env.missions.state import WAYPOINTS, MissionEnd
from entropy_explore_env.planner.records import Kind
from entropy_explore_env.robots.map_summary import is_summary
from entropy_explore_env.robots.motion import MoveEnd
from entropy_explore_env.robots.range_sensor import Return
from entropy_explore_env.settings.grid import MAX_VOXELS
from entropy_explore_env.settings.scenario import Scenario

FROM_WORLD = ("truth", "collision", "visible", "drivable")
"""Arrays of the state that follow from a mission's world, which its seed and what was given determine."""
_MOST = 1e15
"""Of seconds, metres, bits and counts: more than any mission comes to, and exact in a float64."""
_HUGE = 1e300
_LARGEST_COVARIANCE = 1e60
"""In m² and rad²: more than drifts come to, and its square is a float64."""
_LARGEST_PRECISION = 1e37
_ROUNDING = 1e-6
_TURN = 4.0 * math.pi


class Values(NamedTuple):
    """Numbers of the state, and the range that each of them is in."""

    name: str
    numbers: np.ndarray
    least: float | np.ndarray
    most: float | np.ndarray
    also: float | None = None
    """Another number that is allowed."""


def check_ranges(scenario: Scenario, arrays: Mapping[str, np.ndarray], voxels_and_rays: bool = True) -> None:
    """Check every number of a saved state.

    Args:
        scenario: Of the missions.
        arrays: The arrays of a MissionState by name, of the shapes and types that missions of the scenario
            have; those that follow from the world may be missing. Missions of other numbers do not matter.
        voxels_and_rays: Whether to look at every voxel of maps and every ray of scans and messages, too,
            which takes longest.

    Raises:
        RecordError: A number is in no mission of the scenario; the message names `array.field`.
    """
    large = (_maps, _scans, _message_rays, _own_maps) if voxels_and_rays else ()
    small = (_missions, _robots, _heard, _messages, _phases, _faults, _candidates, _experience)
    for part in (*small, _localization, _summaries, *large):
        for values in part(scenario, arrays):
            _check(values)


def _check(values: Values) -> None:
    numbers = values.numbers
    if numbers.dtype == np.bool_:
        numbers = np.ascontiguousarray(numbers).view(np.uint8)
    allowed = (numbers >= values.least) & (numbers <= values.most)  # neither is true of NaN
    if values.also is not None:
        allowed |= numbers == values.also
    if not allowed.all():
        place = tuple(int(i) for i in np.argwhere(~allowed)[0])
        least, most = (np.broadcast_to(end, numbers.shape)[place] for end in (values.least, values.most))
        other = "" if values.also is None else f", or {values.also:g}"
        raise RecordError(
            f"{values.name}{list(place)}",
            numbers[place].item(),
            f"a number from {least:g} to {most:g}{other}",
        )


def _missions(scenario: Scenario, arrays: Mapping[str, np.ndarray]) -> Iterator[Values]:
    """MISSION."""
    clock, voxels = arrays["missions"], scenario.grid.voxels
    time_limit_s, cycles = scenario.ending.time_limit_s, scenario.ending.max_cycles
    yield Values("missions.time_s", clock["time_s"], 0.0, min(time_limit_s, _MOST))
    yield Values("missions.cycles", clock["cycles"], 0, _MOST if cycles is None else cycles)
    yield Values("missions.end", clock["end"], 0, len(MissionEnd) - 1)
    for name in ("enqueued", "idle_scans"):
        yield Values(f"missions.{name}", clock[name], 0, _MOST)
    yield Values("missions.idle_from_m", clock["idle_from_m"], -_ROUNDING, _MOST)
    yield Values("missions.reached_s", clock["reached_s"], 0.0, clock["time_s"][:, None], -1.0)
    for name in ("entropy_start_bits", "entropy_end_bits", "joint_bits"):
        yield Values(f"missions.{name}", clock[name], -_MOST, _MOST)
    yield Values("missions.seen_s", clock["seen_s"], 0.0, clock["time_s"][:, None], -1.0)
    yield Values("missions.seen_m", clock["seen_m"], -_ROUNDING, _MOST, -1.0)
    yield Values("missions.explored_free_end", clock["explored_free_end"], -MAX_VOXELS, voxels)
    for name in ("visible", "visible_free", "explored_free", "explored_end"):
        yield Values(f"missions.{name}", clock[name], 0, voxels)
    for name in ("explored", "explored_visible", "error", "wrong"):
        yield Values(f"missions.{name}", clock[name], -_ROUNDING, voxels)


def _robots(scenario: Scenario, arrays: Mapping[str, np.ndarray]) -> Iterator[Values]:
    """ROBOT."""
    robots, time_s = arrays["robots"], arrays["missions"]["time_s"][:, None]
    low, high = _workspace(scenario)
    for name in ("origin", "goal", "scan_pose"):
        yield from _poses(f"robots.{name}", robots[name], low, high)
    far_m = _farthest_m(scenario)
    yield from _poses("robots.target", robots["target"], low - far_m, high + far_m)
    for name in ("deciding", "under_way", "path_blocked", "waiting"):
        yield Values(f"robots.{name}", robots[name], 0, 1)
    yield Values("robots.waypoints", robots["waypoints"], 0, WAYPOINTS)
    yield Values("robots.corners", robots["corners"], 0, np.maximum(robots["waypoints"] - 1, 0))
    for name in ("path_end", "move_end"):
        yield Values(f"robots.{name}", robots[name], 0, len(MoveEnd) - 1)
    used = np.arange(WAYPOINTS)[:, None] < robots["waypoints"][..., None, None]
    beyond = np.where(used, far_m, _MOST)
    yield Values("robots.path", robots["path"], low - beyond, high + beyond)
    for name in ("depart_s", "decided_s"):
        yield Values(f"robots.{name}", robots[name], 0.0, time_s)
    stopped_s = math.inf if scenario.faults.stop.happens else None
    for name in ("next_scan_s", "ready_s"):
        yield Values(f"robots.{name}", robots[name], 0.0, time_s + 1e9, stopped_s)
    yield Values("robots.redecide_s", robots["redecide_s"], 0.0, time_s + 1e9, math.inf)
    for name in ("lead_s", "own_bits", "received_bits", "entropy_bits", "gained_bits", "heard_bits"):
        yield Values(f"robots.{name}", robots[name], -_MOST, _MOST)
    yield Values("robots.reward", robots["reward"], -_HUGE, _HUGE)
    yield Values("robots.half_angle_rad", robots["half_angle_rad"], 0.0, math.pi + _ROUNDING)
    yield Values("robots.depth_m", robots["depth_m"], 0.0, _longest_m(scenario))
    yield Values("robots.distance_m", robots["distance_m"], -1.0, _MOST)
    for name in ("path_m", "scan_lead_m"):
        yield Values(f"robots.{name}", robots[name], 0.0, _MOST)
    for name in ("i_min_bits", "next_i_min_bits"):
        yield Values(f"robots.{name}", robots[name], 0.0, _HUGE)
    counted = ("scans", "measurements", "redundant", "blocked_moves", "messages_sent", "measurements_sent")
    heard = ("bits_sent", "messages_received", "measurements_received", "bits_received", "messages_lost")
    for name in ("scans_under_way", *counted, *heard, "messages_out_of_range"):
        yield Values(f"robots.{name}", robots[name], 0, _MOST)


def _heard(scenario: Scenario, arrays: Mapping[str, np.ndarray]) -> Iterator[Values]:
    """HEARD."""
    heard, time_s = arrays["heard"], arrays["missions"]["time_s"][:, None, None]
    low, high = _workspace(scenario)
    far_m = _farthest_m(scenario)
    low, high = np.minimum(low - far_m, 0.0), np.maximum(high + far_m, 0.0)  # 0: nothing was heard yet
    for name in ("heard_s", "announced_s"):
        yield Values(f"heard.{name}", heard[name], 0.0, time_s, -1.0)
    yield from _poses("heard.pose", heard["pose"], low, high)
    yield from _poses("heard.announced", heard["announced"][..., :5], low, high)
    cone = np.array([_longest_m(scenario), math.pi + _ROUNDING])
    yield Values("heard.announced", heard["announced"][..., 5:], 0.0, cone)


def _messages(scenario: Scenario, arrays: Mapping[str, np.ndarray]) -> Iterator[Values]:
    """MESSAGE, and to whom."""
    messages, rays = arrays["in_flight"], arrays["in_flight_rays"]
    clock = arrays["missions"]
    time_s, under_way = clock["time_s"][:, None], np.isfinite(messages["due_s"])
    yield Values("in_flight.due_s", messages["due_s"], 0.0, time_s + scenario.longest_delay_s, math.inf)
    yield Values("in_flight.sent_s", messages["sent_s"], 0.0, time_s)
    yield Values("in_flight.serial", messages["serial"], 0, clock["enqueued"][:, None])
    yield Values("in_flight.sender", messages["sender"], 0, scenario.robots - 1)
    yield Values("in_flight.count", messages["count"], -1, rays.shape[2])
    low, high = _workspace(scenario)
    far_m = _farthest_m(scenario)
    wide = np.where(under_way[..., None], 0.0, _MOST)
    yield from _poses("in_flight.pose", messages["pose"], low - wide, high + wide)
    yield from _poses(
        "in_flight.announced", messages["announced"][..., :5], low - wide - far_m, high + wide + far_m
    )
    cone = np.array([_longest_m(scenario), math.pi + _ROUNDING])
    yield Values("in_flight.announced", messages["announced"][..., 5:], 0.0, cone)
    yield Values("in_flight_to", arrays["in_flight_to"], 0, 1)


def _phases(scenario: Scenario, arrays: Mapping[str, np.ndarray]) -> Iterator[Values]:
    """PHASES, and the buffers of the broadcast without their rays."""
    phases, counts = arrays["phases"], arrays["phase_counts"]
    batches, rays = arrays["phase_batches"], arrays["phase_rays"]
    yield Values("phases.broadcasts", phases["broadcasts"], 0, _MOST)
    yield Values("phases.collecting", phases["collecting"], 0, 1)
    yield Values("phase_counts", counts, 0, batches.shape[3])
    yield Values("phase_heard", arrays["phase_heard"], 0, 3)
    yield Values("phase_batches.count", batches["count"], 0, rays.shape[4])
    filled = np.arange(batches.shape[3]) < counts[..., None]
    low, high = _workspace(scenario)
    wide = np.where(filled[..., None], 0.0, _MOST)
    yield from _poses("phase_batches.pose", batches["pose"], low - wide, high + wide)


def rays_of_messages(arrays: Mapping[str, np.ndarray]) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """The rays of delayed messages and of broadcasts, and how many of each message are in use.

    Args:
        arrays: As of `check_ranges`.

    Returns:
        By the name of the array: (..., B, 5) rays and (...) counts.
    """
    messages, batches = arrays["in_flight"], arrays["phase_batches"]
    under_way = np.isfinite(messages["due_s"])
    filled = np.arange(batches.shape[3]) < arrays["phase_counts"][..., None]
    return {
        "in_flight_rays": (arrays["in_flight_rays"], np.where(under_way, messages["count"], 0)),
        "phase_rays": (arrays["phase_rays"], np.where(filled, batches["count"], 0)),
    }


def _message_rays(scenario: Scenario, arrays: Mapping[str, np.ndarray]) -> Iterator[Values]:
    """What is in messages."""
    for name, (rays, counts) in rays_of_messages(arrays).items():
        yield from _packed(scenario, name, rays, np.arange(rays.shape[-2]) < counts[..., None])


def _summaries(scenario: Scenario, arrays: Mapping[str, np.ndarray]) -> Iterator[Values]:
    """SUMMARY and PARCEL."""
    summaries, parcels = arrays["summaries"], arrays["in_flight_parcels"]
    size, time_s = np.asarray(scenario.grid.shape), arrays["missions"]["time_s"][:, None]
    yield Values("summaries.sent_s", summaries["sent_s"], 0.0, time_s)
    yield Values("summaries.sent", summaries["sent"], 0, _MOST)
    yield Values("summaries.low", summaries["low"], 0, size)
    yield Values("summaries.high", summaries["high"], summaries["low"], size)
    places, longest = arrays["in_flight_summaries"].shape[1:]
    yield Values("in_flight_parcels.place", parcels["place"], 0, max(places - 1, 0))
    if parcels.size:
        under_way = np.isfinite(arrays["in_flight"]["due_s"])
        yield Values("in_flight_parcels.bytes", parcels["bytes"], 0, np.where(under_way, longest, 0))


def _own_maps(scenario: Scenario, arrays: Mapping[str, np.ndarray]) -> Iterator[Values]:
    """What robots measured since their latest summaries, and the summaries under way."""
    yield Values("own_mean", arrays["own_mean"], -_ROUNDING, 1.0 + _ROUNDING)
    yield Values("own_precision", arrays["own_precision"], 0.0, _LARGEST_PRECISION)
    parcels, contents = arrays["in_flight_parcels"], arrays["in_flight_summaries"]
    for mission, slot in np.argwhere(parcels["bytes"] > 0):
        parcel = parcels[mission, slot]
        content = contents[mission, parcel["place"], : parcel["bytes"]].tobytes()
        if not is_summary(content, scenario.grid.shape):
            found = f"{len(content)} bytes"
            raise RecordError(f"in_flight_summaries[{mission}, {parcel['place']}]", found, "a whole summary")


def _maps(scenario: Scenario, arrays: Mapping[str, np.ndarray]) -> Iterator[Values]:
    """The beliefs, and the joint map."""
    prior = scenario.sigma_prior**-2.0 * (1.0 - _ROUNDING)
    for name in ("", "joint_"):
        yield Values(f"{name}mean", arrays[f"{name}mean"], -_ROUNDING, 1.0 + _ROUNDING)
        yield Values(f"{name}precision", arrays[f"{name}precision"], prior, _LARGEST_PRECISION)
    yield Values("pooled", arrays["pooled"], -_MOST, _MOST)


def _scans(scenario: Scenario, arrays: Mapping[str, np.ndarray]) -> Iterator[Values]:
    """The latest scans."""
    longest_m = _longest_m(scenario)
    yield Values("scan_range_m", arrays["scan_range_m"], -longest_m, longest_m)
    yield Values("scan_returned", arrays["scan_returned"], min(Return), max(Return))
    yield Values("scan_utility_bits", arrays["scan_utility_bits"], -1.0, _MOST)


def _faults(scenario: Scenario, arrays: Mapping[str, np.ndarray]) -> Iterator[Values]:
    """FAULT. When outages begin and end the seed says; here they are only times, in this order."""
    del scenario
    faults = arrays["faults"]
    for name in OUTAGES:
        begin_s = faults[f"{name}_s"]
        yield Values(f"faults.{name}_s", begin_s, 0.0, _MOST, math.inf)
        yield Values(f"faults.{name}_until_s", faults[f"{name}_until_s"], begin_s, _MOST, math.inf)
    yield Values("faults.stopped", faults["stopped"], 0, 1)
    for name in COUNTED:
        yield Values(f"faults.{name}", faults[name], 0, _MOST)


def _candidates(scenario: Scenario, arrays: Mapping[str, np.ndarray]) -> Iterator[Values]:
    """CANDIDATE; before the first decision all are zeros."""
    candidates = arrays["candidates"]
    low, high = _workspace(scenario)
    yield from _poses(
        "candidates.viewpoint", candidates["viewpoint"], np.minimum(low, 0.0), np.maximum(high, 0.0)
    )
    yield from _poses("candidates.goal", candidates["goal"], *_grid_corners(scenario))
    yield Values("candidates.bits", candidates["bits"], 0.0, _MOST)
    yield Values("candidates.kind", candidates["kind"], 0, max(Kind))


def _experience(scenario: Scenario, arrays: Mapping[str, np.ndarray]) -> Iterator[Values]:
    """EXPERIENCE."""
    kept = arrays["experience"]
    corners = _grid_corners(scenario)
    for name in ("most_bits", "exponent", "far_value"):
        yield Values(f"experience.{name}", kept[name], 0.0, _HUGE)
    for name in ("decided_s", "decided_bits", "forget_at"):
        yield Values(f"experience.{name}", kept[name], 0.0, _MOST)
    for name in ("going", "looked_far"):
        yield Values(f"experience.{name}", kept[name], 0, 1)
    yield Values("experience.patience", kept["patience"], -_MOST, _MOST)
    yield Values("experience.blocked", kept["blocked"], 0, _MOST)
    yield Values("experience.failures", kept["failures"], 0, _MOST)
    yield from _poses("experience.goal", kept["goal"], *corners)
    yield Values("experience.far_at", kept["far_at"], *corners)
    far = _farthest_m(scenario) / scenario.grid.voxel_size_m
    yield from _poses("experience.failed", kept["failed"], corners[0] - far, corners[1] + far)
    yield Values("experience.share", kept["share"], 0.0, 1.0)


def _grid_corners(scenario: Scenario) -> tuple[np.ndarray, np.ndarray]:
    """(3,) each: the lower and the upper corner of the workspace, in grid units."""
    return np.zeros(3) - _ROUNDING, np.asarray(scenario.grid.shape, np.float64) + _ROUNDING


def _localization(scenario: Scenario, arrays: Mapping[str, np.ndarray]) -> Iterator[Values]:
    """ESTIMATE, fiducials, and the covariances of batches. An estimate is in the workspace."""
    estimates = arrays["estimates"]
    low, high = _workspace(scenario)
    far_m = _farthest_m(scenario)
    yield Values("estimates.place", estimates["place"], low, high)
    yield from _poses("estimates.scan_pose", estimates["scan_pose"], low, high)
    yield Values("estimates.yaw", estimates["yaw"], -_TURN, _TURN)
    yield Values("estimates.driven_m", estimates["driven_m"], -1.0, _MOST)
    off = np.array([far_m, far_m, far_m, math.pi + _ROUNDING])
    yield Values("estimates.error", estimates["error"], -off, off)
    spread = np.where(np.eye(4, dtype=bool), 0.0, -_LARGEST_COVARIANCE)
    covariance = estimates["covariance"]
    yield Values("estimates.covariance", covariance, spread, _LARGEST_COVARIANCE)
    slack = _ROUNDING * np.trace(covariance, axis1=2, axis2=3)[..., None]
    off_by = np.abs(covariance - covariance.swapaxes(2, 3)).max(axis=(2, 3), initial=0.0)[..., None]
    yield Values("estimates.covariance, asymmetry", off_by, 0.0, slack)
    least = np.linalg.eigvalsh(covariance)
    yield Values("estimates.covariance, eigenvalues", least, -slack, 4.0 * _LARGEST_COVARIANCE)
    for name in ("squared_m2", "squared_rad2"):
        yield Values(f"estimates.{name}", estimates[name], 0.0, _HUGE)
    yield Values("estimates.sightings", estimates["sightings"], 0, _MOST)
    yield Values("fiducials", arrays["fiducials"], low, high)
    yield from _landmarks(arrays["landmarks"], (low, high), far_m)
    packed = {"estimates.packed": estimates["packed"]}
    for name in ("in_flight_covariances", "phase_covariances"):
        packed[name] = arrays[name]
    for name, numbers in packed.items():
        yield Values(name, numbers, -_LARGEST_COVARIANCE, _LARGEST_COVARIANCE)


def _landmarks(
    landmarks: np.ndarray, corners: tuple[np.ndarray, np.ndarray], far_m: float
) -> Iterator[Values]:
    """LANDMARK. Noise and its own error may let a robot believe one to be beyond the workspace.

    Free places hold zeros, or what was there before.
    """
    used = landmarks["used"][..., None]
    low, high = corners
    low, high = np.where(used, low, np.minimum(low, 0.0)), np.where(used, high, np.maximum(high, 0.0))
    yield Values("landmarks.place", landmarks["place"], low, high)
    yield Values("landmarks.seen_from", landmarks["seen_from"], low - _ROUNDING, high + _ROUNDING)
    yield Values("landmarks.believed", landmarks["believed"], low - _MOST * far_m, high + _MOST * far_m)
    spread = np.where(np.eye(4, dtype=bool), 0.0, -_LARGEST_COVARIANCE)
    yield Values("landmarks.covariance", landmarks["covariance"], spread, _LARGEST_COVARIANCE)
    yield Values("landmarks.score", landmarks["score"], 0.0, 2.0)
    yield Values("landmarks.sightings", landmarks["sightings"], 0, _MOST)
    yield Values("landmarks.used", landmarks["used"], 0, 1)


def _poses(name: str, poses: np.ndarray, low: np.ndarray, high: np.ndarray) -> Iterator[Values]:
    """Places between two corners; yaw and pitch, which may go beyond a turn while a robot turns."""
    yield Values(name, poses[..., :3], low, high)
    yield Values(name, poses[..., 3:], -_TURN, _TURN)


def _packed(scenario: Scenario, name: str, rays: np.ndarray, used: np.ndarray) -> Iterator[Values]:
    """Measurements of messages: unit vectors, distances in grid units, a Return each; others may be 0."""
    squares = (rays[..., :3] ** 2).sum(axis=-1)
    yield Values(
        f"{name}, length of a direction", squares, np.where(used, 1.0 - _ROUNDING, 0.0), 1.0 + _ROUNDING
    )
    yield Values(f"{name}, distance", rays[..., 3], 0.0, longest_ray(scenario))
    yield Values(f"{name}, Return", rays[..., 4], min(Return), max(Return))
    yield Values(f"{name}, Return", rays[..., 4] % 1.0, 0.0, 0.0)


def longest_ray(scenario: Scenario) -> float:
    """Grid units that no measured distance in a message is beyond."""
    return _longest_m(scenario) / scenario.grid.voxel_size_m


def _workspace(scenario: Scenario) -> tuple[np.ndarray, np.ndarray]:
    """(3,) each: the lower and the upper corner of the workspace, in metres."""
    low = np.asarray(scenario.grid.origin_m, np.float64)
    return low, low + scenario.grid.size_m


def _longest_m(scenario: Scenario) -> float:
    """Metres that no measured distance is beyond, noise and what is wrong with sensors included."""
    measured_m = _farthest_m(scenario) + 100.0 * max(kind.sensor.range_noise_m for kind in scenario.kinds)
    wrong = scenario.faults.sensor
    return measured_m * max(wrong.range_factor, 1.0) + abs(wrong.range_bias_m)


def _farthest_m(scenario: Scenario) -> float:
    """Metres that no viewpoint is beyond the workspace, nor anything in it from anything else."""
    across_m = float(np.linalg.norm(scenario.grid.size_m)) + scenario.grid.voxel_size_m
    reaches_m = [kind.robot.reach_m for kind in scenario.kinds if math.isfinite(kind.robot.reach_m)]
    return 2.0 * max([across_m, *reaches_m])
