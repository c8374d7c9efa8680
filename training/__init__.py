"""Learning a policy: trainers, networks, checkpoints, and a policy as a strategy."""
