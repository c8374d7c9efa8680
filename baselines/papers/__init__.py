"""Reproductions: one paper a file, each run by `python -m baselines.papers.NAME`."""
