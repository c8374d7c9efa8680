"""Strategies of the papers, run and compared; they see what a robot sees, and act as a policy does."""

from __future__ import annotations

import entropy_explore_env  # noqa: F401 - first, so that Ctrl-C is answered while the rest is imported
