"""What the values of a mission's state can be: a saved state with other numbers is refused by name.

The ranges stand beside the types: `state.state_arrays`, and the fields of structured types (`robots.ranges`).
Here are the bounds that depend on scenario and clock, and what several numbers must have in common.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import numpy as np

from entropy_explore_env.errors import RecordError
from entropy_explore_env.missions.faults import OUTAGES
from entropy_explore_env.missions.state import FROM_WORLD, state_arrays
from entropy_explore_env.robots.map_summary import is_summary
from entropy_explore_env.robots.range_sensor import Return
from entropy_explore_env.robots.ranges import LARGEST_COVARIANCE, MOST, ROUNDING, TURN, Values, ranges_of
from entropy_explore_env.settings.scenario import Scenario

Arrays = Mapping[str, np.ndarray]
"""The arrays of a MissionState by name, with or without those that follow from the world."""
Bounds = Mapping[str, "float | np.ndarray"]
"""Name of a bound → a number, numbers along the last axis of what they bound, or one a mission."""
_OF_MISSIONS = ("time_s", "soon_s", "next_s", "due_s", "enqueued")
"""Bounds of which each mission has its own."""


def check_ranges(scenario: Scenario, arrays: Arrays) -> None:
    """Check every number of a saved state.

    Args:
        scenario: Of the missions.
        arrays: Of the shapes and types that missions of the scenario have.

    Raises:
        RecordError: A number is in no mission of the scenario; the message names `array.field`.
    """
    bounds = _bounds(scenario, arrays)
    for name, declared in state_arrays(scenario, 0, 0).items():
        if name in FROM_WORLD:
            continue
        if declared.values is not None:
            _check_values(name, arrays[name], declared.values, bounds)
        for field, values in ranges_of(declared.dtype).items() if declared.dtype.names else ():
            _check_values(f"{name}.{field}", arrays[name][field], values, bounds)
    for name, numbers, least, most in _in_common(scenario, arrays):
        _check(name, numbers, least, most)
    _check_summaries(scenario, arrays)


def _check_values(name: str, numbers: np.ndarray, values: Values, bounds: Bounds) -> None:
    """Check numbers against their declared range."""
    least, most = (_bound(end, bounds, numbers.ndim) for end in (values.least, values.most))
    _check(name, numbers, least, most, values.also)


def _bound(end: float | str, bounds: Bounds, axes: int) -> float | np.ndarray:
    """Return a bound that can be compared with numbers of this many axes."""
    if not isinstance(end, str):
        return end
    bound = bounds[end]
    if end in _OF_MISSIONS and isinstance(bound, np.ndarray):
        return bound.reshape(-1, *(1,) * (axes - 1))
    return bound


def _check(
    name: str,
    numbers: np.ndarray,
    least: float | np.ndarray,
    most: float | np.ndarray,
    also: float | None = None,
) -> None:
    """Raise a RecordError that names the first number outside its range."""
    if numbers.dtype == np.bool_:
        numbers = np.ascontiguousarray(numbers).view(np.uint8)
    allowed = (numbers >= least) & (numbers <= most)  # neither is true of NaN
    if also is not None:
        allowed |= numbers == also
    if allowed.all():
        return
    place = tuple(int(i) for i in np.argwhere(~allowed)[0])
    low, high = (np.broadcast_to(end, numbers.shape)[place] for end in (least, most))
    other = "" if also is None else f", or {also:g}"
    allowed_range = f"a number from {low:g} to {high:g}{other}"
    raise RecordError(f"{name}{list(place)}", numbers[place].item(), allowed_range)


def _bounds(scenario: Scenario, arrays: Arrays) -> dict[str, float | np.ndarray]:
    """Return the bounds that depend on the scenario and on each mission's clock, by name."""
    clock, ending, shape = arrays["missions"], scenario.ending, np.asarray(scenario.grid.shape)
    longest_m, off_m = _longest_m(scenario), _farthest_m(scenario)
    error = np.array([off_m, off_m, off_m, math.pi + ROUNDING])
    places, summary_bytes = arrays["in_flight_summaries"].shape[1:]
    bounds: dict[str, float | np.ndarray] = {
        "time_limit_s": min(ending.time_limit_s, MOST),
        "cycles": MOST if ending.max_cycles is None else ending.max_cycles,
        "time_s": clock["time_s"],
        "soon_s": clock["time_s"] + 1e9,
        "next_s": math.inf if scenario.faults.stop.happens else clock["time_s"] + 1e9,
        "due_s": clock["time_s"] + scenario.longest_delay_s,
        "enqueued": clock["enqueued"],
        "voxels": scenario.grid.voxels,
        "size": shape,
        "last_robot": scenario.robots - 1,
        "batch": scenario.batch_measurements,
        "batches": scenario.phase_batches,
        "last_place": max(places - 1, 0),
        "summary_bytes": summary_bytes,
        "prior": scenario.sigma_prior**-2.0 * (1.0 - ROUNDING),
        "longest_m": longest_m,
        "shortest_m": -longest_m,
        "error_low": -error,
        "error_high": error,
    }
    low = np.asarray(scenario.grid.origin_m, np.float64)
    high, far = low + scenario.grid.size_m, off_m / scenario.grid.voxel_size_m
    corners = {
        "": (low, high),
        "zero_": (np.minimum(low, 0.0) - ROUNDING, np.maximum(high, 0.0) + ROUNDING),
        "far_": (np.minimum(low - off_m, 0.0), np.maximum(high + off_m, 0.0)),
        "grid_": (np.zeros(3) - ROUNDING, shape + ROUNDING),
        "far_grid_": (np.zeros(3) - far, shape + far),
    }
    for name, (lower, upper) in corners.items():
        bounds[f"{name}place_low"], bounds[f"{name}place_high"] = lower, upper
        bounds[f"{name}pose_low"] = np.append(lower, [-TURN, -TURN])
        bounds[f"{name}pose_high"] = np.append(upper, [TURN, TURN])
    bounds["announced_low"] = np.append(bounds["far_pose_low"], [0.0, 0.0])
    bounds["announced_high"] = np.append(bounds["far_pose_high"], [longest_m, math.pi + ROUNDING])
    return bounds


def _in_common(
    scenario: Scenario, arrays: Arrays
) -> Iterator[tuple[str, np.ndarray, float | np.ndarray, float | np.ndarray]]:
    """Yield name, numbers and range of what is bounded by other numbers of the state."""
    robots, faults, summaries = arrays["robots"], arrays["faults"], arrays["summaries"]
    yield "robots.corners", robots["corners"], 0, np.maximum(robots["waypoints"] - 1, 0)
    for name in OUTAGES:
        yield f"faults.{name}_until_s", faults[f"{name}_until_s"], faults[f"{name}_s"], math.inf
    yield "summaries.high", summaries["high"], summaries["low"], np.asarray(scenario.grid.shape)
    covariance = arrays["estimates"]["covariance"]
    slack = ROUNDING * np.trace(covariance, axis1=2, axis2=3)[..., None]
    off_by = np.abs(covariance - covariance.swapaxes(2, 3)).max(axis=(2, 3), initial=0.0)[..., None]
    yield "estimates.covariance, asymmetry", off_by, 0.0, slack
    yield "estimates.covariance, eigenvalues", np.linalg.eigvalsh(covariance), -slack, 4 * LARGEST_COVARIANCE
    batches, waiting = arrays["phase_batches"], arrays["phase_counts"]
    filled = np.arange(batches.shape[3]) < waiting[..., None]
    messages = arrays["in_flight"]
    counts = {
        "in_flight_rays": np.where(np.isfinite(messages["due_s"]), messages["count"], 0),
        "phase_rays": np.where(filled, batches["count"], 0),
    }
    if arrays["backlog_poses"].size:
        own = np.array([scenario.kind_of(robot).sensor.rays for robot in range(scenario.robots)])
        taken = np.arange(scenario.backlog_scans) < robots["scans"][..., None]
        counts["backlog_rays"] = np.where(taken, own[:, None], 0)
    for name, count in counts.items():
        yield from _rays(scenario, name, arrays[name], count)
    parcels = arrays["in_flight_parcels"]
    if parcels.size:
        most = np.where(np.isfinite(messages["due_s"]), arrays["in_flight_summaries"].shape[2], 0)
        yield "in_flight_parcels.bytes", parcels["bytes"], 0, most


def _rays(
    scenario: Scenario, name: str, rays: np.ndarray, count: np.ndarray
) -> Iterator[tuple[str, np.ndarray, float | np.ndarray, float | np.ndarray]]:
    """Yield what bounds measurements of messages: unit vectors, distances in grid units, a Return each."""
    used = np.arange(rays.shape[-2]) < count[..., None]
    squares = (rays[..., :3] ** 2).sum(axis=-1)
    yield f"{name}, length of a direction", squares, np.where(used, 1.0 - ROUNDING, 0.0), 1.0 + ROUNDING
    yield f"{name}, distance", rays[..., 3], 0.0, _longest_m(scenario) / scenario.grid.voxel_size_m
    yield f"{name}, Return", rays[..., 4], min(Return), max(Return)
    yield f"{name}, Return", rays[..., 4] % 1.0, 0.0, 0.0


def _check_summaries(scenario: Scenario, arrays: Arrays) -> None:
    """Raise a RecordError where a summary under way is not whole."""
    parcels, contents = arrays["in_flight_parcels"], arrays["in_flight_summaries"]
    for mission, slot in np.argwhere(parcels["bytes"] > 0):
        parcel = parcels[mission, slot]
        content = contents[mission, parcel["place"], : parcel["bytes"]].tobytes()
        if not is_summary(content, scenario.grid.shape):
            found = f"{len(content)} bytes"
            raise RecordError(f"in_flight_summaries[{mission}, {parcel['place']}]", found, "a whole summary")


def _longest_m(scenario: Scenario) -> float:
    """Return a distance that no measured one is beyond, noise and what is wrong with sensors included."""
    measured_m = _farthest_m(scenario) + 100.0 * max(kind.sensor.range_noise_m for kind in scenario.kinds)
    wrong = scenario.faults.sensor
    return measured_m * max(wrong.range_factor, 1.0) + abs(wrong.range_bias_m)


def _farthest_m(scenario: Scenario) -> float:
    """Return a distance: no viewpoint is farther outside the workspace, no two points in it are."""
    across_m = float(np.linalg.norm(scenario.grid.size_m)) + scenario.grid.voxel_size_m
    reaches_m = [kind.robot.reach_m for kind in scenario.kinds if math.isfinite(kind.robot.reach_m)]
    return 2.0 * max([across_m, *reaches_m])
