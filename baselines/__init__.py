"""Strategies of the papers, run and compared; they see what a robot sees, and act as a policy does."""

from pathlib import Path

import entropy_explore_env
from entropy_explore_env.compilation.kernels import forget_stale_kernels

forget_stale_kernels(Path(__file__).parent, Path(entropy_explore_env.__file__).parent)
