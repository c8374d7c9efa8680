"""Generalised advantages of robots' decisions, and the rollout buffer that holds them.

A robot that drives cannot choose, so the steps in between are no transitions of their own: their rewards and
seconds belong to its latest decision. A robot's decisions k = 0, 1, … are transitions of a semi-Markov
decision process (Sutton, Precup & Singh 1999). With rewards r at times t,

    R_k = Σ γ^(t - t_k) r(t)  for t_k < t <= t_(k+1),        Γ_k = γ^(t_(k+1) - t_k)
    δ_k = R_k + Γ_k V(s_(k+1)) - V(s_k),                     A_k = δ_k + Γ_k λ A_(k+1)   (GAE)

if γ discounts seconds; a step's reward counts at its end, when the scan is taken. If γ discounts decisions,
Γ_k = γ and R_k is the plain sum. After a mission that was cut off, V of its last observation stands for the
rest; after one that is mapped there is nothing more to earn. A decision whose outcome lies beyond the end of
the rollout is left out; the decision before it is bootstrapped with its value.
"""

from __future__ import annotations

import math
from collections.abc import Generator, Mapping
from typing import Any, Literal, NamedTuple

import numpy as np
import torch
from stable_baselines3.common.buffers import RolloutBuffer
from stable_baselines3.common.running_mean_std import RunningMeanStd
from stable_baselines3.common.type_aliases import RolloutBufferSamples

from entropy_explore_env.envs.robot_vec_env import RobotVecEnv
from entropy_explore_env.errors import SettingError
from training.checkpoints import CheckpointError

_MIN_STD = 1e-4
"""A component whose standard deviation is smaller is shifted and not scaled: it never changed so far."""


class Normaliser(RunningMeanStd):
    """Stable-Baselines3's running mean and variance, which may forget, and what they normalise.

    Attributes:
        count: Samples so far, at most `memory`.
        mean: (F,) float64.
        var: (F,) float64.
    """

    def __init__(self, size: int = 1, memory: float = math.inf) -> None:
        """Begin with mean 0 and variance 1, which the first samples replace.

        Args:
            size: F, components of a sample.
            memory: The samples so far weigh at most as much as this many.
        """
        super().__init__(epsilon=0.0, shape=(size,))
        self.memory = memory

    def update(self, arr: np.ndarray) -> None:
        """Add samples (n,) or (n, F)."""
        samples = np.asarray(arr, np.float64).reshape(-1, len(self.mean))
        if len(samples):
            super().update(samples)
            self.count = min(self.count, self.memory)

    @property
    def std(self) -> np.ndarray:
        """(F,) standard deviations; 1 where a component does not change."""
        std = np.sqrt(self.var)
        return np.where(std > _MIN_STD, std, 1.0)

    def normalise(self, values: np.ndarray) -> np.ndarray:
        """Return (values - mean) / std; with one component, of values of any shape."""
        return (values - self.mean) / self.std

    def denormalise(self, values: np.ndarray) -> np.ndarray:
        """Return the inverse of `normalise`."""
        return values * self.std + self.mean

    def arrays(self, name: str) -> dict[str, np.ndarray]:
        """Return what a checkpoint keeps: arrays whose names begin with `name`."""
        return {
            f"{name}_count": np.array(self.count),
            f"{name}_mean": self.mean,
            f"{name}_variance": self.var,
        }

    def load_arrays(self, name: str, arrays: Mapping[str, np.ndarray]) -> None:
        """Take over what `arrays` gave.

        Raises:
            CheckpointError: An array is missing, of another size or not finite. Nothing has changed then.
        """
        wanted = {f"{name}_count": (), f"{name}_mean": self.mean.shape, f"{name}_variance": self.var.shape}
        for part, shape in wanted.items():
            array = arrays.get(part)
            fits = array is not None and array.shape == shape and array.dtype == np.float64
            if array is None or not fits or not np.isfinite(array).all():
                given = None if array is None else array.shape
                raise CheckpointError(f"normalisation: {part}", given, f"{shape} finite float64")
        count, mean, variance = (arrays[part] for part in wanted)
        self.count, self.mean, self.var = float(count), mean, variance


DiscountUnit = Literal["seconds", "decisions"]


class Discounting(NamedTuple):
    """How much the future counts.

    Attributes:
        gamma: γ, the share that is left after one second or one decision.
        gae_lambda: λ of generalised advantage estimation, per decision.
        unit: What γ discounts.
    """

    gamma: float
    gae_lambda: float
    unit: DiscountUnit


class Steps(NamedTuple):
    """What T steps brought N robots; every array is (T, N).

    Attributes:
        decided: Whether the robot chose its action in this step; else it was busy.
        ended: Whether the step ended the robot's mission.
        elapsed_s: Simulated seconds that the step took.
        rewards: float64.
        final_values: V of the last observation of missions that were cut off in this step, else 0.
    """

    decided: np.ndarray
    ended: np.ndarray
    elapsed_s: np.ndarray
    rewards: np.ndarray
    final_values: np.ndarray

    @classmethod
    def empty(cls, steps: int, robots: int) -> Steps:
        """Return a rollout in which nothing was decided or earned."""
        shape = (steps, robots)
        flags, numbers = (np.zeros(shape, bool) for _ in range(2)), (np.zeros(shape) for _ in range(3))
        return cls(*flags, *numbers)


def decision_advantages(
    steps: Steps, values: np.ndarray, last_values: np.ndarray, deciding: np.ndarray, discounting: Discounting
) -> tuple[np.ndarray, np.ndarray]:
    """Return the advantages of decisions by the equations above.

    Args:
        steps: The rollout.
        values: (T, N) V of the observations that the steps began with; read where a robot decided.
        last_values: (N,) V of the observations after the rollout.
        deciding: (N,) whether robots decide after the rollout.
        discounting: γ, λ and what γ discounts.

    Returns:
        Advantages (T, N), 0 where there is none; and (T, N) bool: where there is one.
    """
    gamma, gae_lambda, unit = discounting
    advantages, complete = np.zeros_like(values), np.zeros(values.shape, bool)
    # Of each robot's next decision, going backwards: its value, its advantage, and whether it is in sight;
    # and what came since the present step: discounted rewards, and γ to the power of the seconds.
    next_value, known = last_values, deciding.copy()
    next_advantage, gained = np.zeros(values.shape[1]), np.zeros(values.shape[1])
    decay = np.ones(values.shape[1])
    for step in reversed(range(len(values))):
        ended, decided = steps.ended[step], steps.decided[step]
        next_value = np.where(ended, steps.final_values[step], next_value)
        next_advantage, gained = np.where(ended, 0.0, next_advantage), np.where(ended, 0.0, gained)
        decay, known = np.where(ended, 1.0, decay), known | ended
        step_decay = gamma ** steps.elapsed_s[step] if unit == "seconds" else 1.0
        gained, decay = step_decay * (steps.rewards[step] + gained), step_decay * decay
        discount = decay if unit == "seconds" else gamma
        advantage = gained + discount * next_value - values[step] + discount * gae_lambda * next_advantage
        complete[step] = decided & known
        advantages[step] = np.where(complete[step], advantage, 0.0)
        next_value = np.where(decided, values[step], next_value)
        next_advantage = np.where(decided, advantages[step], next_advantage)
        gained, decay = np.where(decided, 0.0, gained), np.where(decided, 1.0, decay)
        known = known | decided
    return advantages, complete


class DecisionBuffer(RolloutBuffer):
    """A rollout of T steps of N robots, of which only decisions are learned from.

    The critic's values are normalised returns; advantages are in units of the reward.

    Attributes:
        steps: What the steps brought.
        complete: (T, N) bool, the decisions with an advantage: those that are learned from.
        return_stats: Mean and deviation of returns, which every rollout updates.
        rng: Shuffles decisions into minibatches.
    """

    def __init__(
        self,
        *args: Any,  # noqa: ANN401 - as RolloutBuffer has them
        envs: RobotVecEnv,
        discount: DiscountUnit,
        return_stats: Normaliser,
        rng: np.random.Generator,
        **kwargs: Any,  # noqa: ANN401
    ) -> None:
        """Make an empty buffer.

        Args:
            *args: Of RolloutBuffer.
            envs: Where the steps come from.
            discount: What γ discounts.
            return_stats: Mean and deviation of returns.
            rng: Shuffles decisions into minibatches.
            **kwargs: Of RolloutBuffer.
        """
        self.envs, self.return_stats, self.rng = envs, return_stats, rng
        self.discount: DiscountUnit = discount
        super().__init__(*args, **kwargs)

    def reset(self) -> None:
        """Forget the rollout."""
        super().reset()
        self.steps = Steps.empty(self.buffer_size, self.n_envs)

    def add_step(self, final_values: np.ndarray, *step: Any) -> None:  # noqa: ANN401 - as RolloutBuffer has it
        """Add the latest step of the environments.

        Args:
            final_values: (N,) the critic's values of the last observations of missions that were cut off,
                else 0.
            *step: What `add` of RolloutBuffer takes.
        """
        envs, steps, place = self.envs, self.steps, self.pos
        steps.decided[place], steps.ended[place] = envs.decided, envs.ended
        steps.elapsed_s[place], steps.rewards[place] = envs.elapsed_s, envs.rewards
        returns = self.return_stats.denormalise(final_values)
        steps.final_values[place] = np.where(final_values != 0.0, returns, 0.0)
        self.add(*step)

    def compute_returns_and_advantage(self, last_values: torch.Tensor, dones: np.ndarray) -> None:
        """Compute the advantages of the decisions, and their returns, which the critic is to learn."""
        del dones  # the steps say how missions ended
        stats = self.return_stats
        values = stats.denormalise(self.values.astype(np.float64))
        after = stats.denormalise(last_values.cpu().numpy().ravel().astype(np.float64))
        discounting = Discounting(self.gamma, self.gae_lambda, self.discount)
        advantages, self.complete = decision_advantages(
            self.steps, values, after, self.envs.deciding, discounting
        )
        returns = advantages + values
        stats.update(returns[self.complete])
        self.values = stats.normalise(values).astype(np.float32)
        self.returns = stats.normalise(returns).astype(np.float32)
        self.advantages = advantages.astype(np.float32)

    def get(self, batch_size: int | None = None) -> Generator[RolloutBufferSamples, None, None]:
        """Yield every decision once, in minibatches of nearly equal size.

        Raises:
            SettingError: No robot decided twice in the rollout.
        """
        if not self.generator_ready:
            self._keep_decisions()
        decisions = len(self.actions)
        batches = max(1, round(decisions / (batch_size or decisions)))
        for batch in np.array_split(self.rng.permutation(decisions), batches):
            yield self._get_samples(batch)

    def _keep_decisions(self) -> None:
        """Flatten the rollout to its decisions: (K, F) observations and actions, (K, 1) of all else."""
        if not self.complete.any():
            raise SettingError("rollout_steps", self.buffer_size, "steps in which a robot decides twice")
        for name in ("observations", "actions"):
            setattr(self, name, getattr(self, name)[self.complete])
        for name in ("values", "log_probs", "advantages", "returns"):
            setattr(self, name, getattr(self, name)[self.complete].reshape(-1, 1))
        self.generator_ready = True
