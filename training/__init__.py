"""Learning a policy: trainers, networks, checkpoints, a policy as a strategy; a predictor of maps."""

from __future__ import annotations

import entropy_explore_env  # noqa: F401 - first, so that Ctrl-C is answered while the rest is imported
