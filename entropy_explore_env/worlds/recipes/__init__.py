"""Worlds made from recipes: each takes a grid and a random generator."""
