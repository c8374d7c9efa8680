"""Faults of a mission's robots: when they happen, and what of messages and scans they spoil.

In a scenario without faults `TeamFaults` is None, and nothing of all this is compiled.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.missions.records import FAULT
from entropy_explore_env.randomness import Stream, draw_uniform, splitmix_states
from entropy_explore_env.robots.faults import drop_scan, spoil_scan
from entropy_explore_env.settings.faults import Outage
from entropy_explore_env.settings.scenario import Scenario

OUTAGES = ("stop", "blind", "silent")
"""Those of Faults; in FAULT, `…_s` and `…_until_s` are when they begin and end."""
_EARLIEST_S = 1e-3


class TeamFaults(NamedTuple):
    """The faults of one mission's robots."""

    params: np.ndarray
    """(A,) FAULT_PARAMS."""
    states: np.ndarray
    """(A,) FAULT, a slice of MissionState."""


def draw_faults(scenario: Scenario, seed: int, episode: int, states: np.ndarray) -> None:
    """Draw when a mission's faults happen, and set their random states.

    Args:
        states: (A,) FAULT, filled in; nothing happens where it is empty.
    """
    if not len(states):
        return
    robots = scenario.robots
    words = splitmix_states(seed, episode, Stream.FAULTS, 3 * robots).reshape(3, robots, 1)
    states["sensor_rng"], states["radio_rng"] = words[1], words[2]
    for robot in range(robots):
        for name in OUTAGES:  # each draws in any case, so that none changes another
            share = draw_uniform(words[0, robot])
            begin_s, end_s = _outage_s(getattr(scenario.faults, name), robot, share)
            states[robot][f"{name}_s"], states[robot][f"{name}_until_s"] = begin_s, end_s


def _outage_s(outage: Outage, robot: int, share: float) -> tuple[float, float]:
    """Return when an outage of a robot begins and ends; `share` is drawn uniformly from [0, 1)."""
    if outage.robots and robot not in outage.robots:
        return math.inf, math.inf
    drawn_s = math.inf if math.isinf(outage.mean_s) else -outage.mean_s * math.log1p(-share)
    begin_s = min(outage.at_s, max(drawn_s, _EARLIEST_S))
    return begin_s, begin_s + outage.lasts_s


def failing(states: np.ndarray, time_s: np.ndarray | float) -> dict[str, np.ndarray]:
    """Return which robots, of (…, A) FAULT, stand still, are blind or silent at a time, a number or (…, 1).

    Returns:
        `stopped`, `blind` and `silent`, (…, A) bool. A robot that stands still is said to be neither of the
        other two by itself.
    """
    names = {"stop": "stopped", "blind": "blind", "silent": "silent"}
    return {
        names[name]: (states[f"{name}_s"] <= time_s) & (time_s < states[f"{name}_until_s"])
        for name in OUTAGES
    }


def fault_counts(states: np.ndarray) -> dict[str, int]:
    """Return what faults did up to now, summed over the team (A,) FAULT."""
    counted = ("blind_scans", "rays_lost")
    messages = ("messages_silenced", "messages_garbled", "messages_repeated", "messages_late")
    return {"robots_stopped": int(states["stopped"].sum())} | {
        name: int(states[name].sum()) for name in (*counted, *messages)
    }


@lean_kernel
def faults_of(params, states, mission):
    """Return the TeamFaults of a mission; None where there are none."""
    if params is None:  # known while compiling: nothing of the rest is compiled
        return None
    return TeamFaults(params, states[mission])


@lean_kernel
def next_stop(faults):
    """Return (robot, time) of the next robot that stops; the time is inf if none does."""
    soonest, soonest_s = 0, math.inf
    if faults is None:  # known while compiling: nothing of the rest is compiled
        return soonest, soonest_s
    for index in range(len(faults.states)):
        state = faults.states[index]
        if not state.stopped and state.stop_s < soonest_s:
            soonest, soonest_s = index, state.stop_s
    return soonest, soonest_s


@lean_kernel
def stops_counted(faults):
    """Return how many robots have stopped so far."""
    if faults is None:  # known while compiling: nothing of the rest is compiled
        return 0
    stops = 0
    for state in faults.states:
        stops += int(state.stopped)
    return stops


@lean_kernel
def note_stop(faults, index):
    """Count that a robot stops now; returns when it works again."""
    if faults is None:  # known while compiling: nothing of the rest is compiled
        return math.inf
    faults.states[index].stopped = True
    return faults.states[index].stop_until_s


@lean_kernel
def gone(faults, index):
    """Return whether a robot has stopped for good."""
    if faults is None:  # known while compiling: nothing of the rest is compiled
        return False
    state = faults.states[index]
    return state.stopped and math.isinf(state.stop_until_s)


@lean_kernel
def all_gone(faults):
    """Return whether all robots have stopped for good."""
    if faults is None:  # known while compiling: nothing of the rest is compiled
        return False
    for index in range(len(faults.states)):
        if not gone(faults, index):
            return False
    return True


@lean_kernel
def switched_off(faults, index, time_s):
    """Return whether a robot stands still by a fault."""
    if faults is None:  # known while compiling: nothing of the rest is compiled
        return False
    state = faults.states[index]
    return state.stopped and time_s < state.stop_until_s


@lean_kernel
def radio_silent(faults, index, time_s):
    """Return whether a robot neither sends nor hears."""
    if faults is None:  # known while compiling: nothing of the rest is compiled
        return False
    state = faults.states[index]
    return switched_off(faults, index, time_s) or state.silent_s <= time_s < state.silent_until_s


@lean_kernel
def count_silenced(faults, index, count):
    """Count messages that a robot's radio did not send, or did not hear."""
    if faults is None:  # known while compiling: nothing of the rest is compiled
        return
    faults.states[index].messages_silenced += count


@lean_kernel
def draw_lateness(faults, index):
    """Return the seconds that a robot's radio holds back the message that it is to send now."""
    if faults is None:  # known while compiling: nothing of the rest is compiled
        return 0.0
    params, state = faults.params[index], faults.states[index]
    if params.late > 0.0 and draw_uniform(state.radio_rng) < params.late:
        state.messages_late += 1
        return params.late_s
    return 0.0


@lean_kernel
def takes_in(faults, robot, index, time_s, bits):
    """Return whether a robot's radio hands over a message that reaches it now; counts what goes wrong.

    Args:
        robot: ROBOT; hears a message that arrives twice a second time.
        bits: What the message costs.
    """
    if faults is None:  # known while compiling: nothing of the rest is compiled
        return True
    if radio_silent(faults, index, time_s):
        count_silenced(faults, index, 1)
        return False
    params, state = faults.params[index], faults.states[index]
    if params.garbled > 0.0 and draw_uniform(state.radio_rng) < params.garbled:
        state.messages_garbled += 1
        return False
    if params.repeated > 0.0 and draw_uniform(state.radio_rng) < params.repeated:
        state.messages_repeated += 1
        robot.messages_received += 1
        robot.bits_received += bits
    return True


@lean_kernel
def blinded(faults, index, time_s):
    """Return whether a robot's scans measure nothing by a fault."""
    if faults is None:  # known while compiling: nothing of the rest is compiled
        return False
    state = faults.states[index]
    return state.blind_s <= time_s < state.blind_until_s


@lean_kernel
def spoil(faults, index, scan, sensor, scene, pose, time_s):
    """Let a scan measure what the robot's sensor measures as it is.

    Args:
        scan: Scan as `take_scan` filled it in; changed in place.
    """
    if faults is None:  # known while compiling: nothing of the rest is compiled
        return
    params, state = faults.params[index], faults.states[index]
    if blinded(faults, index, time_s):
        drop_scan(scan)
        state.blind_scans += 1
    else:
        state.rays_lost += spoil_scan(scan, params, sensor.params[0], scene, pose.start, state.sensor_rng)


COUNTED = tuple(name for name in FAULT.names or () if name.startswith(("blind_scans", "rays_", "messages_")))
"""Fields of FAULT that count from the mission's start."""
