"""Behaviour cloning from recorded episodes: `python docs/examples/behaviour_cloning.py results/episodes`."""

import sys

import numpy as np
import pyarrow.parquet as pq
import torch
from torch.nn import BatchNorm1d, Linear, Sequential, Tanh

rows = pq.read_table(sys.argv[1], columns=["observation", "action"], filters=[("decided", "=", True)])
observations, actions = (torch.tensor(np.stack(column.to_numpy())) for column in rows.columns)
seen, chosen = observations.shape[1], actions.shape[1]
policy = Sequential(BatchNorm1d(seen), Linear(seen, 64), Tanh(), Linear(64, chosen))
optimiser = torch.optim.Adam(policy.parameters(), lr=3e-3)
for _ in range(200):
    loss = (policy(observations) - actions).square().mean()
    policy.zero_grad()
    loss.backward()
    optimiser.step()
print(f"{actions.var(0, correction=0).mean():.4f} {loss.item():.4f}")
