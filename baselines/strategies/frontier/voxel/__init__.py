"""Frontier candidates in plans and any 3-D space."""
