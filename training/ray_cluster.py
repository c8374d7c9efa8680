"""Starting Ray on this machine, or joining a cluster."""
# pyright: reportMissingImports=false

from __future__ import annotations

import contextlib
import logging
import os
import subprocess
import sys
from typing import Any

from entropy_explore_env.errors import EntropyExploreError, MissingExtraError, SettingError

ANSWER_TIMEOUT_S = 20.0
"""How long to wait for the answer of a cluster."""
_START_ATTEMPTS = 3
"""Ray gives up a start of which a part takes over 15 s, as on busy machines (ray-project/ray#65983)."""


def check_address(address: str | None) -> None:
    """Raise a SettingError unless it is HOST:PORT, `auto` or None."""
    if address is not None and address != "auto" and not address.rpartition(":")[2].isdigit():
        raise SettingError("address", address, "HOST:PORT of a Ray cluster, or auto")


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
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")  # else it reports to its makers
    os.environ.setdefault("PYTHONWARNINGS", "ignore::DeprecationWarning")  # RLlib's, in every process
    try:
        import ray
        import torch  # noqa: F401 - RLlib would fail without it, late and at length
    except ImportError as error:
        raise MissingExtraError("torch" if error.name == "torch" else "ray[rllib]", "rllib") from None
    for name in ("ray", "ray.rllib"):
        logging.getLogger(name).setLevel(logging.ERROR)
    if address is None:
        _start_here(ray, runners)
    else:
        _join(ray, address)
    return ray


def _start_here(ray: Any, runners: int) -> None:  # noqa: ANN401 - the module
    """Start a cluster of this machine alone."""
    cores = max(runners + 1, os.cpu_count() or 1)  # with fewer the runners would wait for ever
    for _ in range(_START_ATTEMPTS):
        with contextlib.suppress(Exception):  # Exception itself is what a slow start raises
            ray.init(
                address="local",
                num_cpus=cores,
                include_dashboard=False,
                logging_level="ERROR",
                log_to_driver=False,
            )
            return
        ray.shutdown()
    raise EntropyExploreError(f"Ray did not start in {_START_ATTEMPTS} attempts: is this machine overloaded?")


def _join(ray: Any, address: str) -> None:  # noqa: ANN401 - the module
    """Join the cluster at an address."""
    no_answer = SettingError("address", address, "that of a Ray cluster that answers")
    if address != "auto":  # `ray.init` would try for many minutes
        health_check = [sys.executable, "-m", "ray.scripts.scripts", "health-check", "--address", address]
        try:
            subprocess.run(health_check, capture_output=True, timeout=ANSWER_TIMEOUT_S, check=True)
        except subprocess.SubprocessError:
            raise no_answer from None
    try:
        ray.init(address=address, logging_level="ERROR", log_to_driver=False)
    except (ConnectionError, RuntimeError, ValueError):
        raise no_answer from None
