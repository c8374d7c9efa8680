"""Rocha, Dias and Carvalho 2004, reproduced: `python -m baselines.papers.rocha04`."""
