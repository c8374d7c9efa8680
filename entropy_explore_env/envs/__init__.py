"""Adapters: missions as PettingZoo and Gymnasium environments."""
