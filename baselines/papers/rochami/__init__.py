"""Rocha, Ferreira and Dias (RochaMI), reproduced: `python -m baselines.papers.rochami`."""
