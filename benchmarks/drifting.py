"""What drift, uncertain measurements and sightings of fiducials add to a step: robots as in `stepping`."""

from __future__ import annotations

from benchmarks.rows import Effort, Goal, Job, Row, compared, interleave
from benchmarks.stepping import ROBOTS, TURNING, SingleTeam, turns
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
    teams = {
        "exact": SingleTeam(TURNING),
        "drifting": SingleTeam(with_settings(TURNING, {"robot": robot})),
        "sighting": SingleTeam(with_settings(TURNING, {"robot": robot, "fiducials": {"number": _FIDUCIALS}})),
    }
    steps = effort.steps
    for team in teams.values():
        team.run(0, turns(1, 1, 0)[:, 0])

    def job(team: SingleTeam) -> Job:
        return lambda number: team.run(number, turns(steps, 1, number)[:, 0])

    taken = interleave({name: job(team) for name, team in teams.items()}, effort.rounds)
    rates = {name: [steps / t.cpu_s for t in taken[name]] for name in taken}
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
