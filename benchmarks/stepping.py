"""Environment steps: robots that turn on the spot, so that all of them scan and share in every step.

The scenario is `room`; steps end when the next robots have to decide, which is at once for all; the least
utility worth sending is 0, so every scan sends a whole burst.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from benchmarks.peers import Spread
from benchmarks.rows import Effort, Goal, Job, Row, Taken, compared, interleave, timed
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.envs.vector_env import EntropyExploreVectorEnv
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.ending import Ending
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.settings.scenarios import ROOM

ROBOTS = 4
TURNING = with_settings(
    ROOM, {"robots": ROBOTS, "decision_period_s": None, "channel": {"burst": 64, "i_min_bits": 0.0}}
)
"""What `ParallelEnv.step` is measured on."""
ENDLESS = with_settings(TURNING, {"ending": Ending(sigma_end=1e-3, time_limit_s=math.inf)})
"""The same, but no mission ends while the clock runs."""
LOOPED = 64
"""Missions of the batch that has goals, and that stands beside a Python loop."""
_FULL_SHARE = 0.99
"""A teammate right before the sensor may leave fewer measurements than a burst holds: 1 % at most."""
_WARMING_STEPS = 3
_SINGLES = 8
"""Missions of the batch that the single environment takes on in a round."""
_BATCH_STEPS = 10
"""Least steps of a batch in a round."""


def turns(steps: int, missions: int, seed: int) -> np.ndarray:
    """Return (warming + steps, missions, A, 5) float32 actions: no displacement, a random yaw, level."""
    actions = np.zeros((_WARMING_STEPS + steps, missions, ROBOTS, 5), np.float32)
    actions[..., 3] = np.random.default_rng(seed).uniform(-1.0, 1.0, actions.shape[:-1])
    return actions


def check_bursts(robots: np.ndarray, burst: int) -> None:
    """Raise a RuntimeError unless the robots (ROBOT, any shape) scanned, and sent whole bursts."""
    scans, sent = int(robots["scans"].sum()), int(robots["measurements_sent"].sum())
    if scans == 0 or sent < _FULL_SHARE * burst * scans:
        raise RuntimeError(f"{sent} measurements sent in {scans} scans: the bursts of {burst} are not full")


def warmed(advance: Callable[[Any], object], steps: Sequence[Any] | np.ndarray) -> Taken:
    """Return what the steps take after the first few, which warm up."""

    def take(some: Sequence[Any] | np.ndarray) -> None:
        for step in some:
            advance(step)

    take(steps[:_WARMING_STEPS])
    return timed(lambda: take(steps[_WARMING_STEPS:]))


class Team:
    """ParallelEnvs of one scenario, stepped one after the other in a Python loop; mission e has seed e."""

    def __init__(self, scenario: Scenario, missions: int = 1) -> None:
        """Make the environments."""
        self.envs = [EntropyExploreEnv(scenario) for _ in range(missions)]

    def run(self, actions: np.ndarray, first_seed: int = 0) -> Taken:
        """Return what the steps (steps, E, A, 5) take after a reset of all; later resets are timed."""

        def advance(step: list[dict[str, np.ndarray]]) -> None:
            for env, action in zip(self.envs, step, strict=True):
                if not env.agents:
                    env.reset()
                env.step(action)

        for seed, env in enumerate(self.envs, start=first_seed):
            env.reset(seed=seed)
        named = [[dict(zip(TURNING.agents, row, strict=True)) for row in step] for step in actions]
        taken = warmed(advance, named)
        for env in self.envs:
            check_bursts(env.missions.state.robots, env.scenario.channel.burst)
        return taken


class Batch:
    """One VectorEnv of E missions; mission e has seed e, in every round anew."""

    def __init__(self, missions: int, threads: int) -> None:
        """Make the environment."""
        self.env = EntropyExploreVectorEnv(ENDLESS, missions, threads=threads, autoreset_mode="SameStep")

    def run(self, actions: np.ndarray) -> Taken:
        """Return what the steps (steps, E, A, 5) take after a reset of all."""
        self.env.reset(seed=0)
        taken = warmed(self.env.step, actions)
        check_bursts(self.env.missions.state.robots, ENDLESS.channel.burst)
        return taken


def step_rows(effort: Effort) -> list[Row]:
    """Return the row of steps a second beside simple_spread."""
    team, spread, steps = Team(TURNING), Spread(ROBOTS, seed=0), effort.steps
    team.run(turns(1, 1, 0))
    spread.run(_WARMING_STEPS)
    jobs: dict[str, Job] = {
        "ours": lambda number: team.run(turns(steps, 1, number), number),
        "theirs": lambda _: timed(lambda: spread.run(steps)),
    }
    taken = interleave(jobs, effort.rounds)
    ours, theirs = ([steps / each.cpu_s for each in taken[name]] for name in jobs)
    job = f"ParallelEnv.step, {ROBOTS} robots × {TURNING.sensor.rays} rays, sharing in each step"
    return [compared(job, f"mpe2 simple_spread_v3, N = {ROBOTS}", ours, theirs, "steps/s", Goal("≥", 2.0))]


def vector_rows(effort: Effort) -> list[Row]:
    """Return rows of robot-steps a second: the VectorEnv beside ParallelEnvs, and two threads beside one."""
    return [row for missions in effort.missions for row in batch_rows(missions, effort)]


def batch_rows(missions: int, effort: Effort) -> list[Row]:
    """Return rows of one batch size: beside one ParallelEnv, as many in a Python loop, and two threads."""
    steps, some = max(_BATCH_STEPS, effort.steps // missions), min(missions, _SINGLES)
    single, batch = Team(ENDLESS), Batch(missions, 1)

    def singles(number: int) -> Taken:
        actions, seeds = turns(steps, missions, number), [(number * some + i) % missions for i in range(some)]
        taken = [single.run(actions[:, seed : seed + 1], seed) for seed in seeds]
        return Taken(sum(t.cpu_s for t in taken), sum(t.wall_s for t in taken))

    jobs: dict[str, Job] = {"single": singles, "batch": lambda n: batch.run(turns(steps, missions, n))}
    if missions == LOOPED:
        fleet = Team(ENDLESS, missions)
        jobs["loop"] = lambda number: fleet.run(turns(steps, missions, number))
    if missions > 1:
        threaded = Batch(missions, 2)
        jobs["threaded"] = lambda number: threaded.run(turns(steps, missions, number))
    taken = interleave(jobs, effort.long_rounds)

    def rates(name: str, wall: bool = False) -> list[float]:
        work = ROBOTS * steps * (some if name == "single" else missions)
        return [work / (t.wall_s if wall else t.cpu_s) for t in taken[name]]

    job = f"VectorEnv.step, {missions} mission{'s' * (missions > 1)} × {ROBOTS} robots"
    unit, wanted = "robot-steps/s", Goal("≥", 1.15) if missions == LOOPED else None
    rows = [compared(job, "one ParallelEnv, in cache", rates("batch"), rates("single"), unit, wanted)]
    if "loop" in taken:
        peer = f"{missions} ParallelEnvs in a Python loop"
        rows.append(compared(job, peer, rates("batch"), rates("loop"), unit, wanted))
    if "threaded" in taken:
        two, one = rates("threaded", wall=True), rates("batch", wall=True)
        doubled = Goal("≥", 1.7) if missions == LOOPED else None
        rows.append(compared(f"{job}, 2 threads", "1 thread", two, one, unit, doubled))
    return rows
