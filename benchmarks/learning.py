"""Learning: robot-steps of the whole PPO loop, and what its time goes into.

`training.ppo` with its defaults in the room, 64 missions × 3 robots, from fresh weights: a robot-step is a
step of one robot of one mission, whether or not the robot could choose. On one and two threads, by the wall
clock, since two threads share the work; validation and checkpoints are left out.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from benchmarks.rows import Effort, Goal, Row, alone, compared
from entropy_explore_env.errors import MissingExtraError

THREADS = (1, 2)
PARTS = {"environment": "the environment", "choosing": "the policy's choices", "learning": "learning"}
"""Part of the loop that is timed → its words: stepping the missions, choosing, updating the networks."""

Rollout = Callable[[], dict[str, float]]
"""Does a rollout and the update after it; returns its `steps`, `seconds`, and those of PARTS."""


def loop(threads: int, words: Sequence[str], folder: Path, stack: ExitStack) -> Rollout:
    """Set up a run of `training.ppo` with options, from fresh weights; the stack ends its threads.

    Raises:
        MissingExtraError: PyTorch or Stable-Baselines3 is not installed.
    """
    try:
        import torch

        from training.ppo import parsed, set_up, training_task
    except ModuleNotFoundError as error:
        raise MissingExtraError(error.name or "torch", "training") from None
    args = parsed(["--threads", str(threads), "--out", str(folder / f"run-{threads}"), *words])
    state, spent = set_up(args, training_task(args)), dict[str, float]()
    stack.callback(torch.set_num_threads, torch.get_num_threads())
    stack.callback(state.envs.close)
    steps, model = args.rollout_steps * state.envs.num_envs, state.model

    def timed(part: str, work: Callable[..., Any]) -> Any:  # noqa: ANN401 - what stands in for a method
        def work_in_time(*words: object) -> object:
            began = time.perf_counter()
            result = work(*words)
            spent[part] += time.perf_counter() - began
            return result

        return work_in_time

    def learn() -> dict[str, float]:
        spent.update(dict.fromkeys(PARTS, 0.0))
        torch.set_num_threads(threads)
        began = time.perf_counter()
        model.learn(steps, log_interval=2**31, reset_num_timesteps=False)
        return {"steps": steps, "seconds": time.perf_counter() - began, **spent}

    state.envs.step = timed("environment", state.envs.step)
    for part, method in (("choosing", "choose"), ("learning", "train")):
        setattr(model, method, timed(part, getattr(model, method)))
    return learn


def learning_rounds(
    threads: Sequence[int], rounds: int, words: tuple[str, ...] = ()
) -> dict[int, list[dict[str, float]]]:
    """Learn on this many threads each, taking turns; a rollout of each before warms up."""
    found: dict[int, list[dict[str, float]]] = {count: [] for count in threads}
    with tempfile.TemporaryDirectory() as folder, ExitStack() as stack:
        loops = {count: loop(count, words, Path(folder), stack) for count in threads}
        for _ in range(1 + rounds):
            for count, learn in loops.items():
                found[count].append(learn())
    return {count: own[1:] for count, own in found.items()}


def learning_rows(effort: Effort, words: tuple[str, ...] = ()) -> list[Row]:
    """Return rows of robot-steps a second of the loop, and the parts of the loop's time."""
    found = learning_rounds(THREADS, 8 if effort.large else 2, words)
    one, two = ([each["steps"] / each["seconds"] for each in own] for own in found.values())
    job, unit = "PPO, 64 missions × 3 robots, 2 threads", "robot-steps/s"
    rows = [compared(job, "1 thread", two, one, unit), alone(job, two, unit, Goal("≥", 12_000, unit))]
    shares = {
        told: [100.0 * each[part] / each["seconds"] for each in found[2]] for part, told in PARTS.items()
    }
    shares["keeping the rollout"] = [100.0 - sum(each) for each in zip(*shares.values(), strict=True)]
    goals = {PARTS["environment"]: Goal("≤", 50, "%")}
    return rows + [alone(f"of that {told}", own, "%", goals.get(told)) for told, own in shares.items()]
