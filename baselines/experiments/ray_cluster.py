"""Ray, started on this machine or joined on a cluster, by whatever command needs it."""
# pyright: reportMissingImports=false

from __future__ import annotations

import contextlib
import logging
import os
import subprocess
import sys
from dataclasses import dataclass
from typing import Any

from entropy_explore_env.errors import EntropyExploreError, SettingError, imported

LOCAL = "local"
"""In place of an address: a cluster of this machine alone, for this command alone."""
AUTO = "auto"
"""In place of an address: the cluster that this machine belongs to."""
ANSWER_TIMEOUT_S = 20.0
"""How long to wait for the answer of a cluster."""
_START_ATTEMPTS = 3
"""Ray gives up a start of which a part takes over 15 s, as on busy machines (ray-project/ray#65983)."""
_OBJECTS_BYTES = 2 * 10**8
"""Shared memory of a cluster of this machine alone: what goes through it is small."""


@dataclass(frozen=True)
class RayCluster:
    """Where work is done in place of processes of this machine.

    Attributes:
        address: HOST:PORT, `auto` or `local`.
        at_once: Limit of tasks that run at a time; None = the number of processors.
    """

    address: str
    at_once: int | None = None


def check_address(option: str, address: str | None, *others: str) -> None:
    """Raise a SettingError unless it is HOST:PORT, None or one of the other words."""
    if address is not None and address not in others and not address.rpartition(":")[2].isdigit():
        allowed = ", or ".join(["HOST:PORT of a Ray cluster", *others])
        raise SettingError(option, address, allowed)


def ray_of(extra: str) -> Any:  # noqa: ANN401 - a module that may not be there
    """Import and return Ray, with its usage reports switched off.

    Raises:
        MissingExtraError: It is not installed; the extra would bring it.
    """
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
    os.environ.setdefault("PYTHONWARNINGS", "ignore::DeprecationWarning")  # Ray's own, in every process
    ray = imported("ray", "ray" if extra == "cluster" else f"ray[{extra}]", extra)
    logging.getLogger("ray").setLevel(logging.ERROR)
    return ray


def start_here(ray: Any, cores: int) -> None:  # noqa: ANN401 - the module
    """Start a cluster of this machine alone, which offers some cores to tasks.

    Raises:
        EntropyExploreError: It does not start.
    """
    for _ in range(_START_ATTEMPTS):
        with contextlib.suppress(Exception):  # Exception itself is what a slow start raises
            ray.init(
                address=LOCAL,
                num_cpus=cores,
                object_store_memory=_OBJECTS_BYTES,
                include_dashboard=False,
                logging_level="ERROR",
                log_to_driver=False,
            )
            return
        ray.shutdown()
    raise EntropyExploreError(f"Ray did not start in {_START_ATTEMPTS} attempts: is this machine overloaded?")


def join(ray: Any, option: str, address: str) -> None:  # noqa: ANN401 - the module
    """Join the cluster at an address that an option gave.

    Raises:
        SettingError: No cluster answers there.
    """
    no_answer = SettingError(option, address, "the address of a Ray cluster that answers")
    if address != AUTO:  # `ray.init` would try for many minutes
        health_check = [sys.executable, "-m", "ray.scripts.scripts", "health-check", "--address", address]
        try:
            subprocess.run(health_check, capture_output=True, timeout=ANSWER_TIMEOUT_S, check=True)
        except subprocess.SubprocessError:
            raise no_answer from None
    try:
        ray.init(address=address, logging_level="ERROR", log_to_driver=False)
    except (ConnectionError, RuntimeError, ValueError):
        raise no_answer from None
