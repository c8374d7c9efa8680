"""One step of policy improvement over a planner: labels of roll-outs, regression on them, PPO from there."""
