"""Bhattacharya's simulation on the cells of a plan."""
