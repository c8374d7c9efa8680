"""Robots in worlds, many missions at once."""
