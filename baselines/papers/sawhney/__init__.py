"""Sawhney, Krishna and Srinathan 2009, reproduced: `python -m baselines.papers.sawhney`."""
