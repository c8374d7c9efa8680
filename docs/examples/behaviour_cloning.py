"""Behaviour cloning from recorded episodes: `python docs/examples/behaviour_cloning.py results/episodes`."""

import sys

import numpy as np
import pyarrow.parquet as pq
import torch

rows = pq.read_table(sys.argv[1], columns=["observation", "action"], filters=[("decided", "=", True)])
observations, actions = (torch.tensor(np.stack(rows[name].to_numpy())) for name in ("observation", "action"))
observations = (observations - observations.mean(0)) / observations.std(0).clamp(min=1e-3)
layers = torch.nn.Linear(observations.shape[1], 64), torch.nn.Tanh(), torch.nn.Linear(64, actions.shape[1])
policy = torch.nn.Sequential(*layers)
optimiser = torch.optim.Adam(policy.parameters(), lr=3e-3)
for _ in range(200):
    loss = torch.nn.functional.mse_loss(policy(observations), actions)
    optimiser.zero_grad(), loss.backward(), optimiser.step()
    print(f"{loss.item():.4f}")
