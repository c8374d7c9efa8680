"""One step of one mission, compiled: choose → drive → scan → fuse → select → send → fuse → account.

The events of a mission (a robot has driven and scanned; a message arrives) are processed in the order of
simulated time; of events at the same instant messages come first, then robots by number.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.missions.action import decode_action
from entropy_explore_env.missions.driving import continue_drive, next_decision, start_drive, stop
from entropy_explore_env.missions.messages import (
    Maps,
    Team,
    Tracer,
    announce,
    fuse_measurements,
    next_message,
    receive,
    send_batch,
)
from entropy_explore_env.missions.phases import broadcast_all, collect_batch, next_broadcast
from entropy_explore_env.missions.poses import copy_numbers, grid_size, pose_at, to_grid_units
from entropy_explore_env.missions.reward import reward_robots
from entropy_explore_env.missions.scoring import note_progress, score_scan
from entropy_explore_env.missions.state import (
    Beliefs,
    InFlight,
    JointMap,
    LatestScans,
    MissionEnd,
    PhaseBuffers,
)
from entropy_explore_env.robots.channel import select_measurements, steered_i_min
from entropy_explore_env.robots.range_sensor import (
    Return,
    Scene,
    SensorPose,
    first_rays,
    in_view,
    sensor_of,
    take_scan,
    visibility_parameters,
)

_RUNNING, _MAPPED, _TIME_UP, _CYCLES_UP = (end.code for end in MissionEnd)
_NOTHING = int(Return.NOTHING)


class Mission(NamedTuple):
    """One mission: slices of the MissionState, so that no kernel takes more than it needs."""

    clock: np.record
    """MISSION."""
    team: Team
    maps: Maps
    joint: JointMap
    latest: LatestScans
    in_flight: InFlight
    phases: np.record
    """PHASES."""
    buffers: PhaseBuffers
    truth: np.ndarray
    """(V,) float32."""


@lean_kernel
def step_missions(rules, state, work, continuous, discrete, first, last):
    """Advance the missions `first` … `last` - 1 by one step; those that are over stand still.

    Args:
        rules: Rules.
        state: MissionState of E missions, changed in place.
        work: Workspace, not shared with another thread.
        continuous: (E, A, N) float64 actions.
        discrete: (E, A) int64 actions.
        first: The first mission.
        last: One past the last.
    """
    masks = rules.params[0].radii
    for m in range(first, last):
        mission = Mission(
            state.missions[m],
            Team(rules.params, state.robots[m], state.heard[m]),
            Maps(Beliefs(state.mean[m], state.precision[m], state.pooled[m]), rules.cells),
            JointMap(state.joint_mean[m], state.joint_precision[m], state.visible[m]),
            LatestScans(state.scan_range_m[m], state.scan_returned[m], state.scan_utility_bits[m]),
            InFlight(state.in_flight[m], state.in_flight_to[m], state.in_flight_rays[m]),
            state.phases[m],
            PhaseBuffers(
                state.phase_counts[m], state.phase_batches[m], state.phase_rays[m], state.phase_heard[m]
            ),
            state.truth[m],
        )
        clock, team = mission.clock, mission.team
        if clock.end == _RUNNING:
            before_s = clock.time_s
            collision = state.collision[m * masks : (m + 1) * masks]
            choose(team, clock, rules.actions, continuous[m], discrete[m])
            depart(team, clock, mission.in_flight, collision, work.drive, work.recipients)
            advance(mission, rules.sensors, work)
            finish_step(team, clock, before_s)


@lean_kernel
def choose(team, clock, actions, continuous, discrete):
    """Write the targets of the robots that decide, (A, N) or (A,) actions, and begin to count the step."""
    for index in range(len(team.robots)):
        robot, own = team.robots[index], team.params[index]
        robot.own_bits = 0.0
        robot.received_bits = 0.0
        if robot.deciding:
            decode_action(own, actions, robot.goal, continuous[index], discrete[index], robot.target)


@lean_kernel
def depart(team, clock, in_flight, collision, crossing, recipients):
    """Let the robots that decide depart and announce where they go, one after the other.

    Args:
        team: Team.
        clock: MISSION.
        in_flight: InFlight.
        collision: (N, V) float32 collision masks of this mission.
        crossing: Crossing, scratch space.
        recipients: (A,) bool, scratch space.
    """
    for index in range(len(team.robots)):
        if team.robots[index].deciding:
            mask = collision[team.params[index].radius_number]
            start_drive(team.params, mask, team.robots, index, clock.time_s, crossing)
            announce(team, clock, in_flight, index, recipients)


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
def advance(mission, sensors, work):
    """Process the events up to the end of the step, the time limit or the mission's end.

    Args:
        mission: Mission, changed in place.
        sensors: TeamSensors.
        work: Workspace.
    """
    clock, team, maps, scan = mission.clock, mission.team, mission.maps, work.scan
    params, robots, tracer = team.params, team.robots, Tracer(sensors.params, mission.truth)
    shared = params[0]
    target_s = clock.time_s + shared.period_s
    if math.isinf(target_s):
        target_s = next_decision(params, robots)
    stop_s = min(target_s, shared.time_limit_s)
    while clock.end == _RUNNING:
        slot, due_s = next_message(mission.in_flight.messages)
        robot, scan_s = next_scan(robots)
        broadcast_s = next_broadcast(shared, mission.phases)
        if min(due_s, scan_s, broadcast_s) > stop_s:
            break
        if due_s <= scan_s:
            clock.time_s = max(clock.time_s, due_s)
            receive(team, maps, mission.in_flight, slot, tracer, scan)
        elif broadcast_s <= scan_s:
            clock.time_s = max(clock.time_s, broadcast_s)
            broadcast_all(team, maps, mission.buffers, mission.phases, clock.time_s, tracer, scan)
        else:
            clock.time_s = scan_s
            own = robots[robot]
            if own.waiting:
                own.deciding = True
            else:
                scan_and_share(mission, sensor_of(sensors, robot), robot, work)
                if scan_s >= own.ready_s:
                    stop(params[robot], own, scan_s)
                else:
                    footprint = work.footprints[params[robot].kind]
                    mean = maps.beliefs.mean[robot]
                    continue_drive(params[robot], footprint, mean, own, scan_s, work.drive)
                    if math.isinf(shared.period_s):
                        stop_s = min(next_decision(params, robots), shared.time_limit_s)
        note_progress(clock, robots)
        if mapped(robots, clock.entropy_end_bits, shared.all_maps):
            clock.end = _MAPPED
    if clock.end == _RUNNING:
        clock.time_s = max(clock.time_s, stop_s)
        if stop_s >= shared.time_limit_s:
            clock.end = _TIME_UP


@lean_kernel
def next_scan(robots):
    """(robot, time) of the next that scans, under way or at its stop, or has waited; inf if all decide."""
    soonest, scan_s = 0, math.inf
    for robot in range(len(robots)):
        if not robots[robot].deciding and robots[robot].next_scan_s < scan_s:
            soonest, scan_s = robot, robots[robot].next_scan_s
    return soonest, scan_s


@lean_kernel
def mapped(robots, entropy_end_bits, all_maps):
    """Whether one robot's map, or all maps, passed the threshold (Rocha04, eq. 41)."""
    passed = 0
    for robot in robots:
        if robot.entropy_bits <= entropy_end_bits:
            passed += 1
    return passed == len(robots) if all_maps else passed > 0


@lean_kernel
def scan_and_share(mission, sensor, index, work):
    """A robot measures from where it is, fuses, and sends what is most useful.

    Args:
        mission: Mission, changed in place.
        sensor: SensorModel of the robot.
        index: Its number.
        work: Workspace.
    """
    clock, team = mission.clock, mission.team
    params, robot = team.params[index], team.robots[index]
    scan = first_rays(work.scan, params.rays)
    x, y, z, yaw, pitch = pose_at(params, robot, clock.time_s)
    pose = SensorPose(to_grid_units(params, (x, y, z)), yaw, pitch)
    bodies = work.bodies[: place_bodies(team, sensor, index, clock.time_s, pose, work.bodies)]
    scene = Scene(mission.truth, grid_size(params), params.voxel_size_m, bodies)
    take_scan(scan, sensor, scene, pose, robot.sensor_rng)
    for ray in range(len(scan.order)):
        scan.order[ray] = ray
    bits = fuse_measurements(team, mission.maps, scan, index, len(scan.order))
    robot.entropy_bits -= bits
    robot.own_bits += bits
    robot.gained_bits += bits
    robot.depth_m, robot.half_angle_rad, measurements = visibility_parameters(scan.rays, yaw, pitch)
    robot.scans += 1
    robot.measurements += measurements
    robot.i_min_bits = robot.next_i_min_bits
    copy_numbers((x, y, z, yaw, pitch), robot.scan_pose, 5)
    note_scan(robot, mission.latest, scan, index)
    if params.track_truth:
        score_scan(clock, mission.joint, mission.truth, scan, params.prior_precision)
    if len(team.robots) > 1 and params.burst > 0:
        share(mission, scan, index, work.recipients)


@lean_kernel
def note_scan(robot, latest, scan, index):
    """Keep what a scan measured; rays that measured nothing get utility -1, so that none is sent."""
    for ray in range(len(scan.rays)):
        latest.range_m[index, ray] = scan.rays[ray].range_m
        latest.returned[index, ray] = scan.rays[ray].returned
        latest.utility_bits[index, ray] = scan.utility[ray]
        if scan.rays[ray].returned == _NOTHING:
            scan.utility[ray] = -1.0
        elif scan.utility[ray] < robot.i_min_bits:
            robot.redundant += 1


@lean_kernel
def share(mission, scan, index, recipients):
    """Select the most useful measurements of a robot's scan, and send them, now or in the next phase."""
    team, params = mission.team, mission.team.params[index]
    robot = team.robots[index]
    count = select_measurements(scan.utility, params.burst, robot.i_min_bits, scan.order)
    if params.i_min_fill > 0.0:
        robot.next_i_min_bits = steered_i_min(
            robot.i_min_bits, scan.utility, params.burst, params.i_min_fill, params.i_min_gain
        )
    if count > 0 and params.phase_s == 0.0:
        send_batch(team, mission.maps, mission.clock, mission.in_flight, scan, index, count, recipients)
    elif count > 0:
        collect_batch(robot, mission.buffers, mission.phases, scan, index, count)


@lean_kernel
def place_bodies(team, sensor, index, time_s, pose, bodies):
    """Put the teammates' bodies that the robot may see, in grid units, into `bodies`; returns how many."""
    count = 0
    for mate in range(len(team.robots)):
        params = team.params[mate]
        if mate != index and params.body_radius_m > 0.0:
            place = to_grid_units(params, pose_at(params, team.robots[mate], time_s))
            copy_numbers(place, bodies[count], 3)
            bodies[count, 3] = params.body_radius_m / params.voxel_size_m
            if in_view(sensor, pose, bodies[count]):
                count += 1
    return count
