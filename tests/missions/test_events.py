"""Which event of a mission is next, and that each is used up, so that no step lasts for ever."""

import math
import os
import subprocess
import sys

import numpy as np
import pytest

from entropy_explore_env.missions.events import InFlight, events_handled, next_event
from entropy_explore_env.missions.faults import TeamFaults
from entropy_explore_env.missions.phases import TeamPhases
from entropy_explore_env.missions.records import FAULT, MESSAGE, ROBOT
from entropy_explore_env.missions.rules import PARAMS
from entropy_explore_env.robots.faults import FAULT_PARAMS
from tests.reference.scenes import free_box, started

NOTHING, MESSAGES, BROADCAST, ROBOTS, STOPS = range(5)
NEVER = math.inf


def in_phases(repeats):
    """The phases of a mission in which so far nothing was collected."""
    state = started(free_box(robots=3, channel={"phase_s": 6.0, "repeats": repeats})).state
    batches = state.phase_counts, state.phase_batches, state.phase_rays, state.phase_heard
    return TeamPhases(repeats, state.phases, *(array[0] for array in (*batches, state.phase_covariances)))


def in_flight_in(state):
    """The delayed messages of the one mission in a state."""
    messages = state.in_flight, state.in_flight_to, state.in_flight_rays, state.in_flight_covariances
    return InFlight(*(array[0] for array in messages))


def event(due_s=(), serials=None, broadcasts=None, scans_s=(), deciding=(), stops_s=None, stopped=()):
    """The next event of three messages and four robots at most; broadcasts every 2 s, if at all."""
    messages, robots = np.zeros(3, MESSAGE), np.zeros(4, ROBOT)
    messages["due_s"], robots["next_scan_s"], robots["redecide_s"] = NEVER, NEVER, NEVER
    messages["due_s"][: len(due_s)], robots["next_scan_s"][: len(scans_s)] = due_s, scans_s
    messages["serial"] = range(3) if serials is None else serials
    robots["deciding"][list(deciding)] = True
    shared, phases = np.zeros(1, PARAMS), None
    if broadcasts is not None:
        shared["phase_s"], phases = 6.0, in_phases(3)
        phases.now["broadcasts"] = broadcasts
    faults = None
    if stops_s is not None:
        faults = TeamFaults(np.zeros(4, FAULT_PARAMS), np.zeros(4, FAULT))
        faults.states["stop_s"] = NEVER
        faults.states["stop_s"][: len(stops_s)] = stops_s
        faults.states["stopped"][list(stopped)] = True
    in_flight = InFlight(messages, np.zeros((3, 4), bool), np.zeros((3, 1, 5)), np.zeros((3, 10)))
    return tuple(next_event(shared[0], robots, in_flight, phases, faults))


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ({}, (NOTHING, 0, NEVER)),
        ({"scans_s": (1.0, 1.0), "deciding": (0, 1)}, (NOTHING, 0, NEVER)),
        ({"due_s": (NEVER, 5.0)}, (MESSAGES, 1, 5.0)),
        ({"due_s": (7.0, 5.0, 6.0), "scans_s": (5.5,)}, (MESSAGES, 1, 5.0)),
        ({"due_s": (5.0, 5.0, 6.0), "serials": (4, 3, 2)}, (MESSAGES, 1, 5.0)),
        ({"due_s": (5.0, 5.0, 5.0), "serials": (4, 3, 2), "scans_s": (5.0,)}, (MESSAGES, 2, 5.0)),
        ({"due_s": (5.0,), "scans_s": (6.0, 4.9)}, (ROBOTS, 1, 4.9)),
        ({"scans_s": (3.0, 2.5, 2.5, 4.0)}, (ROBOTS, 1, 2.5)),
        ({"scans_s": (3.0, 2.5, 2.5, 4.0), "deciding": (1,)}, (ROBOTS, 2, 2.5)),
        ({"broadcasts": 0}, (BROADCAST, 0, 2.0)),  # all decide and nothing else is due
        ({"broadcasts": 4, "scans_s": (9.0,), "deciding": (0,)}, (BROADCAST, 0, 10.0)),
        ({"broadcasts": 4, "scans_s": (10.0,)}, (BROADCAST, 0, 10.0)),
        ({"broadcasts": 4, "scans_s": (9.5, 9.75)}, (ROBOTS, 0, 9.5)),
        ({"broadcasts": 4, "scans_s": (10.25,)}, (BROADCAST, 0, 10.0)),
        ({"broadcasts": 1, "due_s": (4.0,), "scans_s": (4.0,)}, (MESSAGES, 0, 4.0)),
        ({"broadcasts": 1, "due_s": (4.5,), "scans_s": (5.0,)}, (BROADCAST, 0, 4.0)),
        ({"stops_s": (NEVER, NEVER)}, (NOTHING, 0, NEVER)),
        ({"stops_s": (NEVER, 4.0), "broadcasts": 1, "due_s": (4.0,), "scans_s": (4.0,)}, (STOPS, 1, 4.0)),
        ({"stops_s": (5.0, 4.0), "stopped": (1,), "scans_s": (4.5,)}, (ROBOTS, 0, 4.5)),
        ({"stops_s": (5.0, 4.0), "stopped": (1,), "scans_s": (4.5,), "deciding": (0,)}, (STOPS, 0, 5.0)),
    ],
)
def test_the_earliest_event_is_next_and_ties_have_an_order(given, expected):
    assert event(**given) == expected


PHASES_WITHOUT_EVENTS = """
import numpy as np
from tests.reference.scenes import free_box, started, wander
missions = started(free_box(robots=3, channel={"phase_s": 3.0}, decision_period_s=1.0))
wander(missions, 12, 0)
broadcasts, times = missions.state.phases["broadcasts"][0], missions.state.missions["time_s"][0]
assert missions.state.robots["deciding"].any()
print(times, broadcasts)
for redecide in ("on_scan", 0.3):
    for period_s in (None, 0.7):
        robot, sensor = {"redecide": redecide}, {"scan_every_m": 0.2}
        missions = started(free_box(robot=robot, sensor=sensor, decision_period_s=period_s))
        wander(missions, 12, 0)
        assert missions.state.missions["time_s"][0] > 3.0
"""


def test_a_broadcast_is_due_while_all_robots_decide_and_decisions_under_way_are_used_up():
    """In a process of its own, which can be ended if it hangs; interpreted kernels check themselves."""
    done = subprocess.run(
        [sys.executable, "-c", PHASES_WITHOUT_EVENTS],
        env={
            **os.environ,
            "PYTHONPATH": os.pathsep.join(sys.path),
            "ENTROPY_EXPLORE_ASSERT": "1",
            "NUMBA_DISABLE_JIT": "1",
        },
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
    )
    assert done.stdout.split() == ["12.0", "4"], done.stderr


def test_every_kind_of_event_counts_as_handled():
    state = started(free_box(robots=3, channel={"delay_s": 1.0, "burst": 2})).state

    def handled():
        return events_handled(state.robots[0], in_flight, phases, faults)

    faults, phases, in_flight = None, in_phases(2), in_flight_in(state)

    begun = handled()
    assert begun == 6  # all decide, and will not under way
    state.in_flight["due_s"][0, :2] = 3.0, 2.0
    assert handled() == begun - 2
    state.in_flight["due_s"][0, 1] = NEVER  # heard
    assert handled() == begun - 1
    phases.now["broadcasts"] += 1
    assert handled() == begun
    state.robots["scans"][0, 2] += 1
    state.in_flight["due_s"][0, 1] = 5.0  # a scan of which something is sent …
    state.robots["deciding"][0, 2], state.robots["redecide_s"][0, 2] = False, 7.0  # … and the robot drives on
    assert handled() == begun + 1
    state.robots["deciding"][0, 2] = True
    assert handled() == begun + 2
    state.robots["redecide_s"][0, 2] = NEVER
    assert handled() == begun + 3
    faults = TeamFaults(np.zeros(3, FAULT_PARAMS), np.zeros(3, FAULT))
    faults.states["stopped"][2] = True
    state.robots["deciding"][0, 2] = False
    assert handled() == begun + 6
