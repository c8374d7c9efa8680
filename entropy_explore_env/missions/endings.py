"""What ends a mission before its time is up: good maps, all seen, no robot left, or nothing left to reach."""

from __future__ import annotations

import math

import numpy as np

from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.missions.faults import all_gone, gone
from entropy_explore_env.missions.records import MissionEnd
from entropy_explore_env.missions.rules import Rules
from entropy_explore_env.missions.scoring import holds_enough, planned_m
from entropy_explore_env.missions.state import MissionState

_RUNNING, _MAPPED = MissionEnd.RUNNING.code, MissionEnd.MAPPED.code
_SEEN, _STOPPED = MissionEnd.SEEN.code, MissionEnd.STOPPED.code
_EXHAUSTED = MissionEnd.EXHAUSTED.code
IDLE_SCANS, IDLE_ROUNDS = 100, 3.0
"""A mission that ends by what was seen asks what is left when, a robot on average, this many scans have shown
nothing new, or this many times the workspace's length, width and height together were driven meanwhile."""
_ASKED = 0.875
"""Share of these limits at which counts go on where something was left, so that it is asked again soon."""


@lean_kernel
def mission_end(mission):
    """Return the code of a MissionEnd after an event: the goal is reached, or no robot is left for it."""
    clock, team = mission.clock, mission.team
    if team.params[0].by_seen:
        end = _SEEN if seen_enough(mission) else _RUNNING
    else:
        end = _MAPPED if mapped_enough(team, clock) else _RUNNING
    if end == _RUNNING and all_gone(team.faults):
        return _STOPPED
    if end == _RUNNING and team.params[0].by_seen and exhausted(mission):
        return _EXHAUSTED
    return end


@lean_kernel
def mapped_enough(team, clock):
    """Return whether those maps that have to pass the threshold of entropy have done so (Rocha04, eq. 41)."""
    shared, passed, missing = team.params[0], 0, 0
    for index in range(len(team.robots)):
        if (shared.shared_maps or shared.one_map) and gone(team.faults, index):
            continue
        if team.robots[index].entropy_bits <= clock.entropy_end_bits:
            passed += 1
        else:
            missing += 1
    return passed > 0 and (missing == 0 or not (shared.all_maps or shared.shared_maps))


@lean_kernel
def seen_enough(mission):
    """Return whether the team has seen what ends the mission and, where asked, all maps or one hold it."""
    clock, team, joint = mission.clock, mission.team, mission.joint
    if clock.explored_visible < clock.explored_end or clock.explored_free < clock.explored_free_end:
        return False
    shared, precision = team.params[0], mission.maps.beliefs.precision
    if not (shared.shared_maps or shared.one_map):
        return True
    working = 0
    for index in range(len(team.robots)):
        if gone(team.faults, index):
            continue
        working += 1
        if holds_enough(clock, joint.visible, mission.truth, precision[index], shared.prior_precision):
            if shared.one_map:
                return True
        elif shared.shared_maps:
            return False
    return working > 0 and shared.shared_maps


@lean_kernel
def exhausted(mission):
    """Return whether the team has long seen nothing new, and no robot has a place left to drive up to.

    The team must have measured every voxel that can be seen and lies where a body of the team can get to from
    its start, or beside such a place; where own maps count, every robot that still works must have it in its
    own. Besides, nothing new was seen for IDLE_SCANS scans or IDLE_ROUNDS rounds a robot. What is left then
    lies behind gaps that beams pass and bodies do not, and the team has had the time to look through them. A
    team that has seen enough, and has to share it, goes on. All voxels are looked at, but seldom.
    """
    clock, team, drivable = mission.clock, mission.team, mission.joint.drivable
    shared, robots = team.params[0], team.robots
    edges_m = (shared.size[0] + shared.size[1] + shared.size[2]) * shared.voxel_size_m
    now_m = planned_m(robots)
    scans, rounds_m = IDLE_SCANS * len(robots), IDLE_ROUNDS * edges_m * len(robots)
    if clock.idle_scans < scans and now_m - clock.idle_from_m < rounds_m:
        return False
    clock.idle_scans = min(clock.idle_scans, int(_ASKED * scans))
    clock.idle_from_m = max(clock.idle_from_m, now_m - _ASKED * rounds_m)
    if clock.explored_visible >= clock.explored_end and clock.explored_free >= clock.explored_free_end:
        return False
    prior = np.float32(shared.prior_precision)
    if not (shared.shared_maps or shared.one_map):
        return not _any_left(drivable, mission.joint.precision, prior)
    for index in range(len(robots)):
        precision = mission.maps.beliefs.precision[index]
        if not gone(team.faults, index) and _any_left(drivable, precision, prior):
            return False
    return True


@lean_kernel
def _any_left(drivable, precision, prior):
    """Return whether some of (V,) drivable voxels was never measured, by (V,) precisions."""
    for voxel in range(len(drivable)):
        if drivable[voxel] and precision[voxel] <= prior:
            return True
    return False


class Returning:
    """What E missions ask for that end where they began, `Ending.return_to_start`, and where that is.

    Kernels are told of a threshold that no mission reaches; whether it is over is asked after each step.

    Attributes:
        homes: (E, A, 3) where robots started, map frame, metres.
        seen: (E,) explored visible voxels that are asked for.
        free: (E,) explored free ones.
    """

    def __init__(self, missions: int, robots: int) -> None:
        """Make room; missions begin later."""
        self.homes = np.zeros((missions, robots, 3))
        self.seen, self.free = np.zeros(missions, np.int64), np.zeros(missions, np.int64)

    def begin(self, state: MissionState, mission: int, voxels: int) -> None:
        """Take what a mission asks for out of its arrays, and where its robots are."""
        clock = state.missions[mission]
        self.homes[mission] = state.robots[mission]["origin"][:, :3]
        self.seen[mission], self.free[mission] = clock["explored_end"], clock["explored_free_end"]
        clock["explored_end"] = voxels + 1

    def end(self, rules: Rules, state: MissionState) -> None:
        """End the missions that have seen enough and whose robots stand where they started.

        A robot stands there if its body would touch the one of its start, and its latest drive ended there,
        or did not lead away. Robots that stopped for good are not waited for. A team that has seen enough is
        not exhausted: home is left to reach, until the time is up if a robot cannot get there.
        """
        clocks, robots, params = state.missions, state.robots, rules.params
        enough = (clocks["explored_visible"] >= self.seen) & (clocks["explored_free"] >= self.free)
        clocks["end"][(clocks["end"] == _EXHAUSTED) & enough] = _RUNNING
        near_m = np.maximum(2.0 * params["body_radius_m"], params["voxel_size_m"])
        begins, ends = (
            np.linalg.norm(robots[name][..., :3] - self.homes, axis=-1) <= near_m
            for name in ("origin", "goal")
        )
        home = ends & (begins | (robots["deciding"] & ~robots["under_way"]))
        if state.faults.size:
            home |= state.faults["stopped"] & (state.faults["stop_until_s"] == math.inf)
        over = (clocks["end"] == _RUNNING) & enough & home.all(axis=1)
        clocks["end"][over] = _SEEN
