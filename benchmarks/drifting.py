"""What drift, uncertain measurements and sightings of fiducials add to a step: robots as in `stepping`."""

from __future__ import annotations

from benchmarks.rows import Effort, Goal, Row, compared
from benchmarks.stepping import ROBOTS, TURNING, step_rates
from entropy_explore_env.scenario import with_settings

_DRIFT = {
    "xy_m_per_sqrt_m": 0.02,
    "z_m_per_sqrt_m": 0.01,
    "yaw_rad_per_sqrt_m": 0.01,
    "yaw_rad_per_sqrt_rad": 0.01,
}
_FIDUCIALS = 8
_MOST_ADDED = 1.15
"""Of the time of a step."""


def drifting_rows(effort: Effort) -> list[Row]:
    """Steps a second of robots that drift beside exact ones, and with fiducials to sight beside without."""
    robot = {"localization": _DRIFT}
    scenarios = {
        "exact": TURNING,
        "drifting": with_settings(TURNING, {"robot": robot}),
        "sighting": with_settings(TURNING, {"robot": robot, "fiducials": {"number": _FIDUCIALS}}),
    }
    rates = step_rates(scenarios, effort)
    what = f"ParallelEnv.step, {ROBOTS} robots × {TURNING.sensor.rays} rays"
    return [
        compared(
            f"{what} that drift, {_FIDUCIALS} fiducials",
            "exact robots",
            rates["sighting"],
            rates["exact"],
            "steps/s",
            Goal("≥", 1.0 / _MOST_ADDED),
        ),
        compared(
            f"{what} that drift, {_FIDUCIALS} fiducials",
            "no fiducials",
            rates["sighting"],
            rates["drifting"],
            "steps/s",
        ),
    ]
