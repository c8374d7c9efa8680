"""The measurements of robots' latest scans, which they may send, or send again: see `missions.need`.

Elsewhere `TeamBacklog` is None, and nothing of all this is compiled.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.settings.scenario import Scenario


class Selection(NamedTuple):
    """Scratch memory for one message; S scans of a robot, R rays of a scan."""

    value: np.ndarray  # (S·R,) float64 bits, what each kept measurement is worth
    order: np.ndarray  # (S·R,) int64, the most valuable measurements
    counts: np.ndarray  # (S,) int64, how many measurements of each scan are sent, the latest first
    rays: np.ndarray  # (R, 5) float64, those of one scan


class TeamBacklog(NamedTuple):
    """What one mission's robots keep: slices of MissionState's `backlog_` arrays, and scratch memory."""

    poses: np.ndarray
    rays: np.ndarray
    bits: np.ndarray
    sent_s: np.ndarray
    heard_s: np.ndarray
    covariances: np.ndarray
    selection: Selection


def new_selection(scenario: Scenario) -> Selection | None:
    """Return scratch memory for messages; None where robots do not send by need."""
    scans, rays = scenario.backlog_scans, max(kind.sensor.rays for kind in scenario.kinds)
    if scans == 0:
        return None
    value, order = np.zeros(scans * rays), np.zeros(scans * rays, np.int64)
    return Selection(value, order, np.zeros(scans, np.int64), np.zeros((rays, 5)))


@lean_kernel
def backlog_of(selection, state, mission):
    """Return the TeamBacklog of a mission; None where there is no Selection."""
    if selection is None:  # known while compiling: nothing of the rest is compiled
        return None
    return TeamBacklog(
        state.backlog_poses[mission],
        state.backlog_rays[mission],
        state.backlog_bits[mission],
        state.backlog_sent_s[mission],
        state.backlog_heard_s[mission],
        state.backlog_covariances[mission],
        selection,
    )
