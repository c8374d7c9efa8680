"""Strategies head to head, run by `python -m baselines.benchmark`: cells, rows, figures, page."""
