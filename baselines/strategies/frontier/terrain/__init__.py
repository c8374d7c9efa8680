"""Frontier candidates over a height field below an exposure surface."""
