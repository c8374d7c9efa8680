"""Proposing candidate viewpoints to a robot in one compiled call, for policies and for strategies."""
