"""Where a command runs its missions: the same two options in every command that runs many.

A command's `Args` inherits WorkerOptions, and hands `args.workers` to `cells.run_cells`.
"""

from __future__ import annotations

import importlib.util
import os
from dataclasses import dataclass

from baselines.experiments.ray_cluster import AUTO, LOCAL, RayCluster, check_address
from entropy_explore_env.errors import MissingExtraError
from entropy_explore_env.validation import check_whole


@dataclass
class WorkerOptions:
    """Processes of this machine, or a cluster."""

    jobs: int | None = None
    """Missions at a time; default: one a processor."""
    cluster: str | None = None
    """Run missions on a Ray cluster: its HOST:PORT, auto for the one that this machine belongs to, local for
    one of this machine alone; default: processes of this machine, without Ray."""

    @property
    def workers(self) -> int | RayCluster:
        """What runs missions.

        Raises:
            SettingError: An option is not allowed.
            MissingExtraError: There is to be a cluster, and Ray is not installed.
        """
        if self.jobs is not None:
            check_whole("jobs", self.jobs, 1)
        if self.cluster is None:
            return self.jobs or os.cpu_count() or 1
        check_address("cluster", self.cluster, AUTO, LOCAL)
        if importlib.util.find_spec("ray") is None:
            raise MissingExtraError("ray", "cluster")
        return RayCluster(self.cluster, self.jobs)
