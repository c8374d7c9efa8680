"""The experiment of `python -m baselines.resilience`: teams whose robots and messages fail."""
