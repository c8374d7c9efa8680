"""Learning: robot-steps of the whole PPO loop, of collecting alone, and what its time goes into.

`training.ppo` with its defaults in the room, 64 missions × 3 robots, from fresh weights: a robot-step is a
step of one robot of one mission, whether or not the robot could choose. On one and two threads, by the wall
clock, since two threads share the work; validation and checkpoints are left out.
"""

from __future__ import annotations

import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from benchmarks.rows import Effort, Goal, Row, alone, compared
from entropy_explore_env.errors import MissingExtraError

THREADS = (1, 2)
_FULL_ROUNDS = 9
"""An effort of so many long rounds or more is a full one."""


@dataclass(frozen=True)
class Round:
    """What one rollout and what is learned from it took.

    Attributes:
        steps: Robot-steps.
        environment_s: Stepping the missions: sensing, fusing, sharing, observing.
        collecting_s: All of the rollout, the policy's choices included.
        learning_s: Updating the networks.
    """

    steps: int
    environment_s: float
    collecting_s: float
    learning_s: float

    @property
    def whole_s(self) -> float:
        """The loop."""
        return self.collecting_s + self.learning_s


def learning_rounds(threads: int, rounds: int, words: tuple[str, ...] = ()) -> list[Round]:
    """Learn for some rollouts and time each; one before them warms up.

    Args:
        threads: For missions and networks.
        rounds: How many are timed.
        words: Options of `training.ppo`.

    Raises:
        MissingExtraError: PyTorch or Stable-Baselines3 is not installed.
    """
    try:
        import torch
        from stable_baselines3.common.callbacks import BaseCallback

        from baselines.command import parse
        from training.ppo import Args, Run, training_scenario
        from training.terminal import TrainingBar
    except ModuleNotFoundError as error:
        raise MissingExtraError(error.name or "torch", "training") from None

    class Clock(BaseCallback):
        """Notes when rollouts begin and end."""

        def __init__(self) -> None:
            super().__init__()
            self.begun: list[float] = []
            self.ended: list[float] = []
            self.stepping: list[float] = []

        def _on_rollout_start(self) -> None:
            self.begun.append(time.perf_counter())
            self.stepping.append(0.0)

        def _on_step(self) -> bool:
            return True

        def _on_rollout_end(self) -> None:
            self.ended.append(time.perf_counter())

        def _on_training_end(self) -> None:
            self.begun.append(time.perf_counter())

    before = torch.get_num_threads()
    torch.set_num_threads(threads)
    try:
        with tempfile.TemporaryDirectory() as folder:
            args = parse(Args, ["--threads", str(threads), "--out", str(Path(folder) / "run"), *words])
            run, clock = Run(args, training_scenario(args), TrainingBar(1, hidden=True)), Clock()
            step, steps = run.rows.vector_env.step, args.rollout_steps * run.rows.num_envs

            def timed_step(actions: object) -> object:
                began = time.perf_counter()
                result = step(actions)
                clock.stepping[-1] += time.perf_counter() - began
                return result

            run.rows.vector_env.step = timed_step  # pyright: ignore[reportAttributeAccessIssue]
            run.model.learn((1 + rounds) * steps, callback=clock, log_interval=2**31)
            run.validator.close()
            run.rows.close()
    finally:
        torch.set_num_threads(before)
    return [
        Round(steps, clock.stepping[n], clock.ended[n] - clock.begun[n], clock.begun[n + 1] - clock.ended[n])
        for n in range(1, 1 + rounds)
    ]


def learning_rows(effort: Effort, words: tuple[str, ...] = ()) -> list[Row]:
    """Robot-steps a second of the loop and of collecting, and the parts of the loop's time."""
    rounds = 8 if effort.long_rounds >= _FULL_ROUNDS else 2
    found = {threads: learning_rounds(threads, rounds, words) for threads in THREADS}
    whole = {threads: [each.steps / each.whole_s for each in own] for threads, own in found.items()}
    collecting = {threads: [each.steps / each.collecting_s for each in own] for threads, own in found.items()}
    team, unit, two = "64 missions × 3 robots", "robot-steps/s", found[THREADS[-1]]
    loop, rollouts = f"PPO, {team}", f"PPO collecting, {team}"
    return [
        alone(f"{rollouts}, 1 thread", collecting[1], unit),
        compared(f"{rollouts}, 2 threads", "1 thread", collecting[2], collecting[1], unit),
        alone(f"{loop}, 1 thread", whole[1], unit),
        compared(f"{loop}, 2 threads", "1 thread", whole[2], whole[1], unit),
        alone(f"{loop}, 2 threads", whole[2], unit, Goal("≥", 12_000, unit)),
        alone("of that the environment", [_share(r.environment_s, r) for r in two], "%", Goal("≤", 50, "%")),
        alone(
            "of that the policy's choices", [_share(r.collecting_s - r.environment_s, r) for r in two], "%"
        ),
        alone("of that learning", [_share(r.learning_s, r) for r in two], "%"),
    ]


def _share(part_s: float, whole: Round) -> float:
    return 100.0 * part_s / whole.whole_s
