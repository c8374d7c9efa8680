"""Environment steps: robots that turn on the spot, so that all of them scan and share in every step.

The scenario is `room`; steps end when the next robots have to decide, which is at once for all; the
least utility worth sending is 0, so every scan sends a whole burst.
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from types import FrameType
from typing import Any

import numpy as np

from benchmarks.peers import Spread
from benchmarks.rows import Effort, Goal, Job, Row, Taken, compared, interleave, timed
from entropy_explore_env.envs.parallel_env import EntropyExploreEnv
from entropy_explore_env.envs.vector_env import EntropyExploreVectorEnv
from entropy_explore_env.scenario import Scenario, with_settings
from entropy_explore_env.scenarios import ROOM
from entropy_explore_env.settings import Ending

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


def turns(steps: int, missions: int, seed: int) -> np.ndarray:
    """Actions: no displacement, a random yaw, level.

    Returns:
        (warming + steps, missions, A, 5) float32.
    """
    actions = np.zeros((_WARMING_STEPS + steps, missions, ROBOTS, 5), np.float32)
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

    def run(self, seed: int, actions: np.ndarray) -> Taken:
        """What the steps of one mission take; its reset is not timed, later ones are.

        Args:
            seed: Of the mission.
            actions: (steps, A, 5) float32.
        """
        env, named = self.env, by_agent(actions)

        def advance() -> None:
            for action in named[_WARMING_STEPS:]:
                if not env.agents:
                    env.reset()
                env.step(action)

        env.reset(seed=seed)
        for action in named[:_WARMING_STEPS]:
            env.step(action)
        taken = timed(advance)
        if not env.scenario.shares_summaries:
            check_bursts(env.missions.state.robots, env.scenario.channel.burst)
        return taken

    def run_some(self, seeds: Sequence[int], actions: np.ndarray) -> Taken:
        """What some missions of a batch take, one after the other.

        Args:
            seeds: Which of them.
            actions: (steps, E, A, 5) float32.
        """
        taken = [self.run(seed, actions[:, seed]) for seed in seeds]
        return Taken(sum(t.cpu_s for t in taken), sum(t.wall_s for t in taken))


def step_rates(scenarios: Mapping[str, Scenario], effort: Effort) -> dict[str, list[float]]:
    """Steps a second of processor time of one ParallelEnv of each scenario, round by round in turns.

    Args:
        scenarios: Name → scenario with the actions of `TURNING`.
        effort: Steps and rounds.
    """
    teams, steps = {name: SingleTeam(scenario) for name, scenario in scenarios.items()}, effort.steps
    for team in teams.values():
        team.run(0, turns(1, 1, 0)[:, 0])

    def job(team: SingleTeam) -> Job:
        return lambda number: team.run(number, turns(steps, 1, number)[:, 0])

    taken = interleave({name: job(team) for name, team in teams.items()}, effort.rounds)
    return {name: [steps / t.cpu_s for t in taken[name]] for name in taken}


def by_agent(actions: np.ndarray) -> list[dict[str, np.ndarray]]:
    """Actions (steps, A, 5) of one mission as the dicts that a ParallelEnv takes."""
    return [dict(zip(TURNING.agents, row, strict=True)) for row in actions]


class Fleet:
    """E ParallelEnvs, stepped one after the other in a Python loop; mission e has seed e."""

    def __init__(self, missions: int) -> None:
        """Make the environments."""
        self.envs = [EntropyExploreEnv(ENDLESS) for _ in range(missions)]

    def run(self, actions: np.ndarray) -> Taken:
        """What the steps take after a reset of all.

        Args:
            actions: (steps, E, A, 5) float32.
        """
        named = list(zip(*(by_agent(actions[:, e]) for e in range(len(self.envs))), strict=True))

        def advance(steps: list[tuple[dict[str, np.ndarray], ...]]) -> None:
            for step in steps:
                for env, action in zip(self.envs, step, strict=True):
                    env.step(action)

        for seed, env in enumerate(self.envs):
            env.reset(seed=seed)
        advance(named[:_WARMING_STEPS])
        return timed(lambda: advance(named[_WARMING_STEPS:]))


class Batch:
    """One VectorEnv of E missions; mission e has seed e, in every round anew."""

    def __init__(self, missions: int, threads: int) -> None:
        """Make the environment."""
        self.missions = missions
        self.env = EntropyExploreVectorEnv(ENDLESS, missions, threads=threads, autoreset_mode="SameStep")

    def run(self, actions: np.ndarray) -> Taken:
        """What the steps take after a reset of all.

        Args:
            actions: (steps, E, A, 5) float32.
        """

        def advance(steps: np.ndarray) -> None:
            for action in steps:
                self.env.step(action)

        self.env.reset(seed=0)
        advance(actions[:_WARMING_STEPS])
        taken = timed(lambda: advance(actions[_WARMING_STEPS:]))
        check_bursts(self.env.missions.state.robots, ENDLESS.channel.burst)
        return taken


def spread_rows(effort: Effort) -> list[Row]:
    """Steps a second of the ParallelEnv beside simple_spread."""
    team, peer, steps = SingleTeam(TURNING), Spread(ROBOTS, seed=0), effort.steps
    peer.run(_WARMING_STEPS)
    taken = interleave(
        {
            "ours": lambda number: team.run(number, turns(steps, 1, number)[:, 0]),
            "spread": lambda _: timed(lambda: peer.run(steps)),
        },
        effort.rounds,
    )
    rates = {name: [steps / t.cpu_s for t in taken[name]] for name in taken}
    job = f"ParallelEnv.step, {ROBOTS} robots × {TURNING.sensor.rays} rays, sharing in each step"
    peer_name = f"mpe2 simple_spread_v3, N = {ROBOTS}"
    return [compared(job, peer_name, rates["ours"], rates["spread"], "steps/s", Goal("≥", 2.0))]


def vector_rows(effort: Effort) -> list[Row]:
    """Robot-steps a second of the VectorEnv beside the ParallelEnv, and of two threads beside one."""
    return [row for missions in effort.batches for row in batch_rows(missions, effort)]


def batch_rows(missions: int, effort: Effort) -> list[Row]:
    """Rows of one batch size: beside one ParallelEnv, as many in a Python loop, and two threads."""
    steps, some = max(effort.batch_steps, effort.steps // missions), min(missions, _SINGLES)
    single, batch = SingleTeam(ENDLESS), Batch(missions, 1)
    jobs: dict[str, Job] = {
        "single": lambda number: single.run_some(
            [(number * some + i) % missions for i in range(some)], turns(steps, missions, number)
        ),
        "batch": lambda number: batch.run(turns(steps, missions, number)),
    }
    if missions == LOOPED:
        fleet = Fleet(missions)
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


def profile_rows(effort: Effort) -> list[Row]:
    """Where a step's time goes, whether Python works once a mission, and what a belief takes."""
    many, few = Batch(max(effort.batches), 1), Batch(16, 1)
    calls = compared(
        f"Python calls in a VectorEnv.step, {many.missions} missions",
        f"{few.missions} missions",
        [python_calls(many)],
        [python_calls(few)],
        "calls",
        Goal("=", 1.0),
    )
    return [*compiled_share(effort), calls, memory_row(few)]


def compiled_share(effort: Effort) -> list[Row]:
    """Microseconds in the compiled call beside those of the whole step."""
    team, batch = SingleTeam(ENDLESS), Batch(LOOPED, 1)
    steps, few = effort.steps, effort.batch_steps
    rows = []
    many = f"VectorEnv.step, {LOOPED} missions"
    for name, missions, run in (
        ("ParallelEnv.step", team.env.missions, lambda n: team.run(n, turns(steps, 1, n)[:, 0])),
        (many, batch.env.missions, lambda n: batch.run(turns(few, LOOPED, n))),
    ):
        inside, whole = [], []
        for number in range(effort.long_rounds):
            watch = Stopwatch(missions.step)
            missions.step = watch  # type: ignore[method-assign,assignment]
            taken = run(number)
            del missions.step
            calls = watch.cpu_s[_WARMING_STEPS:]
            inside.append(1e6 * sum(calls) / len(calls))
            whole.append(1e6 * taken.cpu_s / len(calls))
        rows.append(compared(f"the compiled call in {name}", "the whole step", inside, whole, "µs"))
    return rows


class Stopwatch:
    """Stands in for a function and times every call of it.

    Attributes:
        cpu_s: Processor time of every call.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        """Stand in for a function."""
        self.function = function
        self.cpu_s: list[float] = []

    def __call__(self, *given: object) -> object:
        """Call the function."""
        started = time.thread_time()
        result = self.function(*given)
        self.cpu_s.append(time.thread_time() - started)
        return result


def python_calls(batch: Batch, steps: int = 5) -> float:
    """Calls of Python and C functions in one step."""
    actions = turns(steps, batch.missions, 0)
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
