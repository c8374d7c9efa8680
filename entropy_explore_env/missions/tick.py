"""One step of one mission, compiled: choose → drive → scan → fuse → select → send → fuse → account.

The events of a mission (a robot stops by a fault; a message arrives; the robots broadcast; a robot scans, has
waited, or decides under way) are processed in the order of simulated time. `next_event` alone says which is
next, also of those at one instant.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from entropy_explore_env.compilation.kernels import ASSERTING, lean_kernel
from entropy_explore_env.missions.driving import (
    continue_drive,
    halt,
    keep_drive,
    next_decision,
    redecide,
    start_drive,
    stop,
)
from entropy_explore_env.missions.faults import (
    all_gone,
    blinded,
    faults_of,
    gone,
    next_stop,
    note_stop,
    spoil,
    stops_counted,
)
from entropy_explore_env.missions.fiducials import sight_fiducials
from entropy_explore_env.missions.localization import (
    believe_scan,
    believed_pose,
    estimate_of,
    localization_of,
    measure,
    note_motion,
    note_scan_pose,
)
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
from entropy_explore_env.missions.poses import copy_numbers, grid_size, pose_at, to_grid_units, within_grid
from entropy_explore_env.missions.redecision import decide, note_braking, note_change
from entropy_explore_env.missions.reward import reward_robots
from entropy_explore_env.missions.scoring import holds_enough, note_progress, note_seen, score_scan
from entropy_explore_env.missions.state import (
    Beliefs,
    InFlight,
    JointMap,
    LatestScans,
    MissionEnd,
    PhaseBuffers,
)
from entropy_explore_env.robots.channel import Air, select_measurements, steered_i_min
from entropy_explore_env.robots.range_sensor import (
    Return,
    Scene,
    SensorPose,
    first_rays,
    in_view,
    sensor_of,
    visibility_parameters,
)

_RUNNING, _MAPPED, _TIME_UP, _CYCLES_UP, _SEEN, _STOPPED = (end.code for end in MissionEnd)
_NOTHING = int(Return.NOTHING)
_NO_EVENT, _MESSAGE, _BROADCAST, _ROBOT, _FAULT = range(5)


class Event(NamedTuple):
    """What happens next in a mission."""

    kind: int
    """A robot stops by a fault, a message arrives, the robots broadcast, a robot scans, has waited or decides
    under way; or nothing."""
    number: int
    """The slot of the message, or the number of the robot; 0 for others."""
    time_s: float
    """When; inf = never."""


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
def step_missions(rules, state, choices, work, continuous, discrete, first, last):
    """Advance the missions `first` … `last` - 1 by one step; those that are over stand still.

    Args:
        rules: Rules.
        state: MissionState of E missions, changed in place.
        choices: (E, A) CHOICE, scratch space; those of robots that plan are filled in.
        work: Workspace, not shared with another thread.
        continuous: (E, A, N) float64 actions.
        discrete: (E, A) int64 actions.
        first: The first mission.
        last: One past the last.
    """
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
                localization_of(rules.localization, state.estimates, state.fiducials, m),
            ),
            Maps(Beliefs(state.mean[m], state.precision[m], state.pooled[m]), rules.cells),
            JointMap(state.joint_mean[m], state.joint_precision[m], state.visible[m]),
            LatestScans(state.scan_range_m[m], state.scan_returned[m], state.scan_utility_bits[m]),
            InFlight(
                state.in_flight[m],
                state.in_flight_to[m],
                state.in_flight_rays[m],
                state.in_flight_covariances[m],
            ),
            state.phases[m],
            PhaseBuffers(
                state.phase_counts[m],
                state.phase_batches[m],
                state.phase_rays[m],
                state.phase_heard[m],
                state.phase_covariances[m],
            ),
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
    """Air of a mission; None where the channel reaches by distance alone."""
    if crossing is None:  # known while compiling: nothing of the rest is compiled
        return None
    return Air(truth, crossing)


@lean_kernel
def choose(team, clock, actions, continuous, discrete, choices, braking):
    """Begin to count the step, and fill in the choices that were not planned before it.

    Args:
        team: Team.
        clock: MISSION.
        actions: ActionSet.
        continuous: (A, N) float64 actions.
        discrete: (A,) int64 actions.
        choices: (A,) CHOICE.
        braking: Of the Workspace.
    """
    for index in range(len(team.robots)):
        robot, own = team.robots[index], team.params[index]
        robot.own_bits = 0.0
        robot.received_bits = 0.0
        if robot.deciding and not own.planned:
            choice, estimate = choices[index], estimate_of(team.localization, index)
            decide(own, actions, robot, estimate, clock.time_s, continuous[index], discrete[index], choice)
            note_change(own, robot, choice, braking)
            note_braking(own, robot, estimate, clock.time_s, choice, braking)


@lean_kernel
def depart(team, clock, in_flight, collision, choices, work):
    """Let the robots that decide depart and announce where they go, one after the other.

    Robots under way that keep their viewpoint drive on.

    Args:
        team: Team.
        clock: MISSION.
        in_flight: InFlight.
        collision: (N, V) float32 collision masks of this mission.
        choices: (A,) CHOICE.
        work: Workspace.
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
def advance(mission, sensors, work):
    """Process the events up to the end of the step, the time limit or the mission's end.

    Args:
        mission: Mission, changed in place.
        sensors: TeamSensors.
        work: Workspace.
    """
    clock, team, maps, scan = mission.clock, mission.team, mission.maps, work.scan
    params, robots, tracer = team.params, team.robots, Tracer(sensors.params, mission.truth)
    shared, messages = params[0], mission.in_flight.messages
    target_s = clock.time_s + shared.period_s
    if math.isinf(target_s):
        target_s = next_decision(params, robots)
    stop_s = min(target_s, shared.time_limit_s)
    while clock.end == _RUNNING:
        event = next_event(shared, robots, messages, mission.phases, team.faults)
        if event.kind == _NO_EVENT or event.time_s > stop_s:
            break
        handled = events_handled(robots, messages, mission.phases, team.faults) if ASSERTING else 0
        earlier_s = clock.time_s
        clock.time_s = max(clock.time_s, event.time_s)
        if event.kind == _MESSAGE:
            receive(team, maps, mission.in_flight, event.number, tracer, scan)
        elif event.kind == _BROADCAST:
            broadcast_all(team, maps, mission.buffers, mission.phases, clock.time_s, tracer, scan)
        elif event.kind == _FAULT:
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
        if ASSERTING and events_handled(robots, messages, mission.phases, team.faults) <= handled:
            raise AssertionError("an event was not used up")
        note_progress(clock, robots)
        clock.end = mission_end(mission)
    if clock.end == _RUNNING:
        clock.time_s = max(clock.time_s, stop_s)
        if stop_s >= shared.time_limit_s:
            clock.end = _TIME_UP


@lean_kernel
def next_event(shared, robots, messages, phases, faults):
    """The earliest Event.

    Of those at one instant robots that stop come first; then messages, in the order of sending; then the
    broadcast of all robots; then robots by number.

    Args:
        shared: PARAMS of any robot.
        robots: (A,) ROBOT.
        messages: (Q,) MESSAGE.
        phases: PHASES of the mission.
        faults: TeamFaults, or None.
    """
    slot, due_s = next_message(messages)
    broadcast_s = next_broadcast(shared, phases)
    robot, robot_s = next_robot(robots)
    stopping, stopping_s = next_stop(faults)
    soonest_s = min(due_s, broadcast_s, robot_s, stopping_s)
    if math.isinf(soonest_s):
        return Event(_NO_EVENT, 0, soonest_s)
    if stopping_s == soonest_s:
        return Event(_FAULT, stopping, soonest_s)
    if due_s == soonest_s:
        return Event(_MESSAGE, slot, soonest_s)
    if broadcast_s == soonest_s:
        return Event(_BROADCAST, 0, soonest_s)
    return Event(_ROBOT, robot, soonest_s)


@lean_kernel
def events_handled(robots, messages, phases, faults):
    """A number that every event makes greater, so that none is met twice: asserted in debug builds.

    A message frees its slot. A broadcast is counted. A robot counts its scan; or it decides, having waited or
    driven since it last decided; or it puts that off. A scan may send a message, begin the wait of a robot
    that could decide, and set when it decides next: it counts for more than these three. So does a stop,
    after which a robot does not decide. Arguments as those of `next_event`.
    """
    handled = phases.broadcasts + 4 * stops_counted(faults)
    for robot in robots:
        handled += 4 * robot.scans + int(robot.deciding) + int(math.isinf(robot.redecide_s))
    for message in messages:
        handled -= int(not math.isinf(message.due_s))
    return handled


@lean_kernel
def scan_at(mission, sensors, index, work):
    """A robot scans at the mission's time, and then stops, drives on, or ends its drive.

    Args:
        mission: Mission, changed in place.
        sensors: TeamSensors.
        index: The robot's number.
        work: Workspace.
    """
    time_s, params, own = mission.clock.time_s, mission.team.params[index], mission.team.robots[index]
    localization = mission.team.localization
    note_motion(localization, params, own, index, time_s)
    scan_and_share(mission, sensor_of(sensors, index), index, work)
    if time_s >= own.ready_s:
        stop(params, own, time_s)
    else:
        footprint, mean = work.footprints[params.kind], mission.maps.beliefs.mean[index]
        continue_drive(params, footprint, mean, own, estimate_of(localization, index), time_s, work.drive)


@lean_kernel
def next_robot(robots):
    """(robot, time) of the next that scans, under way or at its stop, has waited, or may decide under way.

    The time is inf if all of them stand and decide.
    """
    soonest, soonest_s = 0, math.inf
    for index in range(len(robots)):
        robot = robots[index]
        if not robot.deciding or robot.under_way:
            due_s = robot.next_scan_s if robot.under_way else min(robot.next_scan_s, robot.redecide_s)
            if due_s < soonest_s:
                soonest, soonest_s = index, due_s
    return soonest, soonest_s


@lean_kernel
def mission_end(mission):
    """Code of a MissionEnd after an event: what the mission asks for, or that nobody is left for it."""
    clock, team = mission.clock, mission.team
    if team.params[0].by_seen:
        end = _SEEN if seen_enough(mission) else _RUNNING
    else:
        end = _MAPPED if mapped_enough(team, clock) else _RUNNING
    return _STOPPED if end == _RUNNING and all_gone(team.faults) else end


@lean_kernel
def mapped_enough(team, clock):
    """Whether those maps that have to have passed the threshold of entropy (Rocha04, eq. 41)."""
    shared, passed, missing = team.params[0], 0, 0
    for index in range(len(team.robots)):
        if shared.shared_maps and gone(team.faults, index):
            continue
        if team.robots[index].entropy_bits <= clock.entropy_end_bits:
            passed += 1
        else:
            missing += 1
    return passed > 0 and (missing == 0 or not (shared.all_maps or shared.shared_maps))


@lean_kernel
def seen_enough(mission):
    """Whether the team has seen what ends the mission; where it has to be shared, whether all hold it."""
    clock, team, joint = mission.clock, mission.team, mission.joint
    if clock.explored_visible < clock.explored_end or clock.explored_free < clock.explored_free_end:
        return False
    if not team.params[0].shared_maps:
        return True
    working, precision, prior = 0, mission.maps.beliefs.precision, team.params[0].prior_precision
    for index in range(len(team.robots)):
        if not gone(team.faults, index):
            working += 1
            if not holds_enough(clock, joint.visible, mission.truth, precision[index], prior):
                return False
    return working > 0


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
    pose = SensorPose(within_grid(params, (x, y, z)), yaw, pitch)
    bodies = work.bodies[: place_bodies(team, sensor, index, clock.time_s, pose, work.bodies)]
    scene = Scene(mission.truth, grid_size(params), params.voxel_size_m, bodies)
    if not blinded(team.faults, index, clock.time_s):
        sight_fiducials(team.localization, params, index, sensor, scene, pose)
    measure(team.localization, scan, sensor, scene, pose, robot.sensor_rng)
    spoil(team.faults, index, scan, sensor, scene, pose, clock.time_s)
    here = believed_pose(estimate_of(team.localization, index), params, (x, y, z, yaw, pitch))
    believe_scan(team.localization, index, scan, sensor.params[0], scene, within_grid(params, here))
    for ray in range(len(scan.order)):
        scan.order[ray] = ray
    bits = fuse_measurements(team, mission.maps, scan, index, len(scan.order))
    robot.entropy_bits -= bits
    robot.own_bits += bits
    robot.gained_bits += bits
    robot.depth_m, robot.half_angle_rad, measurements = visibility_parameters(scan.rays, here[3], pitch)
    robot.scans += 1
    robot.measurements += measurements
    robot.i_min_bits = robot.next_i_min_bits
    copy_numbers((x, y, z, yaw, pitch), robot.scan_pose, 5)
    note_scan_pose(team.localization, index, here)
    note_scan(robot, mission.latest, scan, index)
    if params.track_truth:
        score_scan(clock, mission.joint, mission.truth, scan, params.prior_precision)
        note_seen(team.params, clock, team.robots)
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
        collect_batch(team, mission.buffers, mission.phases, scan, index, count)


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
