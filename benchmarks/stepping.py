"""Environment steps: robots that turn on the spot, so that all of them scan and share in every step.

The scenario is `room`; steps end when the next robots have to decide, which is at once for all; the
least utility worth sending is 0, so every scan sends a whole burst.
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable
from functools import partial
from types import FrameType
from typing import Any

import numpy as np

from benchmarks.peers import Spread
from benchmarks.rows import Effort, Goal, Row, compared, interleave, seconds
from entropy_explore_env.config import Ending, Scenario, with_settings
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.envs.vector_env import EntropyExploreVectorEnv
from entropy_explore_env.scenarios import ROOM

ROBOTS = 4
TURNING = with_settings(
    ROOM, {"robots": ROBOTS, "decision_period_s": None, "channel": {"burst": 64, "i_min_bits": 0.0}}
)
"""What `ParallelEnv.step` is measured on."""
ENDLESS = with_settings(TURNING, {"ending": Ending(sigma_end=1e-3, time_limit_s=math.inf)})
"""The same, but no mission ends while the clock runs."""

_FULL_SHARE = 0.99
"""A teammate right before the sensor may leave fewer measurements than a burst holds: 1 % at most."""
_WARMING_STEPS = 3
_SINGLES = 8
"""Missions of the batch that the single environment takes on in a round."""


def turns(steps: int, missions: int, seed: int) -> np.ndarray:
    """(steps, missions, A, 5) float32 actions: no displacement, a random yaw, level."""
    actions = np.zeros((steps, missions, ROBOTS, 5), np.float32)
    actions[..., 3] = np.random.default_rng(seed).uniform(-1.0, 1.0, actions.shape[:-1])
    return actions


def check_bursts(robots: np.ndarray, burst: int) -> None:
    """Make sure that the robots did the work that is timed.

    Args:
        robots: ROBOT, any shape.
        burst: Measurements of a whole one.

    Raises:
        RuntimeError: They did not scan, or sent less than they should.
    """
    scans, sent = int(robots["scans"].sum()), int(robots["measurements_sent"].sum())
    if scans == 0 or sent < _FULL_SHARE * burst * scans:
        raise RuntimeError(f"{sent} measurements sent in {scans} scans: the bursts of {burst} are not full")


class SingleTeam:
    """One ParallelEnv, mission after mission."""

    def __init__(self, scenario: Scenario) -> None:
        """Make the environment."""
        self.env = EntropyExploreEnv(scenario)

    def run(self, seed: int, actions: np.ndarray) -> float:
        """Seconds that the steps of one mission take; its reset is not timed, later ones are.

        Args:
            seed: Of the mission.
            actions: (steps, A, 5) float32.
        """
        env = self.env
        named = [dict(zip(env.possible_agents, row, strict=True)) for row in actions]
        env.reset(seed=seed)
        for action in named[:_WARMING_STEPS]:
            env.step(action)
        started = time.perf_counter()
        for action in named[_WARMING_STEPS:]:
            if not env.agents:
                env.reset()
            env.step(action)
        taken = time.perf_counter() - started
        check_bursts(env.missions.state.robots, env.scenario.channel.burst)
        return taken


class Batch:
    """One VectorEnv of E missions; mission e has seed e, in every round anew."""

    def __init__(self, missions: int, threads: int) -> None:
        """Make the environment."""
        self.missions = missions
        self.env = EntropyExploreVectorEnv(ENDLESS, missions, threads=threads, autoreset_mode="SameStep")

    def run(self, actions: np.ndarray) -> float:
        """Seconds that the steps take after a reset.

        Args:
            actions: (steps, E, A, 5) float32.
        """
        self.env.reset(seed=0)
        for action in actions[:_WARMING_STEPS]:
            self.env.step(action)
        started = time.perf_counter()
        for action in actions[_WARMING_STEPS:]:
            self.env.step(action)
        taken = time.perf_counter() - started
        check_bursts(self.env.missions.state.robots, ENDLESS.channel.burst)
        return taken


def spread_rows(effort: Effort) -> list[Row]:
    """Steps a second of the ParallelEnv beside simple_spread."""
    team, peer = SingleTeam(TURNING), Spread(ROBOTS, seed=0)
    peer.run(_WARMING_STEPS)

    def ours(number: int) -> float:
        return effort.steps / team.run(number, turns(effort.steps + _WARMING_STEPS, 1, number)[:, 0])

    taken = interleave(
        {"ours": ours, "spread": lambda _: effort.steps / seconds(lambda: peer.run(effort.steps))},
        effort.rounds,
    )
    job = f"ParallelEnv.step, {ROBOTS} robots × {TURNING.sensor.rays} rays, sharing in each step"
    peer_name = f"mpe2 simple_spread_v3, N = {ROBOTS}"
    return [compared(job, peer_name, taken["ours"], taken["spread"], "steps/s", Goal("≥", 2.0))]


def vector_rows(effort: Effort) -> list[Row]:
    """Robot-steps a second of the VectorEnv beside the ParallelEnv, and of two threads beside one."""
    return [row for missions in effort.batches for row in batch_rows(missions, effort)]


def batch_rows(missions: int, effort: Effort) -> list[Row]:
    """Rows of one batch size; with one mission there is nothing for a second thread."""
    steps = max(effort.batch_steps, effort.steps // missions)
    single = SingleTeam(ENDLESS)
    batches = {str(threads): Batch(missions, threads) for threads in ((1, 2) if missions > 1 else (1,))}

    def robot_steps_alone(number: int) -> float:
        actions = turns(steps + _WARMING_STEPS, missions, number)
        some = min(missions, _SINGLES)
        chosen = [(number * some + i) % missions for i in range(some)]
        return ROBOTS * steps * some / sum(single.run(e, actions[:, e]) for e in chosen)

    def robot_steps_together(batch: Batch, number: int) -> float:
        return ROBOTS * steps * missions / batch.run(turns(steps + _WARMING_STEPS, missions, number))

    jobs = {threads: partial(robot_steps_together, batch) for threads, batch in batches.items()}
    taken = interleave({"single": robot_steps_alone, **jobs}, effort.long_rounds)
    for batch in batches.values():
        batch.env.close()
    job = f"VectorEnv.step, {missions} mission{'s' * (missions > 1)} × {ROBOTS} robots"
    unit = "robot-steps/s"
    wanted, doubled = (Goal("≥", 1.15), Goal("≥", 1.7)) if missions == 64 else (None, None)
    rows = [compared(f"{job}, 1 thread", "our ParallelEnv", taken["1"], taken["single"], unit, wanted)]
    if "2" in taken:
        rows.append(compared(f"{job}, 2 threads", "1 thread", taken["2"], taken["1"], unit, doubled))
    return rows


def profile_rows(effort: Effort) -> list[Row]:
    """Where a step's time goes, whether Python works once a mission, and what a belief takes."""
    many = Batch(max(effort.batches), 1)
    few = Batch(16, 1)
    counts = [python_calls(batch) for batch in (many, few)]
    job = "Python calls in a VectorEnv.step"
    calls = compared(
        f"{job}, {many.missions} missions",
        f"{few.missions} missions",
        counts[:1],
        counts[1:],
        "calls",
        Goal("=", 1.0),
    )
    return [*compiled_share(effort), calls, memory_row(few)]


def compiled_share(effort: Effort) -> list[Row]:
    """Microseconds in the compiled call beside those of the whole step."""
    team, batch = SingleTeam(ENDLESS), Batch(64, 1)
    rows = []
    for name, env, run in (
        ("ParallelEnv.step", team.env, lambda n: team.run(n, turns(effort.steps, 1, n)[:, 0])),
        ("VectorEnv.step, 64 missions", batch.env, lambda n: batch.run(turns(effort.batch_steps, 64, n))),
    ):
        inside, whole = [], []
        for number in range(effort.long_rounds):
            calls = _Stopwatch(env.missions._step_range)
            env.missions._step_range = calls  # type: ignore[method-assign]
            taken = run(number)
            timed = calls.taken[_WARMING_STEPS:]
            inside.append(1e6 * sum(timed) / len(timed))
            whole.append(1e6 * taken / len(timed))
            del env.missions._step_range
        rows.append(compared(f"compiled part of {name}", "the whole step", inside, whole, "µs"))
    return rows


class _Stopwatch:
    """Times every call of a function."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self.function, self.taken = function, list[float]()

    def __call__(self, *given: object) -> None:
        started = time.perf_counter()
        self.function(*given)
        self.taken.append(time.perf_counter() - started)


def python_calls(batch: Batch, steps: int = 5) -> float:
    """Calls of Python and C functions in one step."""
    actions = turns(steps + _WARMING_STEPS, batch.missions, 0)
    batch.run(actions)
    count = 0

    def note(frame: FrameType, event: str, argument: object) -> None:
        nonlocal count
        count += event in ("call", "c_call")

    for action in actions[:steps]:
        sys.setprofile(note)
        try:
            batch.env.step(action)
        finally:
            sys.setprofile(None)
    return count / steps


def memory_row(batch: Batch) -> Row:
    """Bytes a voxel and robot of the beliefs."""
    state = batch.env.missions.state
    places = math.prod(state.mean.shape)
    size = (state.mean.nbytes + state.precision.nbytes) / places
    goal = Goal("=", 8.0, "bytes")
    return Row("belief, a voxel and robot", None, size, None, "bytes", None, goal.text, goal.holds(size))
