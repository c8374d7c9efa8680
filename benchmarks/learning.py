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
from typing import Any, NamedTuple

from benchmarks.rows import Effort, Goal, Row, alone, compared
from entropy_explore_env.errors import MissingExtraError

THREADS = (1, 2)


class Round(NamedTuple):
    """What one rollout and the update of the networks took.

    Attributes:
        steps: Robot-steps.
        environment_s: Stepping the missions: sensing, fusing, sharing, observing.
        choosing_s: The policy's choices.
        collecting_s: The rollout: both, and keeping what came of it.
        learning_s: Updating the networks.
    """

    steps: int
    environment_s: float
    choosing_s: float
    collecting_s: float
    learning_s: float

    @property
    def whole_s(self) -> float:
        """The loop."""
        return self.collecting_s + self.learning_s


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
        self._spent = {"environment": 0.0, "choosing": 0.0, "learning": 0.0}
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

    def round(self) -> Round:
        """One rollout, and what is learned from it."""
        self._spent = dict.fromkeys(self._spent, 0.0)
        before = self._torch.get_num_threads()
        self._torch.set_num_threads(self._threads)
        began = time.perf_counter()
        try:
            self._state.model.learn(self._steps, log_interval=2**31, reset_num_timesteps=False)
        finally:
            self._torch.set_num_threads(before)
        whole_s, spent = time.perf_counter() - began, self._spent
        collecting_s = whole_s - spent["learning"]
        return Round(self._steps, spent["environment"], spent["choosing"], collecting_s, spent["learning"])

    def close(self) -> None:
        """End its threads."""
        self._state.envs.close()


def learning_rounds(
    threads: Sequence[int], rounds: int, words: tuple[str, ...] = ()
) -> dict[int, list[Round]]:
    """Learn on this many threads each, taking turns; a rollout of each before warms up."""
    with tempfile.TemporaryDirectory() as folder:
        loops = {count: Loop(count, words, Path(folder)) for count in threads}
        found: dict[int, list[Round]] = {count: [] for count in threads}
        for _ in range(1 + rounds):
            for count, loop in loops.items():
                found[count].append(loop.round())
        for loop in loops.values():
            loop.close()
    return {count: own[1:] for count, own in found.items()}


def learning_rows(effort: Effort, words: tuple[str, ...] = ()) -> list[Row]:
    """Robot-steps a second of the loop and of collecting, and the parts of the loop's time."""
    found = learning_rounds(THREADS, 8 if effort.large else 2, words)
    whole = {threads: [each.steps / each.whole_s for each in own] for threads, own in found.items()}
    collecting = {threads: [each.steps / each.collecting_s for each in own] for threads, own in found.items()}
    unit, rows = "robot-steps/s", list[Row]()
    for job, rates in (("PPO collecting", collecting), ("PPO", whole)):
        job = f"{job}, 64 missions × 3 robots"
        rows.append(alone(f"{job}, 1 thread", rates[1], unit))
        rows.append(compared(f"{job}, 2 threads", "1 thread", rates[2], rates[1], unit))
    rows.append(alone("PPO, 64 missions × 3 robots, 2 threads", whole[2], unit, Goal("≥", 12_000, unit)))
    shares = {
        "the environment": [each.environment_s / each.whole_s for each in found[2]],
        "the policy's choices": [each.choosing_s / each.whole_s for each in found[2]],
        "learning": [each.learning_s / each.whole_s for each in found[2]],
        "keeping the rollout": [
            (each.collecting_s - each.environment_s - each.choosing_s) / each.whole_s for each in found[2]
        ],
    }
    goals = {"the environment": Goal("≤", 50, "%")}
    for part, share in shares.items():
        rows.append(alone(f"of that {part}", [100.0 * each for each in share], "%", goals.get(part)))
    return rows
