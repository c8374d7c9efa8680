"""Sujan & Meggiolaro, reproduced in six experiments: `python -m baselines.papers sujan`."""
