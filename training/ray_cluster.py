"""Starting Ray for a trainer, on this machine or on a cluster."""
# pyright: reportMissingImports=false

from __future__ import annotations

import importlib.util
import logging
import os
from typing import Any

from baselines.experiments import ray_cluster
from entropy_explore_env.errors import MissingExtraError


def check_address(address: str | None) -> None:
    """Raise a SettingError unless it is HOST:PORT, `auto` or None."""
    ray_cluster.check_address("address", address, ray_cluster.AUTO)


def start_ray(address: str | None, runners: int) -> Any:  # noqa: ANN401 - a module that may not be there
    """Ray, started on this machine or joined at an address.

    Args:
        address: HOST:PORT of a cluster, `auto` for the one that this machine belongs to, or None for this
            machine alone.
        runners: Processes that will collect experience.

    Raises:
        MissingExtraError: It is not installed.
        SettingError: No cluster answers at the address.
        EntropyExploreError: It does not start.
    """
    # Else Ray says of each runner that it could not be restarted without this process: ray-project/ray#53727
    os.environ.setdefault("RAY_BACKEND_LOG_LEVEL", "fatal")
    ray = ray_cluster.ray_of("rllib")
    if importlib.util.find_spec("tree") is None:
        raise MissingExtraError("ray[rllib]", "rllib")  # Ray is there, RLlib is not
    logging.getLogger("ray.rllib").setLevel(logging.ERROR)
    if address is None:  # with fewer cores than this the runners would wait for ever
        ray_cluster.start_here(ray, max(runners + 1, os.cpu_count() or 1))
    else:
        ray_cluster.join(ray, "address", address)
    return ray
