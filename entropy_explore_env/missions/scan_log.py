"""All scans of a step, for writers of bags: the state keeps only the latest scan of each robot."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from entropy_explore_env.compilation.kernels import lean_kernel


class ScanLog(NamedTuple):
    """Room for N scans of up to R rays; of more scans the latest N are kept, scan n in row n modulo N."""

    count: np.ndarray
    """(1,) int64, scans noted since the reader last set it to 0."""
    time_s: np.ndarray
    """(N,) float64."""
    robot: np.ndarray
    """(N,) int64."""
    pose: np.ndarray
    """(N, 5) float64 where they were taken, map frame."""
    range_m: np.ndarray
    """(N, R) float64."""
    returned: np.ndarray
    """(N, R) int8, codes of `Return`."""


def new_scan_log(scans: int, rays: int) -> ScanLog:
    """Return a log for a number of scans; with 0 nothing is noted."""
    return ScanLog(
        np.zeros(1, np.int64),
        np.zeros(scans),
        np.zeros(scans, np.int64),
        np.zeros((scans, 5)),
        np.zeros((scans, rays)),
        np.zeros((scans, rays), np.int8),
    )


@lean_kernel
def log_scan(log, scan, index, time_s, pose):
    """Note a robot's scan from a pose (5,), if there is room for any."""
    if len(log.time_s) == 0:
        return
    number = log.count[0] % len(log.time_s)
    log.count[0] += 1
    log.time_s[number], log.robot[number] = time_s, index
    for axis in range(5):
        log.pose[number, axis] = pose[axis]
    for ray in range(len(scan.rays)):
        log.range_m[number, ray], log.returned[number, ray] = scan.rays[ray].range_m, scan.rays[ray].returned
