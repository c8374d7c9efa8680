"""Strategies of the papers, run and compared; they see what a robot sees, and act as a policy does."""
