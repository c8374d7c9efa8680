"""Where a command runs its missions, and which again: the same options in every command that runs many.

A command's `Args` inherits WorkerOptions or TrialOptions, and hands `args.workers` or `args.how` on.
"""

from __future__ import annotations

import importlib.util
import math
import os
from dataclasses import dataclass
from typing import TYPE_CHECKING

from baselines.experiments.ray_cluster import AUTO, LOCAL, RayCluster, check_address
from entropy_explore_env.errors import MissingExtraError
from entropy_explore_env.settings.validation import check_whole

if TYPE_CHECKING:
    from baselines.experiments.trials import How


@dataclass
class WorkerOptions:
    """Processes of this machine, or a cluster."""

    jobs: int | None = None
    """Missions at a time; default: one per processor."""
    cluster: str | None = None
    """Ray cluster to run missions on: HOST:PORT, auto for the one that this machine belongs to, local for one
    of this machine alone; default: processes of this machine."""

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


@dataclass
class TrialOptions(WorkerOptions):
    """Where trials run, and which of them again."""

    rerun: bool = False
    """Run all missions, also those that are done."""
    since: str | None = None
    """Run missions again that are older than this git commit."""

    def how(self, title: str, quiet: bool, limit_s: float = math.inf, **more: bool | float) -> How:
        """Return how trials are run; further words are other fields of `How`.

        Raises:
            SettingError: An option is not allowed, or contradicts another one.
        """
        from baselines.experiments.trials import How  # the environments: after the help

        named = {"rerun": self.rerun, "since": self.since, "limit_s": limit_s, **more}
        return How(self.workers, title, quiet, **named)
