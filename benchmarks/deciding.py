"""What exploring costs: decisions of strategies, a mission on a large floor, and a dense scanner."""

from __future__ import annotations

import math
import statistics
import sys
import time

import numpy as np

from baselines.experiments.mission import run_mission, scripted
from baselines.strategies import make_strategy
from baselines.strategies.protocol import Stopwatch
from baselines.suites.public_worlds import fetch_worlds, in_world
from benchmarks.rows import Effort, Goal, Row, alone, compared, timed
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.errors import EntropyExploreError, counted
from entropy_explore_env.missions.view import RobotView
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.settings.scenarios import CAVE, CLIFF, LAB, OCCLUSIONS, OFFICE, ROOM, find_scenario

_FAR = {"reach_m": math.inf}
_LARGE_CLIFF = with_settings(
    CLIFF, {"name": "cliff of 400 × 400 × 40", "grid": Grid((400, 400, 40), 0.125), "robot": _FAR}
)
_LARGE_PLAN = with_settings(
    OCCLUSIONS, {"name": "occlusions of 400 × 400", "grid": Grid((400, 400, 1), 0.25), "robot": _FAR}
)
_LARGE_STEPS = 40
"""Of missions in them: enough for most of what is near to be mapped."""
_UNDER_WAY = {"robot": {"redecide": "on_scan", "body_radius_m": 0.0}, "sensor": {"scan_every_m": 0.5}}
PUBLISHED_STEPS_S = 10.0
"""Steps a second measured of a published 2-D exploration environment (ARiADNE's sensor)."""
_FLOOR, _SMALL_FLOOR = (1674, 1006, 1), (240, 200, 1)
"""As many cells of 0.03 m as the nav2 project's warehouse, and some."""


def deciding_rows(effort: Effort) -> list[Row]:
    """Return a decision of each strategy that has a limit.

    In the warehouse, a public world, `planned-rate` decides at every scan under way: by openings until the
    map has little entropy, and by tours where all has to be seen. Where the world cannot be fetched, these
    rows are left out, with the reason on standard error.
    """
    steps, few = effort.steps, min(effort.steps, _LARGE_STEPS)
    warehouse = in_world(OFFICE, "warehouse", _UNDER_WAY)
    whole = with_settings(warehouse, {"name": "warehouse to be seen whole", "ending": {"seen_share": 1.0}})
    plans = [warehouse, whole]
    try:
        fetch_worlds(plans)
    except EntropyExploreError as error:
        print(f"no rows of the warehouse: {error}", file=sys.stderr)
        plans = []
    return [
        decision_row(ROOM, 3, "planned-rate", steps, 5.0),
        decision_row(OFFICE, 1, "planned-rate", steps, 10.0),
        decision_row(CAVE, 1, "planned-rate", steps, 25.0),
        decision_row(LAB, 10, "mutual-information", steps, 5.0),
        decision_row(_LARGE_CLIFF, 1, "cliff-next-best-view", few, 50.0),
        decision_row(_LARGE_PLAN, 1, "next-best-view", few, 50.0),
        *(decision_row(plan, 1, "planned-rate", steps, 50.0) for plan in plans),
        weights_row(effort),
    ]


class _Beside:
    """The planner, which leads the mission, and learned weights, which decide in the same moments."""

    def __init__(self) -> None:
        """Measure nothing yet."""
        self.planner = Stopwatch(make_strategy("planned-rate"), time.thread_time)
        self.weights = Stopwatch(make_strategy("pretrained:plans"), time.thread_time)

    def reset(self, scenario: Scenario, rng: np.random.Generator) -> None:
        """Begin a mission."""
        for strategy in (self.planner, self.weights):
            strategy.reset(scenario, rng.spawn(1)[0])

    def choose(self, view: RobotView) -> np.ndarray:
        """Return the planner's choice, after which the weights choose as well."""
        chosen = self.planner.choose(view)
        self.weights.choose(view)
        return chosen


def weights_row(effort: Effort) -> Row:
    """Return the mean decision by learned weights beside the planner's, in the same moments of missions."""
    env = EntropyExploreEnv(with_settings(scripted(OFFICE), {"robots": 3, "max_cycles": effort.steps}))
    means_ms = list[tuple[float, float]]()
    for seed in range(1 + effort.long_rounds):
        beside = _Beside()
        run_mission(env, beside, seed)
        weights_ms, planner_ms = beside.weights.decisions_ms, beside.planner.decisions_ms
        means_ms.append((statistics.fmean(weights_ms), statistics.fmean(planner_ms)))
    ours, planner = zip(*means_ms[1:], strict=True)  # kernels are compiled in the first round
    job = "a decision of pretrained:plans, office, 3 robots"
    return compared(job, "planned-rate", ours, planner, "ms", Goal("≤", 1.2))


def decision_row(scenario: Scenario, robots: int, strategy: str, steps: int, most_ms: float) -> Row:
    """Return the row of milliseconds a decision of a strategy in some steps of a mission, and their limit."""
    env = EntropyExploreEnv(with_settings(scripted(scenario), {"robots": robots, "max_cycles": steps}))
    run_mission(env, make_strategy(strategy), 0)  # compiled now
    watch = Stopwatch(make_strategy(strategy), time.thread_time)
    run_mission(env, watch, 1)
    job = f"a decision of {strategy}, {scenario.name}, {counted(robots, 'robot')}"
    return alone(job, watch.decisions_ms, "ms", Goal("<", most_ms, "ms"))


def mission_rows(effort: Effort) -> list[Row]:
    """Return steps with a dense scanner, and a mission on a large floor."""
    return [scanner_row(effort), *([floor_row(_FLOOR)] if effort.large else [])]


def scanner_row(effort: Effort) -> Row:
    """Return steps a second of one robot that scans 720 rays in each, on 480 × 640 cells of clutter."""
    sensor = {"field_of_view_rad": (2 * math.pi, 0.0), "angular_step_rad": math.pi / 360, "max_range_m": 8.0}
    settings = {"grid": Grid((480, 640, 1), 0.1), "robots": 1, "sensor": sensor, "time_limit_s": 1e6}
    settings["robot"] = {"reach_m": 0.5, "navigator": "straight"}
    env = EntropyExploreEnv(with_settings(scripted(find_scenario("cluttered")), settings))
    rng, rates = np.random.default_rng(0), list[float]()

    def work() -> None:
        for _ in range(effort.steps):
            env.step({agent: rng.uniform(-1, 1, 3).astype(np.float32) for agent in env.agents})

    for seed in range(effort.long_rounds + 1):
        env.reset(seed=seed)
        rates.append(effort.steps / timed(work).cpu_s)
    job = f"ParallelEnv.step, {env.scenario.sensor.rays} rays all around up to 8 m, 480 × 640"
    job += f" (published: {PUBLISHED_STEPS_S:g}/s)"
    return alone(job, rates[1:], "steps/s", Goal("≥", 500.0 * PUBLISHED_STEPS_S, "steps/s"))  # [0] compiles


def floor_row(shape: tuple[int, int, int]) -> Row:
    """Return the seconds on the clock until three robots with lasers of 10 m have seen 99 % of a floor."""
    _floor_s(_SMALL_FLOOR)  # compiles
    job = f"a mission of 3 robots on a cluttered floor, {shape[0]} × {shape[1]} cells, by per-time-visibility"
    return alone(f"{job}, to 99 %", [_floor_s(shape)], "s", Goal("<", 60.0, "s"))


def _floor_s(shape: tuple[int, int, int]) -> float:
    settings = {"grid": Grid(shape, 0.03), "robots": 3, "robot": _FAR, "sensor": {"max_range_m": 10.0}}
    settings["ending"] = {"seen_share": 0.99, "time_limit_s": 1e5}
    env = EntropyExploreEnv(with_settings(scripted(find_scenario("cluttered")), settings))
    strategy = make_strategy("per-time-visibility")
    return timed(lambda: run_mission(env, strategy, 0)).wall_s
