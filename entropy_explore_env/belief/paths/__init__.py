"""Shortest paths through what a robot believes."""
