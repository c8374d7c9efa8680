"""One step of one mission, compiled: choose → drive → scan → fuse → select → send → fuse → account.

The events of a mission are processed in the order of simulated time; `events` says which is next.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from entropy_explore_env.compilation.kernels import ASSERTING, lean_kernel
from entropy_explore_env.missions.backlog import backlog_of
from entropy_explore_env.missions.driving import (
    continue_drive,
    halt,
    keep_drive,
    next_decision,
    redecide,
    start_drive,
    stop,
)
from entropy_explore_env.missions.endings import mission_end
from entropy_explore_env.missions.events import (
    BROADCAST_DUE,
    MESSAGE_ARRIVES,
    NO_EVENT,
    ROBOT_STOPS,
    InFlight,
    events_handled,
    in_flight_of,
    next_event,
)
from entropy_explore_env.missions.faults import faults_of, note_stop
from entropy_explore_env.missions.localization import estimate_of, localization_of, note_motion
from entropy_explore_env.missions.messages import Maps, Team, Tracer, announce, receive
from entropy_explore_env.missions.own_maps import summaries_of
from entropy_explore_env.missions.phases import TeamPhases, broadcast_all, phases_of
from entropy_explore_env.missions.poses import note_driven
from entropy_explore_env.missions.records import MissionEnd
from entropy_explore_env.missions.redecision import decide, note_braking
from entropy_explore_env.missions.scanning import scan_and_share
from entropy_explore_env.missions.scoring import note_progress
from entropy_explore_env.missions.state import Beliefs, JointMap, LatestScans
from entropy_explore_env.missions.summaries import receive_summary
from entropy_explore_env.robots.channel import Air
from entropy_explore_env.robots.range_sensor import sensor_of

_RUNNING, _TIME_UP = MissionEnd.RUNNING.code, MissionEnd.TIME_UP.code
_CYCLES_UP = MissionEnd.CYCLES_UP.code


class Mission(NamedTuple):
    """One mission: slices of the MissionState, so that no kernel takes more than it needs."""

    clock: np.record
    """MISSION."""
    team: Team
    maps: Maps
    joint: JointMap
    latest: LatestScans
    in_flight: InFlight | None
    """None = all messages arrive at once, which is known while compiling."""
    phases: TeamPhases | None
    """None = batches are sent at once, which is known while compiling."""
    truth: np.ndarray
    """(V,) float32."""


@lean_kernel
def step_missions(rules, state, choices, work, continuous, discrete, first, last):
    """Advance the missions `first` … `last` - 1 by one step; those that are over stand still."""
    masks = rules.params[0].bodies
    for m in range(first, last):
        mission = Mission(
            state.missions[m],
            Team(
                rules.params,
                state.robots[m],
                state.heard[m],
                faults_of(rules.faults, state.faults, m),
                air_of(work.air, state.truth[m]),
                localization_of(rules.localization, state.estimates, state.fiducials, state.landmarks, m),
                summaries_of(work.tree, state, m),
                backlog_of(work.selection, state, m),
            ),
            Maps(Beliefs(state.mean[m], state.precision[m], state.pooled[m]), rules.cells),
            JointMap(state.joint_mean[m], state.joint_precision[m], state.visible[m], state.drivable[m]),
            LatestScans(state.scan_range_m[m], state.scan_returned[m], state.scan_utility_bits[m]),
            in_flight_of(rules.slots, state, m),
            phases_of(rules.repeats, state, m),
            state.truth[m],
        )
        clock, team = mission.clock, mission.team
        if clock.end == _RUNNING:
            before_s = clock.time_s
            collision = state.collision[m * masks : (m + 1) * masks]
            choose(team, clock, rules.actions, continuous[m], discrete[m], choices[m], work.braking)
            depart(team, clock, mission.in_flight, collision, choices[m], work)
            advance(mission, rules.sensors, work)
            finish_step(team, clock, before_s)


@lean_kernel
def air_of(crossing, truth):
    """Return the Air of a mission; None where the channel reaches by distance alone."""
    if crossing is None:  # known while compiling: nothing of the rest is compiled
        return None
    return Air(truth, crossing)


@lean_kernel
def choose(team, clock, actions, continuous, discrete, choices, braking):
    """Begin to count the step, and fill in the choices that were not planned before it."""
    for index in range(len(team.robots)):
        robot, own = team.robots[index], team.params[index]
        robot.own_bits = 0.0
        robot.received_bits = 0.0
        if robot.deciding and not own.planned:
            choice, estimate = choices[index], estimate_of(team.localization, index)
            chosen, number, time_s = continuous[index], discrete[index], clock.time_s
            decide(own, actions, robot, estimate, time_s, chosen, number, choice, braking)
            note_braking(own, robot, estimate, time_s, choice, braking)


@lean_kernel
def depart(team, clock, in_flight, collision, choices, work):
    """Let the robots that decide depart and announce where they go, one after the other.

    Robots under way that keep their viewpoint drive on.
    """
    for index in range(len(team.robots)):
        robot, own = team.robots[index], team.params[index]
        if robot.deciding and choices[index].changed:
            start_drive(team, collision[own.body_number], choices[index], index, clock.time_s, work)
            announce(team, clock, in_flight, index, work.recipients)
        elif robot.deciding:
            keep_drive(own, robot, clock.time_s, work.braking)


@lean_kernel
def finish_step(team, clock, before_s):
    """Count the step, which began at `before_s`, and reward the robots for it."""
    shared = team.params[0]
    clock.cycles += 1
    if clock.end == _RUNNING and clock.cycles >= shared.max_cycles:
        clock.end = _CYCLES_UP
    cost = shared.cost_per_s * (clock.time_s - before_s)
    bits_to_gain = clock.entropy_start_bits - clock.entropy_end_bits
    reward_robots(team.robots, bits_to_gain, shared.team_reward, cost)


@lean_kernel
def reward_robots(robots, bits_to_gain, team, cost):
    """Reward robots for the bits that they gained in a step, as shares of all that the mission asks for.

        individual: own / (H(0) - H_th) - cost
        team:       mean over robots of (own + received) / (H(0) - H_th) - cost

    Args:
        robots: (A,) ROBOT with `own_bits` and `received_bits` of the step; `reward` is filled in.
        bits_to_gain: H(0) - H_th.
        team: Which of the two.
        cost: Of the time that the step took, in shares.
    """
    shared = 0.0
    for robot in robots:
        shared += (robot.own_bits + robot.received_bits) / len(robots)
    for robot in robots:
        gained = shared if team else robot.own_bits
        robot.reward = gained / bits_to_gain - cost


@lean_kernel
def advance(mission, sensors, work):
    """Process the events up to the end of the step, the time limit or the mission's end."""
    clock, team, maps, scan = mission.clock, mission.team, mission.maps, work.scan
    params, robots, tracer = team.params, team.robots, Tracer(sensors.params, mission.truth)
    shared, in_flight = params[0], mission.in_flight
    target_s = clock.time_s + shared.period_s
    if math.isinf(target_s):
        target_s = next_decision(params, robots)
    stop_s = min(target_s, shared.time_limit_s)
    while clock.end == _RUNNING:
        event = next_event(shared, robots, in_flight, mission.phases, team.faults)
        if event.kind == NO_EVENT or event.time_s > stop_s:
            break
        handled = events_handled(robots, in_flight, mission.phases, team.faults) if ASSERTING else 0
        earlier_s = clock.time_s
        clock.time_s = max(clock.time_s, event.time_s)
        note_driven(params, robots, clock.time_s)
        if event.kind == MESSAGE_ARRIVES:
            if not receive_summary(team.summaries, team, maps, in_flight, event.number):
                receive(in_flight, team, maps, event.number, tracer, scan)
        elif event.kind == BROADCAST_DUE:
            broadcast_all(mission.phases, team, maps, clock.time_s, tracer, scan, work.recipients)
        elif event.kind == ROBOT_STOPS:
            until_s = note_stop(team.faults, event.number)
            note_motion(
                team.localization, params[event.number], robots[event.number], event.number, clock.time_s
            )
            halt(params[event.number], robots[event.number], clock.time_s, until_s)
            if math.isinf(shared.period_s):
                stop_s = min(next_decision(params, robots), shared.time_limit_s)
        elif robots[event.number].waiting:
            robots[event.number].deciding = True
        elif robots[event.number].next_scan_s > event.time_s:
            note_motion(
                team.localization, params[event.number], robots[event.number], event.number, clock.time_s
            )
            redecide(robots[event.number], clock.time_s)
        else:
            scan_at(mission, sensors, event.number, work)
            if math.isinf(shared.period_s):
                stop_s = min(next_decision(params, robots), shared.time_limit_s)
        if ASSERTING and clock.time_s < earlier_s:
            raise AssertionError("time ran backwards")
        if ASSERTING and events_handled(robots, in_flight, mission.phases, team.faults) <= handled:
            raise AssertionError("an event was not used up")
        note_progress(clock, robots)
        clock.end = mission_end(mission)
    if clock.end == _RUNNING:
        clock.time_s = max(clock.time_s, stop_s)
        note_driven(params, robots, clock.time_s)
        if stop_s >= shared.time_limit_s:
            clock.end = _TIME_UP


@lean_kernel
def scan_at(mission, sensors, index, work):
    """Let a robot scan at the mission's time, and then stop, drive on, or end its drive."""
    time_s, params, own = mission.clock.time_s, mission.team.params[index], mission.team.robots[index]
    localization = mission.team.localization
    note_motion(localization, params, own, index, time_s)
    scan_and_share(mission, sensor_of(sensors, index), index, work)
    if time_s >= own.ready_s:
        stop(params, own, time_s)
    else:
        footprint, mean = work.footprints[params.kind], mission.maps.beliefs.mean[index]
        continue_drive(params, footprint, mean, own, estimate_of(localization, index), time_s, work.drive)
