"""Saved states with one number changed: each is refused by name and changes nothing, or missions go on."""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.proofs.cases import BrokenPromiseError, Found, check_step, walk
from entropy_explore_env.errors import EntropyExploreError
from entropy_explore_env.missions.simulation import Missions
from entropy_explore_env.missions.snapshot import restore, snapshot
from entropy_explore_env.reports.state_digest import state_digest
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.scenarios import BOX

STEPS = 20
_BOX = {"robots": 3, "world": "furnished", "track_truth": True}
_DRIFT = {"xy_m_per_sqrt_m": 0.05, "z_m_per_sqrt_m": 0.02, "yaw_rad_per_sqrt_m": 0.05}
SETTINGS: tuple[dict[str, Any], ...] = (
    {"channel": {"delay_s": 3.0, "i_min_bits": 0.0}, "decision_period_s": None},
    {"channel": {"phase_s": 2.0, "repeats": 2, "i_min_fill": 0.5}},
    {"robot": {"navigator": "planned", "redecide": "on_scan"}, "sensor": {"scan_every_m": 0.3}},
    {"robot": {"when_blocked": "wait", "redecide": 0.7, "motion": "planar"}, "action": {"kind": "discrete"}},
    {"robot": {"localization": _DRIFT}, "fiducials": {"number": 5}, "channel": {"delay_s": 0.7}},
    {"robot": {"localization": _DRIFT, "redecide": 0.6}, "channel": {"phase_s": 1.5, "repeats": 2}},
    {"channel": {"content": "summaries", "summary_every_s": 1.0, "delay_s": 3.0}, "decision_period_s": None},
)
"""Settings of the missions whose states are changed: together they use every part of a state."""
_NUMBERS = (np.nan, np.inf, -np.inf, -1.0, 0.0, 1.0, 1e9, -1e9, 1e300, 5e-324)
_COUNTS = (-1, 0, 1, 2, 31, 32, 33, 1000, 10**8, 2**31, 2**62, -(2**62))


def play(number: int) -> Found:
    """Change a number of a saved state, and go on from it.

    Raises:
        BrokenPromiseError: See `change`.
    """
    _, refused = change(number)
    return Found({"refused": int(bool(refused)), "went on": int(not refused)})


def change(number: int) -> tuple[str, str]:
    """Change a number of a saved state, and go on from it; everything is drawn from a number.

    Returns:
        `array.field[place] = value`, and the message of the error that refused it; empty = missions went on.

    Raises:
        BrokenPromiseError: The state was refused but missions changed, or missions that went on observed
            something outside their space.
    """
    scenario = with_settings(with_settings(BOX, _BOX), SETTINGS[number % len(SETTINGS)])
    rng = np.random.default_rng([number, 7])
    missions = Missions(scenario, 2)
    missions.reset_some([0, 1], [number, number + 1])
    walk(missions, rng, STEPS)
    saved = snapshot(missions)
    what = _spoil(saved, rng)
    others = Missions(scenario, 2)
    others.reset_some([0, 1], [3, 4])
    before = _all_of(others)
    try:
        restore(others, saved)
    except EntropyExploreError as error:
        if _all_of(others) != before:
            raise BrokenPromiseError(f"{what}: refused, and yet missions changed") from None
        return what, str(error)
    walk(others, rng, STEPS)
    check_step(others, others.state.robots["reward"], what)
    return what, ""


def _all_of(missions: Missions) -> list[Any]:
    """Return everything that a refused state must leave as it was."""
    digests = [state_digest(missions, mission) for mission in range(missions.count)]
    worlds, truth = missions.worlds[:], missions.state.truth.tobytes()
    return [digests, worlds, truth, missions.seeds[:], missions.episodes[:], missions.observations.tobytes()]


def _spoil(arrays: dict[str, np.ndarray], rng: np.random.Generator) -> str:
    """Change one number of one array, or of one of its fields; returns which."""
    fields = [
        (name, field)
        for name, array in arrays.items()
        if array.size and array.dtype.kind != "U"
        for field in array.dtype.names or ("",)
    ]
    name, field = fields[int(rng.integers(len(fields)))]
    array = arrays[name][field] if field else arrays[name]
    place = tuple(int(rng.integers(n)) for n in array.shape)
    if array.dtype == np.bool_:
        value: Any = int(rng.integers(2, 256))
        array.view(np.uint8)[place] = value
    elif array.dtype.kind == "f":
        numbers = (*_NUMBERS, float(array[place]) * (1.0 + 1e-3 * rng.standard_normal()))
        value = numbers[int(rng.integers(len(numbers)))]
        with np.errstate(over="ignore"):
            array[place] = value
    else:
        limits = np.iinfo(array.dtype)
        value = min(max(_COUNTS[int(rng.integers(len(_COUNTS)))], limits.min), limits.max)
        array[place] = value
    return f"{name}.{field}{list(place)} = {value!r}"
