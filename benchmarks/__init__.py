"""Speed beside peers, measured in the same run."""

from pathlib import Path

import entropy_explore_env
from entropy_explore_env.compilation.kernels import forget_stale_kernels

forget_stale_kernels(Path(__file__).parent, Path(entropy_explore_env.__file__).parent)
