"""PPO that asks its policy where robots decide, and nowhere else.

What a busy robot's row would choose is ignored, and its value is never looked at (see `training.decisions`):
neither is worked out, and no chance is drawn for it. Such rows hold action 0, value 0 and log-probability 0.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from gymnasium import spaces
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback

from entropy_explore_env.envs.robot_vec_env import RobotVecEnv
from training.decisions import DecisionBuffer


class DecisionPPO(PPO):
    """Stable-Baselines3's PPO over a RobotVecEnv; its rollouts are those of `PPO` where robots decide."""

    def collect_rollouts(
        self,
        env: Any,  # noqa: ANN401 - a RobotVecEnv; the base class has them wider
        callback: BaseCallback,
        rollout_buffer: Any,  # noqa: ANN401 - a DecisionBuffer
        n_rollout_steps: int,
    ) -> bool:
        """Fill the buffer; see OnPolicyAlgorithm. False if the callback stopped it."""
        threads = torch.get_num_threads()
        torch.set_num_threads(1)  # rows are few, and threads that wait for more take time from the missions
        try:
            return self._collect(env, callback, rollout_buffer, n_rollout_steps)
        finally:
            torch.set_num_threads(threads)

    def _excluded_save_params(self) -> list[str]:
        """What `save` leaves out: the missions, and the buffer that they fill."""
        return [*super()._excluded_save_params(), "rollout_buffer_class", "rollout_buffer_kwargs"]

    def _collect(self, env: RobotVecEnv, callback: BaseCallback, buffer: DecisionBuffer, steps: int) -> bool:
        """As `collect_rollouts`."""
        self.policy.set_training_mode(False)
        buffer.reset()
        callback.on_rollout_start()
        for _ in range(steps):
            last: Any = self._last_obs
            actions, values, log_probs = self._choose(last, env.deciding)
            within = actions
            if isinstance(self.action_space, spaces.Box):
                within = np.clip(actions, self.action_space.low, self.action_space.high)
            observations: Any
            observations, rewards, dones, infos = env.step(within)
            self.num_timesteps += env.num_envs
            callback.update_locals(locals())
            if not callback.on_step():
                return False
            self._update_info_buffer(infos, dones)
            starts = self._last_episode_starts
            beyond = self._values_beyond(dones, infos)
            buffer.add_step(beyond, last, actions, rewards, starts, values, log_probs)
            self._last_obs, self._last_episode_starts = observations, dones
        with torch.no_grad():
            values = self.policy.predict_values(torch.as_tensor(observations))
        buffer.compute_returns_and_advantage(last_values=values, dones=dones)
        callback.update_locals(locals())
        callback.on_rollout_end()
        return True

    def _choose(
        self, observations: np.ndarray, deciding: np.ndarray
    ) -> tuple[np.ndarray, torch.Tensor, torch.Tensor]:
        """Actions (N,) or (N, K), values (N,) and log-probabilities (N,); 0 where a row does not decide."""
        shape: Any = self.action_space.shape
        found = [np.zeros((len(deciding), *shape), self.action_space.dtype)]
        found += [np.zeros(len(deciding), np.float32) for _ in range(2)]
        if deciding.any():
            with torch.no_grad():
                chosen = self.policy(torch.as_tensor(observations[deciding]))
            for whole, part in zip(found, chosen, strict=True):
                whole[deciding] = part.numpy().reshape(-1, *whole.shape[1:])
        actions, values, log_probs = found
        return actions, torch.as_tensor(values), torch.as_tensor(log_probs)

    def _values_beyond(self, dones: np.ndarray, infos: list[dict[str, Any]]) -> np.ndarray:
        """(N,) values of the last observations of missions that were cut off, else 0."""
        beyond = np.zeros(len(dones))
        cut_off = [row for row in np.flatnonzero(dones) if infos[row]["TimeLimit.truncated"]]
        if cut_off:
            last = np.stack([infos[row]["terminal_observation"] for row in cut_off])
            with torch.no_grad():
                beyond[cut_off] = self.policy.predict_values(torch.as_tensor(last))[:, 0].numpy()
        return beyond
