"""Frontiers of maps: where known space ends, how far it is, and what is expected to be seen from there."""
