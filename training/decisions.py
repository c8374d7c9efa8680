"""Rollouts of decisions: what a robot chose, what came of it until it chose again, and for how long.

A robot that drives cannot choose; its rows in between are no transitions of their own. Their rewards and
seconds belong to its last decision. Decisions k = 0, 1, … of a row are transitions of a semi-Markov
decision process (Sutton, Precup & Singh 1999): with rewards r at times t,

    R_k = Σ γ^(t - t_k) r(t)  for t_k < t <= t_(k+1),        Γ_k = γ^(t_(k+1) - t_k)
    δ_k = R_k + Γ_k V(s_(k+1)) - V(s_k),                     A_k = δ_k + Γ_k λ A_(k+1)   (GAE)

where γ discounts a second, and what a step brings counts at its end, when the scan is taken; or, where
decisions are discounted, every decision alike: Γ_k = γ and R_k a plain sum. A mission that was cut off goes
on as V says, one that is mapped is worth nothing more. A decision whose outcome lies beyond the rollout is
left out; the one before it leads to its value.
"""

from __future__ import annotations

from collections.abc import Generator
from typing import Any, Literal

import numpy as np
import torch
from stable_baselines3.common.buffers import RolloutBuffer
from stable_baselines3.common.type_aliases import RolloutBufferSamples

from entropy_explore_env.envs.robot_vec_env import RobotVecEnv
from entropy_explore_env.errors import SettingError
from training.errors import NotFiniteError
from training.scales import RunningScale

Discount = Literal["seconds", "decisions"]


class DecisionBuffer(RolloutBuffer):
    """A rollout of T steps of N rows, of which decisions are learned from and nothing else.

    The critic's values are in units of `scale`; here they are turned into returns and back.
    """

    def __init__(
        self,
        *args: Any,  # noqa: ANN401 - as RolloutBuffer has them
        rows: RobotVecEnv,
        discount: Discount,
        scale: RunningScale,
        chance: np.random.Generator,
        **kwargs: Any,  # noqa: ANN401
    ) -> None:
        """Make room.

        Args:
            *args: Of RolloutBuffer.
            rows: Where the transitions come from.
            discount: What γ discounts.
            scale: Of returns; follows them.
            chance: Mixes the decisions into batches.
            **kwargs: Of RolloutBuffer.
        """
        self.rows, self.discount, self.scale, self.chance = rows, discount, scale, chance
        super().__init__(*args, **kwargs)

    def reset(self) -> None:
        """Forget the rollout."""
        super().reset()
        shape = (self.buffer_size, self.n_envs)
        self.decided, self.ended = np.zeros(shape, bool), np.zeros(shape, bool)
        self.elapsed_s, self.gained, self.beyond = np.zeros(shape), np.zeros(shape), np.zeros(shape)

    def add_step(self, beyond: np.ndarray, *step: Any) -> None:  # noqa: ANN401 - as RolloutBuffer has it
        """Take a step.

        Args:
            beyond: (N,) float64, values of the last observations of missions that were cut off, else 0.
            *step: What `add` of RolloutBuffer takes.

        Raises:
            NotFiniteError: A reward is not a finite number.
        """
        place, rows = self.pos, self.rows
        if not np.isfinite(rows.rewards).all():
            raise NotFiniteError("reward", rows.rewards[~np.isfinite(rows.rewards)][0])
        self.decided[place], self.ended[place] = rows.decided, rows.ended
        self.elapsed_s[place], self.gained[place] = rows.elapsed_s, rows.rewards
        self.beyond[place] = np.where(beyond != 0.0, self.scale.restored(beyond), 0.0)
        self.add(*step)

    def compute_returns_and_advantage(self, last_values: torch.Tensor, dones: np.ndarray) -> None:
        """Advantages and returns of the decisions; which rows they are in goes into `complete`."""
        del dones
        values = self.scale.restored(self.values.astype(np.float64))
        after = self.scale.restored(last_values.cpu().numpy().ravel().astype(np.float64))
        known = self.rows.deciding.copy()
        advantage, gained, lasting = (np.full(self.n_envs, start) for start in (0.0, 0.0, 1.0))
        seconds = self.discount == "seconds"
        advantages, self.complete = np.zeros_like(values), np.zeros(values.shape, bool)
        for step in reversed(range(self.buffer_size)):
            ended, decided = self.ended[step], self.decided[step]
            after = np.where(ended, self.beyond[step], after)
            advantage, gained = np.where(ended, 0.0, advantage), np.where(ended, 0.0, gained)
            lasting, known = np.where(ended, 1.0, lasting), known | ended
            fade = self.gamma ** self.elapsed_s[step] if seconds else 1.0
            gained, lasting = fade * (self.gained[step] + gained), fade * lasting
            shrink = lasting if seconds else self.gamma
            found = gained + shrink * after - values[step] + shrink * self.gae_lambda * advantage
            self.complete[step] = decided & known
            advantages[step] = np.where(self.complete[step], found, 0.0)
            after = np.where(decided, values[step], after)
            advantage = np.where(decided, advantages[step], advantage)
            gained, lasting = np.where(decided, 0.0, gained), np.where(decided, 1.0, lasting)
            known = known | decided
        returns = advantages + values
        self.scale.update(returns[self.complete])
        self.values = self.scale.scaled(values).astype(np.float32)
        self.returns = self.scale.scaled(returns).astype(np.float32)
        self.advantages = advantages.astype(np.float32)

    def get(self, batch_size: int | None = None) -> Generator[RolloutBufferSamples, None, None]:
        """The decisions once, in batches of nearly equal size."""
        if not self.generator_ready:
            self._keep_decisions()
        decisions = len(self.actions)
        batches = max(1, round(decisions / (batch_size or decisions)))
        for batch in np.array_split(self.chance.permutation(decisions), batches):
            yield self._get_samples(batch)

    def _keep_decisions(self) -> None:
        """Flatten the rollout to its decisions."""
        chosen = self.complete
        if not chosen.any():
            raise SettingError("rollout_steps", self.buffer_size, "steps in which a robot decides twice")
        for name in ("observations", "actions", "values", "log_probs", "advantages", "returns"):
            kept = getattr(self, name)[chosen]
            setattr(
                self,
                name,
                kept.reshape(len(kept), -1)
                if name in ("values", "log_probs", "advantages", "returns")
                else kept,
            )
        self.generator_ready = True
