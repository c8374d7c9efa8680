"""The seconds that a mission of the planner still takes, learned from where its maps stand.

Roll-outs that are cut off at their horizon are completed with it. Branches of one state are cut off at nearly
the same place, so that what it gets wrong of a world falls out of their difference.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import torch
from torch import nn
from torch.nn import functional

_UNITS = 32
_EPOCHS, _BATCH = 60, 512
_LEARNING_RATE = 3e-3


class TimeToGo(NamedTuple):
    """A network, and the scales of what goes in and comes out."""

    network: nn.Sequential
    mean: torch.Tensor
    std: torch.Tensor
    scale_s: float

    def seconds(self, numbers: np.ndarray) -> np.ndarray:
        """(...) float64 seconds ≥ 0 from privileged numbers (..., P)."""
        with torch.inference_mode():
            scaled = (torch.as_tensor(np.asarray(numbers, np.float32)) - self.mean) / self.std
            return self.scale_s * functional.softplus(self.network(scaled))[..., 0].double().numpy()


def learn_time_to_go(numbers: np.ndarray, to_go_s: np.ndarray, seed: int = 0) -> TimeToGo:
    """Learn from moments of missions.

    Args:
        numbers: (T, P) privileged numbers.
        to_go_s: (T,) seconds that the mission still took.
        seed: Of weights and order.

    Returns:
        What predicts them, by the least mean of absolute errors, which a few stuck missions do not bend.
    """
    generator = torch.Generator().manual_seed(seed)
    inputs = torch.as_tensor(np.asarray(numbers, np.float32))
    scale_s = max(float(np.mean(to_go_s)), 1e-3)
    targets = torch.as_tensor(np.asarray(to_go_s, np.float32)) / scale_s
    std = inputs.std(dim=0, correction=0)
    mean, std = inputs.mean(dim=0), torch.where(std > 1e-4, std, torch.ones_like(std))
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        first, second = nn.Linear(inputs.shape[1], _UNITS), nn.Linear(_UNITS, _UNITS)
        network = nn.Sequential(first, nn.Tanh(), second, nn.Tanh(), nn.Linear(_UNITS, 1))
    optimiser = torch.optim.Adam(network.parameters(), _LEARNING_RATE)
    scaled = (inputs - mean) / std
    batches = max(1, len(inputs) // _BATCH)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, _EPOCHS * batches)
    for _ in range(_EPOCHS):
        for batch in torch.randperm(len(inputs), generator=generator).chunk(batches):
            predicted = functional.softplus(network(scaled[batch]))[:, 0]
            loss = functional.smooth_l1_loss(predicted, targets[batch], beta=0.05)
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
            schedule.step()
    return TimeToGo(network, mean, std, scale_s)
