"""Learning: robot-steps of the whole PPO loop, of collecting alone, and what its time goes into.

`training.ppo` with its defaults in the room, 64 missions × 3 robots, from fresh weights: a robot-step is a
step of one robot of one mission, whether or not the robot could choose. On one and two threads, by the wall
clock, since two threads share the work; validation and checkpoints are left out.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from benchmarks.rows import Effort, Goal, Row, alone, compared
from entropy_explore_env.errors import MissingExtraError

THREADS = (1, 2)
PARTS = {"environment": "the environment", "choosing": "the policy's choices", "learning": "learning"}
"""Part of the loop that is timed → its words: stepping the missions, choosing, updating the networks."""


class Loop:
    """A run of `training.ppo` from fresh weights, a rollout at a time."""

    def __init__(self, threads: int, words: tuple[str, ...], folder: Path) -> None:
        """Make it.

        Args:
            threads: For missions and networks.
            words: Options of `training.ppo`.
            folder: For what it writes.

        Raises:
            MissingExtraError: PyTorch or Stable-Baselines3 is not installed.
        """
        try:
            import torch

            from training.ppo import parsed, set_up, training_task
        except ModuleNotFoundError as error:
            raise MissingExtraError(error.name or "torch", "training") from None
        self._torch, self._threads = torch, threads
        args = parsed(["--threads", str(threads), "--out", str(folder / f"run-{threads}"), *words])
        self._state = set_up(args, training_task(args))
        self._steps = args.rollout_steps * self._state.envs.num_envs
        self._spent = dict.fromkeys(PARTS, 0.0)
        model: Any = self._state.model
        self._state.envs.step = self._timed("environment", self._state.envs.step)
        model.choose = self._timed("choosing", model.choose)
        model.train = self._timed("learning", model.train)

    def _timed(self, part: str, work: Callable[..., Any]) -> Any:  # noqa: ANN401 - what stands in for a method
        def timed(*words: object) -> object:
            began = time.perf_counter()
            result = work(*words)
            self._spent[part] += time.perf_counter() - began
            return result

        return timed

    def round(self) -> dict[str, float]:
        """Return the `steps` of a rollout, its `seconds` with the update after it, and those of each part."""
        self._spent = dict.fromkeys(PARTS, 0.0)
        before = self._torch.get_num_threads()
        self._torch.set_num_threads(self._threads)
        began = time.perf_counter()
        try:
            self._state.model.learn(self._steps, log_interval=2**31, reset_num_timesteps=False)
        finally:
            self._torch.set_num_threads(before)
        return {"steps": self._steps, "seconds": time.perf_counter() - began, **self._spent}

    def close(self) -> None:
        """End its threads."""
        self._state.envs.close()


def learning_rounds(
    threads: Sequence[int], rounds: int, words: tuple[str, ...] = ()
) -> dict[int, list[dict[str, float]]]:
    """Learn on this many threads each, taking turns; a rollout of each before warms up."""
    with tempfile.TemporaryDirectory() as folder:
        loops = {count: Loop(count, words, Path(folder)) for count in threads}
        found: dict[int, list[dict[str, float]]] = {count: [] for count in threads}
        for _ in range(1 + rounds):
            for count, loop in loops.items():
                found[count].append(loop.round())
        for loop in loops.values():
            loop.close()
    return {count: own[1:] for count, own in found.items()}


def learning_rows(effort: Effort, words: tuple[str, ...] = ()) -> list[Row]:
    """Return rows of robot-steps a second of the loop and of collecting, and the parts of the loop's time."""
    found = learning_rounds(THREADS, 8 if effort.large else 2, words)
    unit, rows, rates = "robot-steps/s", list[Row](), dict[int, list[float]]()
    for job, collecting in (("PPO collecting", True), ("PPO", False)):
        for threads, own in found.items():
            rates[threads] = [
                each["steps"] / (each["seconds"] - collecting * each["learning"]) for each in own
            ]
        job = f"{job}, 64 missions × 3 robots"
        rows.append(alone(f"{job}, 1 thread", rates[1], unit))
        rows.append(compared(f"{job}, 2 threads", "1 thread", rates[2], rates[1], unit))
    rows.append(alone("PPO, 64 missions × 3 robots, 2 threads", rates[2], unit, Goal("≥", 12_000, unit)))
    rest = [each["seconds"] - sum(each[part] for part in PARTS) for each in found[2]]
    spent = {told: [each[part] for each in found[2]] for part, told in PARTS.items()}
    for told, seconds in {**spent, "keeping the rollout": rest}.items():
        shares = [100.0 * own / each["seconds"] for own, each in zip(seconds, found[2], strict=True)]
        goal = Goal("≤", 50, "%") if told == PARTS["environment"] else None
        rows.append(alone(f"of that {told}", shares, "%", goal))
    return rows
