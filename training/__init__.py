"""Trainers, one script each, and what turns a trained policy into a strategy."""
