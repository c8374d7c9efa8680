"""What it costs to choose a viewpoint: mutual information with teammates' cones, and whole decisions."""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from baselines.experiments.mission import run_mission, scripted
from baselines.strategies import make_strategy
from baselines.strategies.protocol import Stopwatch, Strategy
from baselines.strategies.rules.next_best_view import NextBestView, NextBestViewConfig
from benchmarks.rows import Effort, Goal, Row, alone, compared, timed
from entropy_explore_env.belief.visibility import CONE, cone_of, mark_cones, visible_bits
from entropy_explore_env.compilation.kernels import kernel
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.errors import counted
from entropy_explore_env.missions.view import RobotView
from entropy_explore_env.missions.view_candidates import ViewProposer
from entropy_explore_env.scenario import Scenario, with_settings
from entropy_explore_env.scenarios import CAVE, CLIFF, LAB, OCCLUSIONS, OFFICE, ROOM
from entropy_explore_env.settings import Grid

TEAMMATES = 9
_REPEATS = 20
_SIGMA_KNOWN = 0.2
_LARGE_GRID = {"name": "cliff of 400 × 400 × 40", "grid": Grid((400, 400, 40), 0.125)}
_LARGE_CLIFF = with_settings(CLIFF, {**_LARGE_GRID, "robot": {"reach_m": math.inf}})
_CLIFF_STEPS = 40
"""Enough for most of what is near to be mapped."""
_LARGE_PLAN = with_settings(
    OCCLUSIONS,
    {"name": "occlusions of 400 × 400", "grid": Grid((400, 400, 1), 0.25), "robot": {"reach_m": math.inf}},
)
_DRIFTING = {
    "robot": {
        "localization": {"xy_m_per_sqrt_m": 0.02, "yaw_rad_per_sqrt_m": 0.002, "yaw_rad_per_sqrt_rad": 0.002}
    },
    "fiducials": {"number": 40},
}
_PLAN_STEPS = 60
_MISSIONS = 3
_WEIGHS_ERROR = NextBestViewConfig(error_weight=1.0)


def deciding_rows(effort: Effort) -> list[Row]:
    """Mutual information in the laboratory, and a decision of each strategy that has a limit."""
    return [
        mutual_information_row(effort),
        decision_row(ROOM, 3, "planned-rate", effort.steps, 5.0),
        decision_row(OFFICE, 1, "planned-rate", effort.steps, 10.0),
        decision_row(CAVE, 1, "planned-rate", effort.steps, 25.0),
        candidates_row(OFFICE, 1, effort),
        candidates_row(CAVE, 3, effort),
        decision_row(LAB, 10, "mutual-information", effort.steps, 5.0),
        decision_row(_LARGE_CLIFF, 1, "cliff-next-best-view", min(effort.steps, _CLIFF_STEPS), 50.0),
        decision_row(_LARGE_PLAN, 1, "next-best-view", min(effort.steps, _PLAN_STEPS), 50.0),
        strategy_row(
            with_settings(_LARGE_PLAN, _DRIFTING),
            1,
            "next-best-view with w_LE 1, drifting",
            lambda: NextBestView(_WEIGHS_ERROR),
            Limit(min(effort.steps, _PLAN_STEPS), 50.0),
        ),
    ]


def mutual_information_row(effort: Effort) -> Row:
    """Milliseconds of I between a candidate and all teammates' cones, as far as the sensor reaches."""
    grid, sensor, rng = LAB.grid, LAB.sensor, np.random.default_rng(0)
    radius, half_angle = sensor.max_range_m / grid.voxel_size_m, 0.5 * math.hypot(*sensor.field_of_view_rad)
    cones = np.zeros(TEAMMATES + 1, CONE)
    for place in range(len(cones)):
        x, y = rng.uniform(0.1, 0.9, 2) * grid.shape[:2]
        height = LAB.robot.sensor_height_m / grid.voxel_size_m
        cones[place] = cone_of(np.array([x, y, height, rng.uniform(-np.pi, np.pi), 0.0]), radius, half_angle)
    precision = (10.0 ** rng.uniform(-3.0, 3.0, grid.voxels)).astype(np.float32)
    marks = np.zeros(grid.voxels, np.uint8)

    def work() -> None:
        for _ in range(_REPEATS):
            overlap_bits(cones, grid.shape, precision, _SIGMA_KNOWN**-2, marks)

    work()
    taken = [1e3 * timed(work).cpu_s / _REPEATS for _ in range(effort.rounds)]
    job = f"mutual information of a cone and {TEAMMATES} others, lab, {sensor.max_range_m:g} m"
    return alone(job, taken, "ms", Goal("<", 0.2, "ms"))


@kernel
def overlap_bits(
    cones: np.ndarray,
    size: tuple[int, int, int],
    precision: np.ndarray,
    known_precision: float,
    marks: np.ndarray,
) -> float:
    """I of the last cone and all others, in bits; `marks` (V,) uint8 is cleared first."""
    marks[:] = 0
    mark_cones(cones[:-1], size, marks, 1)
    return visible_bits(cones[len(cones) - 1], size, precision, known_precision, None, marks)[1]


def plan_rows(name: str, path: str, grid: Grid, steps: int) -> list[Row]:
    """A decision of `planned-rate` in a plan's file, where it decides at every scan under way.

    Until the map has so little entropy, by openings, and until all is seen, by tours through frontier cells.
    """
    plan = dataclasses.replace(OFFICE, name=name, world=path, grid=grid)
    under_way = {"robot": {"redecide": "on_scan", "body_radius_m": 0.0}, "sensor": {"scan_every_m": 0.5}}
    whole = {**under_way, "name": f"{name} to be seen whole", "ending": {"seen_share": 1.0}}
    return [
        decision_row(with_settings(plan, settings), 1, "planned-rate", steps, 50.0)
        for settings in (under_way, whole)
    ]


def candidates_row(scenario: Scenario, robots: int, effort: Effort) -> Row:
    """Decisions a second of the planner that proposes 24 candidates, beside `planned-rate`, with one."""
    limit = Limit(effort.steps, math.inf)
    ours, theirs = list[float](), list[float]()
    for _ in range(_MISSIONS):
        ours.append(1e3 / strategy_row(scenario, robots, "the first candidate", FirstCandidate, limit).ours)
        theirs.append(1e3 / decision_row(scenario, robots, "planned-rate", *limit).ours)
    job = f"decisions among 24 candidates, {scenario.name}, {counted(robots, 'robot')}"
    return compared(job, "planned-rate", ours, theirs, "/s", Goal("≥", 0.7))


class FirstCandidate:
    """Chooses the first of the candidates that the planner proposes to a policy, which is its own choice."""

    def reset(self, scenario: Scenario, rng: np.random.Generator) -> None:
        """Begin a new mission."""
        self._proposer = ViewProposer(with_settings(scenario, {"action": {"kind": "candidates"}}), rng)

    def choose(self, view: RobotView) -> np.ndarray:
        """Return the viewpoint (5,) of the first candidate, map frame."""
        return self._proposer.propose(view)[0].copy()


class Limit(NamedTuple):
    """How long decisions are looked at, and what they may cost."""

    steps: int
    """Of the mission."""
    most_ms: float
    """A decision."""


def decision_row(scenario: Scenario, robots: int, strategy: str, steps: int, most_ms: float) -> Row:
    """Milliseconds a decision of a strategy over a mission, or so many steps of one; and their limit."""
    return strategy_row(scenario, robots, strategy, lambda: make_strategy(strategy), Limit(steps, most_ms))


def strategy_row(
    scenario: Scenario, robots: int, named: str, make: Callable[[], Strategy], limit: Limit
) -> Row:
    """The row of a strategy that its settings make."""
    env = EntropyExploreEnv(with_settings(scripted(scenario), {"robots": robots, "max_cycles": limit.steps}))
    run_mission(env, make(), 0)  # compiled now
    watch = Stopwatch(make(), time.thread_time)
    run_mission(env, watch, 1)
    job = f"a decision of {named}, {scenario.name}, {counted(robots, 'robot')}"
    return alone(job, watch.decisions_ms, "ms", Goal("<", limit.most_ms, "ms"))
