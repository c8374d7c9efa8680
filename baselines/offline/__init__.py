"""Missions as data to learn from, without an environment."""
