"""Experiments: missions in cells, run by worker processes, resumable; statistics, claims and tables."""
