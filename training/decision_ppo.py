"""PPO over robots that decide at times of their own: rollout and update."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from gymnasium import spaces
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback

from entropy_explore_env.envs.robot_vec_env import RobotVecEnv
from training.advantages import DecisionBuffer
from training.errors import NotFiniteError


class DecisionPPO(PPO):
    """Stable-Baselines3's PPO over a RobotVecEnv, whose policy is asked only where robots decide.

    What a busy robot would choose is ignored and its value is never used: neither is computed, and no random
    number is drawn for it. The rollout holds action 0, value 0 and log-probability 0 in its place.
    """

    def start(self, total_steps: int, callback: BaseCallback) -> BaseCallback:
        """Prepare a loop of rollouts and updates up to so many steps, as `learn` does."""
        _, callback = self._setup_learn(total_steps - self.num_timesteps, callback, reset_num_timesteps=False)
        return callback

    def collect_rollouts(
        self,
        env: Any,  # noqa: ANN401 - a RobotVecEnv; the base class has them wider
        callback: BaseCallback,
        rollout_buffer: Any,  # noqa: ANN401 - a DecisionBuffer
        n_rollout_steps: int,
    ) -> bool:
        """Fill the buffer and compute its advantages; False if the callback stopped it.

        Raises:
            NotFiniteError: A reward is not finite.
        """
        threads = torch.get_num_threads()
        torch.set_num_threads(
            1
        )  # a few robots at a time: more threads would only take time from the missions
        try:
            return self._collect(env, callback, rollout_buffer, n_rollout_steps)
        finally:
            torch.set_num_threads(threads)

    def _collect(
        self, env: RobotVecEnv, callback: BaseCallback, rollout_buffer: DecisionBuffer, steps: int
    ) -> bool:
        """As `collect_rollouts`."""
        self.policy.set_training_mode(False)
        rollout_buffer.reset()
        callback.on_rollout_start()
        for _ in range(steps):
            before: Any = self._last_obs
            actions, values, log_probs = self.choose(before, env.deciding)
            within = actions
            if isinstance(self.action_space, spaces.Box):
                within = np.clip(actions, self.action_space.low, self.action_space.high)
            observations: Any
            observations, rewards, dones, infos = env.step(within)
            self.num_timesteps += env.num_envs
            if not np.isfinite(env.rewards).all():
                value = env.rewards[~np.isfinite(env.rewards)][0]
                raise NotFiniteError("reward", value, self.num_timesteps)
            callback.update_locals(locals())
            if not callback.on_step():
                return False
            self._update_info_buffer(infos, dones)
            final_values = self._final_values(dones, infos)
            starts = self._last_episode_starts
            rollout_buffer.add_step(final_values, before, actions, rewards, starts, values, log_probs)
            self._last_obs, self._last_episode_starts = observations, dones
        with torch.no_grad():
            values = self.policy.predict_values(torch.as_tensor(observations))
        rollout_buffer.compute_returns_and_advantage(last_values=values, dones=dones)
        callback.update_locals(locals())
        callback.on_rollout_end()
        return True

    def choose(
        self, observations: np.ndarray, deciding: np.ndarray
    ) -> tuple[np.ndarray, torch.Tensor, torch.Tensor]:
        """Actions (N,) or (N, K), values (N,) and log-probabilities (N,); 0 where a robot does not decide."""
        shape: Any = self.action_space.shape
        rows = [np.zeros((len(deciding), *shape), self.action_space.dtype)]
        rows += [np.zeros(len(deciding), np.float32) for _ in range(2)]
        if deciding.any():
            with torch.no_grad():
                chosen = self.policy(torch.as_tensor(observations[deciding]))
            for all_rows, part in zip(rows, chosen, strict=True):
                all_rows[deciding] = part.numpy().reshape(-1, *all_rows.shape[1:])
        actions, values, log_probs = rows
        return actions, torch.as_tensor(values), torch.as_tensor(log_probs)

    def _final_values(self, dones: np.ndarray, infos: list[dict[str, Any]]) -> np.ndarray:
        """(N,) values of the last observations of missions that were cut off, else 0."""
        values = np.zeros(len(dones))
        cut_off = [row for row in np.flatnonzero(dones) if infos[row]["TimeLimit.truncated"]]
        if cut_off:
            last = np.stack([infos[row]["terminal_observation"] for row in cut_off])
            with torch.no_grad():
                values[cut_off] = self.policy.predict_values(torch.as_tensor(last))[:, 0].numpy()
        return values

    def update(self) -> None:
        """Learn from the rollout, at the learning rate of this moment."""
        self._update_current_progress_remaining(self.num_timesteps, self._total_timesteps)
        self.train()

    def _excluded_save_params(self) -> list[str]:
        """What `save` leaves out: the missions, and the buffer that refers to them."""
        return [*super()._excluded_save_params(), "rollout_buffer_class", "rollout_buffer_kwargs"]
