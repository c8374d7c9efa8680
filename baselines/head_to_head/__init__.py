"""Strategies head to head, run by `python -m baselines.benchmark`: cells, measures, tables, figures, page."""
