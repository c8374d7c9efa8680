"""One step of one mission, compiled: choose → drive → scan → fuse → select → send → fuse → account.

The events of a mission (a robot has driven and scanned; a message arrives) are worked off in the
order of simulated time; of events at the same instant messages come first, then robots by number.
"""

from __future__ import annotations

import math

from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.missions.action import decode_action, write_mask
from entropy_explore_env.missions.driving import depart, drive_on, next_decision, stop
from entropy_explore_env.missions.messages import announce, fuse_measurements, next_letter, open_letter, send
from entropy_explore_env.missions.observation import observe_mission
from entropy_explore_env.missions.phases import broadcast_all, collect_batch, next_broadcast
from entropy_explore_env.missions.poses import copy_numbers, grid_position, pose_at
from entropy_explore_env.missions.reward import reward_robots
from entropy_explore_env.missions.scoring import note_progress, score_scan
from entropy_explore_env.missions.state import MissionEnd
from entropy_explore_env.robots.channel import select_measurements, steered_i_min
from entropy_explore_env.robots.range_sensor import (
    Return,
    first_rays,
    in_view,
    sensor_of,
    take_scan,
    visibility_parameters,
)

_RUNNING, _MAPPED, _TIME_UP, _CYCLES_UP = (end.code for end in MissionEnd)
_NOTHING = int(Return.NOTHING)


@lean_kernel
def step_missions(rules, parts, state, scan, balls, boxes, numbers, first, last, out):
    """Advance the missions `first` … `last` - 1 by one step; those that are over stand still.

    Args:
        rules: The scenario.
        parts: Its ObservationRules.
        state: The MissionState of E missions, changed in place.
        scan: Scratch space, not shared with another thread.
        balls: (K, B, 3) int64, voxels that bodies of each kind of robot touch, by axis; None where no
            robots plan.
        boxes: (E, A, N) float64 continuous actions.
        numbers: (E, A) int64 discrete actions.
        first: The first mission.
        last: One past the last.
        out: (E, A, F) float32 observations, filled in.
    """
    for mission in range(first, last):
        clock = state.missions[mission]
        if clock.end == _RUNNING:
            before_s = clock.time_s
            send_off(rules, state, scan, mission, boxes[mission], numbers[mission])
            advance(rules, state, scan, balls, mission)
            settle(rules, clock, state.robots[mission], before_s)
        observe_mission(rules, parts, state, scan, mission, out[mission])


@lean_kernel
def mask_missions(rules, state, out):
    """Fill (E, A, N) int8, the masks of all robots' discrete actions."""
    for mission in range(out.shape[0]):
        for robot in range(out.shape[1]):
            numbers = rules.numbers[robot]
            pose = pose_at(numbers, state.robots[mission, robot], state.missions[mission].time_s)
            start, mean = grid_position(numbers, pose), state.mean[mission, robot]
            write_mask(rules, robot, start, mean, out[mission, robot])


@lean_kernel
def send_off(rules, state, scan, mission, boxes, numbers):
    """Let the robots that decide choose, announce and depart, one after the other."""
    robots, time_s = state.robots[mission], state.missions[mission].time_s
    for robot in range(len(robots)):
        robots[robot].own_bits = 0.0
        robots[robot].received_bits = 0.0
        if robots[robot].deciding:
            decode_action(
                rules, robot, robots[robot].goal, boxes[robot], numbers[robot], robots[robot].target
            )
            own = rules.numbers[robot]
            blocked = state.blocked[mission * own.radii + own.barriers]
            depart(rules.numbers, blocked, robots, robot, time_s, scan)
            announce(rules, state, scan, mission, robot)


@lean_kernel
def settle(rules, clock, robots, before_s):
    """Count the step, and reward the robots for it."""
    clock.cycles += 1
    if clock.end == _RUNNING and clock.cycles >= rules.numbers[0].max_cycles:
        clock.end = _CYCLES_UP
    cost = rules.numbers[0].cost_per_s * (clock.time_s - before_s)
    bits_to_gain = clock.entropy_start_bits - clock.entropy_end_bits
    reward_robots(robots, bits_to_gain, rules.numbers[0].team_reward, cost)


@lean_kernel
def advance(rules, state, scan, balls, mission):
    """Work off the events up to the end of the step, the time limit or the mission's end."""
    clock, robots, mail = state.missions[mission], state.robots[mission], state.mail[mission]
    target_s = clock.time_s + rules.numbers[0].period_s
    if math.isinf(target_s):
        target_s = next_decision(rules.numbers, robots)
    stop_s = min(target_s, rules.numbers[0].time_limit_s)
    while clock.end == _RUNNING:
        letter, due_s = next_letter(mail)
        robot, scan_s = next_scan(robots)
        broadcast_s = next_broadcast(rules.phased, rules.numbers[0], state, mission)
        if min(due_s, scan_s, broadcast_s) > stop_s:
            break
        if due_s <= scan_s:
            clock.time_s = max(clock.time_s, due_s)
            open_letter(rules.delayed, rules, state, scan, mission, letter)
        elif broadcast_s <= scan_s:
            clock.time_s = max(clock.time_s, broadcast_s)
            broadcast_all(rules.phased, rules, state, scan, mission)
        else:
            clock.time_s = scan_s
            if robots[robot].waiting:
                robots[robot].deciding = True
            else:
                scan_and_share(rules, state, scan, mission, robot)
                if scan_s >= robots[robot].ready_s:
                    stop(rules.numbers[robot], robots[robot], scan_s)
                else:
                    mean = state.mean[mission, robot]
                    drive_on(rules.numbers[robot], balls, mean, robots[robot], scan_s, scan)
                    if math.isinf(rules.numbers[0].period_s):
                        stop_s = min(next_decision(rules.numbers, robots), rules.numbers[0].time_limit_s)
        note_progress(clock, robots)
        if mapped(robots, clock.entropy_end_bits, rules.numbers[0].all_maps):
            clock.end = _MAPPED
    if clock.end == _RUNNING:
        clock.time_s = max(clock.time_s, stop_s)
        if stop_s >= rules.numbers[0].time_limit_s:
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
def scan_and_share(rules, state, team_scan, mission, index):
    """A robot measures from where it is, fuses, and sends what is most useful."""
    numbers, robot = rules.numbers[index], state.robots[mission, index]
    scan, sensor = first_rays(team_scan, numbers.rays), sensor_of(rules.sensors, index)
    time_s = state.missions[mission].time_s
    pose = pose_at(numbers, robot, time_s)
    size = (numbers.size[0], numbers.size[1], numbers.size[2])
    start = grid_position(numbers, pose)
    bodies = place_bodies(rules, sensor, state.robots[mission], index, time_s, pose, start, scan.bodies)
    take_scan(
        scan,
        sensor,
        state.truth[mission],
        size,
        numbers.voxel_size_m,
        start,
        pose[3],
        pose[4],
        bodies,
        robot.sensor_chance,
    )
    for ray in range(len(scan.order)):
        scan.order[ray] = ray
    bits = fuse_measurements(rules, rules.cells, state, scan, mission, index, len(scan.order))
    robot.entropy_bits -= bits
    robot.own_bits += bits
    robot.gained_bits += bits
    robot.depth_m, robot.half_angle_rad, measurements = visibility_parameters(scan.rays, pose[3], pose[4])
    robot.scans += 1
    robot.measurements += measurements
    robot.i_min_bits = robot.next_i_min_bits
    for i in range(5):
        robot.scan_pose[i] = pose[i]
    for ray in range(len(scan.rays)):
        state.scan_range_m[mission, index, ray] = scan.rays[ray].range_m
        state.scan_returned[mission, index, ray] = scan.rays[ray].returned
        state.scan_utility_bits[mission, index, ray] = scan.utility[ray]
        if scan.rays[ray].returned == _NOTHING:
            scan.utility[ray] = -1.0
        elif scan.utility[ray] < robot.i_min_bits:
            robot.redundant += 1
    if numbers.track_truth:
        score_scan(state, scan, mission, numbers.prior_precision)
    if state.robots.shape[1] > 1 and numbers.burst > 0:
        count = select_measurements(scan.utility, numbers.burst, robot.i_min_bits, scan.order)
        if numbers.i_min_fill > 0.0:
            robot.next_i_min_bits = steered_i_min(
                robot.i_min_bits, scan.utility, numbers.burst, numbers.i_min_fill, numbers.i_min_gain
            )
        if count > 0 and rules.phased is None:
            send(rules, state, scan, mission, index, count)
        elif count > 0:
            collect_batch(rules.phased, state, scan, mission, index, count)


@lean_kernel
def place_bodies(rules, sensor, robots, index, time_s, pose, start, bodies):
    """Put the teammates' bodies that the robot may see, in grid units, into `bodies`; returns how many."""
    count = 0
    for mate in range(len(robots)):
        numbers = rules.numbers[mate]
        if mate != index and numbers.body_radius_m > 0.0:
            copy_numbers(grid_position(numbers, pose_at(numbers, robots[mate], time_s)), bodies[count], 3)
            bodies[count, 3] = numbers.body_radius_m / numbers.voxel_size_m
            if in_view(sensor, pose[3], pose[4], start, bodies[count]):
                count += 1
    return count
