"""What missions cost, and what a cluster adds: `python -m benchmarks.scale --out docs/results`.

Writes scale.md: processor seconds and bytes of robot-steps, how busy Ray keeps its workers, and what follows
for 10⁹ robot-steps and 10⁶ missions. `--only costs` leaves the cluster out.
"""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np

from baselines.cli.arguments import given_options, make_folder, parse, run_command
from baselines.experiments.cells import Cell, CellMission
from baselines.experiments.machine import processor
from baselines.experiments.mission import Surroundings, figures_record, run_mission, scripted_env
from baselines.experiments.outcome import Outcome
from baselines.experiments.ray_cluster import LOCAL, RayCluster, ray_of, start_here
from baselines.experiments.tables import markdown_table
from baselines.experiments.worker_pool import Failure, run_each
from baselines.strategies import make_strategy
from entropy_explore_env.decision_settings import Observation
from entropy_explore_env.envs.vector_env import EntropyExploreVectorEnv
from entropy_explore_env.scenario import with_settings
from entropy_explore_env.scenarios import ROOM
from entropy_explore_env.validation import check_whole
from entropy_explore_env.writing import write_atomically

_SLEEPERS = 8
_SLEEP_S = 1.0
_IDLE = 0.5
"""Processes that may want the processors while two workers are compared with one."""
_TEAM = with_settings(ROOM, {"robots": 3})
_STRATEGIES = ("random", "planned-rate")
_OBSERVED = Observation(panorama_utility="log2", flat=True, while_busy=False)


@dataclass
class Args:
    """Measure what missions cost, and what a cluster adds."""

    out: Path = Path("results/scale")
    """Folder for scale.md."""
    missions: int = 8
    """Of each strategy, and on each number of workers."""
    only: Literal["all", "costs"] = "all"
    """costs: without the cluster."""


class Cost(NamedTuple):
    """What some missions took.

    Attributes:
        name: What ran.
        robot_steps: Steps times robots.
        missions: How many were played to their ends.
        processor_s: On one core.
        size: Bytes that were kept, if any.
    """

    name: str
    robot_steps: int
    missions: float
    processor_s: float
    size: int = 0

    @property
    def million_s(self) -> float:
        """Processor seconds of a million robot-steps."""
        return 1e6 * self.processor_s / self.robot_steps


def strategy_cost(name: str, missions: int) -> Cost:
    """Missions of a strategy in the room, three robots, one after the other; the first one warms up."""
    env, strategy = scripted_env(_TEAM), make_strategy(name)
    steps = 0

    def count(_: object) -> None:
        nonlocal steps
        steps += 1

    run_mission(env, strategy, 0)
    began_s = time.process_time()
    for seed in range(1, missions + 1):
        run_mission(env, strategy, seed, before_step=count)
    return Cost(f"missions of `{name}`", 3 * steps, missions, time.process_time() - began_s)


def batch_cost(steps: int) -> Cost:
    """Steps of 64 missions in one batch, with observations for a policy and actions of chance."""
    scenario = with_settings(_TEAM, {"observation": _OBSERVED, "decision_period_s": None})
    env = EntropyExploreVectorEnv(scenario, 64, threads=1, action_masks=False)
    env.reset(seed=0)
    rng, shape = np.random.default_rng(0), env.action_space.shape
    assert shape is not None
    actions = rng.uniform(-1.0, 1.0, (8, *shape)).astype(np.float32)
    env.step(actions[0])
    began_s = time.process_time()
    for step in range(steps):
        env.step(actions[step % 8])
    spent_s = time.process_time() - began_s
    env.close()
    return Cost("64 missions in a batch, observed", 64 * 3 * steps, 0.0, spent_s)


def episodes_cost(missions: int, folder: Path) -> Cost:
    """Missions that are written as Parquet."""
    from baselines.offline.recorded_env import observed_scenario
    from baselines.offline.shards import Shard

    recorded = observed_scenario(_TEAM, _OBSERVED)
    shard = Shard(recorded, "planned-rate", Surroundings(), 0, missions, str(folder))
    began_s = time.process_time()
    record = shard.run().record
    spent_s = time.process_time() - began_s
    steps = record["rows"] - 3 * missions
    return Cost("`planned-rate` as Parquet (`baselines.episodes`)", steps, missions, spent_s, record["bytes"])


def sleep(seconds: float) -> float:
    """A mission that needs no processor."""
    time.sleep(seconds)
    return seconds


def play(mission: CellMission) -> Outcome:
    """A mission of the room."""
    return mission.run()


def wall_s(work: Callable[..., object], tasks: Sequence[object], workers: int) -> float:
    """Seconds on the clock for some tasks on a Ray cluster of this machine whose workers are there.

    Raises:
        RuntimeError: A task failed.
    """
    ray = ray_of("cluster")
    start_here(ray, workers)
    try:
        for timed in (False, True):
            began_s = time.perf_counter()
            for _, result in run_each(work, tasks[: None if timed else 3 * workers], RayCluster(LOCAL)):
                if isinstance(result, Failure):
                    result.throw()
        return time.perf_counter() - began_s
    finally:
        ray.shutdown()


def cluster_rows(missions: int) -> list[tuple[str, str, str]]:
    """How busy Ray keeps its workers; how much faster two are is not measured where other work runs."""
    others = os.getloadavg()[0] if hasattr(os, "getloadavg") else 0.0
    slept_s = wall_s(sleep, [_SLEEP_S] * (8 * _SLEEPERS), _SLEEPERS)
    share = 8 * _SLEEPERS * _SLEEP_S / _SLEEPERS / slept_s
    slept = f"{_SLEEPERS} workers, {8 * _SLEEPERS} tasks that sleep {_SLEEP_S:g} s"
    two = f"{4 * missions} missions of the room, 2 workers instead of 1"
    if others > _IDLE:
        gain = f"not measured: {others:.1f} other processes wanted the processors"
    else:
        cell = Cell("room", _TEAM, "planned-rate", 4 * missions, figures_record)
        played = [CellMission(cell, seed) for seed in range(4 * missions)]
        one_s, two_s = (wall_s(play, played, workers) for workers in (1, 2))
        gain = f"{one_s / two_s:.2f} ×"
    return [(slept, "busy", f"{share:.1%}"), (two, "faster", gain)]


def page(costs: Sequence[Cost], cluster: Sequence[tuple[str, str, str]], command: str) -> str:
    """The page of results."""
    rows = [
        (
            cost.name,
            f"{cost.robot_steps:,}",
            f"{cost.million_s:,.0f}",
            f"{cost.processor_s / cost.missions:.2f}" if cost.missions else "-",
            f"{cost.size / cost.robot_steps:,.0f}" if cost.size else "-",
        )
        for cost in costs
    ]
    needs = [
        (
            cost.name,
            f"{1e3 * cost.million_s / 3600:,.0f}",
            f"{1e6 * cost.processor_s / cost.missions / 3600:,.0f}" if cost.missions else "-",
            f"{cost.size / cost.robot_steps:,.0f} GB" if cost.size else "-",
        )
        for cost in costs
    ]
    head = [
        "what",
        "robot-steps measured",
        "processor s a million robot-steps",
        "s a mission",
        "bytes a robot-step",
    ]
    parts = [
        "# What scale costs\n",
        f"Made by `{command}` on {processor()}, {os.cpu_count()} processors. The room, three robots; "
        "seconds are those of one processor, whatever else ran.\n",
        markdown_table(head, rows),
        "From these figures, with as many cores as one likes:\n",
        markdown_table(
            ["what", "10⁹ robot-steps, core-hours", "10⁶ missions, core-hours", "10⁹ robot-steps kept"], needs
        ),
    ]
    if cluster:
        parts += [
            "What Ray adds, on a cluster of this machine whose workers are there (by the clock, so that "
            "other work counts):\n",
            markdown_table(["what", "", "measured"], cluster),
        ]
    return "\n".join(parts)


def main(words: Sequence[str]) -> int:
    """Run the command."""
    args = parse(Args, words, description=__doc__)
    check_whole("missions", args.missions, 1)
    make_folder("out", args.out)
    with tempfile.TemporaryDirectory() as folder:
        costs = [
            batch_cost(200),
            *(strategy_cost(name, args.missions) for name in _STRATEGIES),
            episodes_cost(args.missions, Path(folder)),
        ]
    cluster = [] if args.only == "costs" else cluster_rows(args.missions)
    words = given_options(args, leave_out=("out",))
    text = page(costs, cluster, " ".join(["python -m benchmarks.scale", *words, "--out docs/results"]))
    write_atomically(args.out / "scale.md", text)
    print(text)
    return 0


if __name__ == "__main__":
    raise SystemExit(run_command(main))
