"""Bhattacharya, Michael and Kumar 2010, reproduced: `python -m baselines.papers.bhattacharya`."""
