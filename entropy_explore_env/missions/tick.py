"""One step of one mission, compiled: choose → drive → scan → fuse → select → send → fuse → account.

The events of a mission (a robot has driven and scanned; a message arrives) are worked off in the
order of simulated time; of events at the same instant messages come first, then robots by number.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from entropy_explore_env.missions.action import decode_action
from entropy_explore_env.missions.observation import observe_robot
from entropy_explore_env.missions.reward import reward_robots
from entropy_explore_env.missions.state import MissionEnd
from entropy_explore_env.robots.channel import (
    BITS_PER_ANNOUNCEMENT,
    BITS_PER_BATCH,
    BITS_PER_MEASUREMENT,
    Delivery,
    deliver,
    select_measurements,
)
from entropy_explore_env.robots.motion import (
    MoveEnd,
    driven_share,
    driving_time,
    free_way,
    turning_time,
    way_to_teammate,
)
from entropy_explore_env.robots.range_sensor import (
    Return,
    fuse_scan,
    in_view,
    take_scan,
    trace_measurement,
    visibility_parameters,
)

_RUNNING, _MAPPED, _TIME_UP, _CYCLES_UP = (end.code for end in MissionEnd)
_ARRIVED, _TEAMMATE = MoveEnd.ARRIVED.code, MoveEnd.TEAMMATE.code
_HEARD, _OUT_OF_RANGE, _LOST = (delivery.code for delivery in Delivery)
_NOTHING = int(Return.NOTHING)
_ANNOUNCEMENT = np.int64(-1)
"""In place of a number of measurements. A NumPy integer, so that `send` compiles for one type."""


@njit(cache=True, nogil=True, error_model="numpy")
def step_missions(rules, parts, state, scan, boxes, numbers, first, last, out):
    """Advance the missions `first` … `last` - 1 by one step; those that are over stand still.

    Args:
        rules: The scenario.
        parts: Its ObservationRules.
        state: The MissionState of E missions, changed in place.
        scan: Scratch space, not shared with another thread.
        boxes: (E, A, N) float64 continuous actions.
        numbers: (E, A) int64 discrete actions.
        first: The first mission.
        last: One past the last.
        out: (E, A, F) float32 observations, filled in.
    """
    for mission in range(first, last):
        if state.missions[mission].end == _RUNNING:
            step_mission(rules, state, scan, mission, boxes[mission], numbers[mission])
        observe_mission(rules, parts, state, scan, mission, out[mission])


@njit(cache=True, nogil=True, error_model="numpy")
def observe_mission(rules, parts, state, scan, mission, out):
    """Fill (A, F) float32, the observations of a mission's robots."""
    for robot in range(state.robots.shape[1]):
        pose = pose_at(rules.numbers[0], state.robots[mission, robot], state.missions[mission].time_s)
        observe_robot(rules, parts, state, scan, mission, robot, pose, out[robot])


@njit(cache=True, nogil=True, error_model="numpy")
def step_mission(rules, state, scan, mission, boxes, numbers):
    """One step of one mission: what happens between two observations."""
    clock, robots = state.missions[mission], state.robots[mission]
    before_s = clock.time_s
    for robot in range(len(robots)):
        robots[robot].own_bits = 0.0
        robots[robot].received_bits = 0.0
        if robots[robot].deciding:
            decode_action(rules, robots[robot].goal, boxes[robot], numbers[robot], robots[robot].target)
            depart(rules.numbers[0], state.blocked[mission], robots, robot, clock.time_s, scan)
            announce(rules, state, scan, mission, robot)
    advance(rules, state, scan, mission)
    clock.cycles += 1
    if clock.end == _RUNNING and clock.cycles >= rules.numbers[0].max_cycles:
        clock.end = _CYCLES_UP
    cost = rules.numbers[0].cost_per_s * (clock.time_s - before_s)
    bits_to_gain = clock.entropy_start_bits - clock.entropy_end_bits
    reward_robots(robots, bits_to_gain, rules.numbers[0].team_reward, cost)


@njit(cache=True, nogil=True, error_model="numpy")
def pose_at(numbers, robot, time_s):
    """(5,) float64 pose of a robot at a time between its departure and its next one."""
    origin, goal = robot.origin, robot.goal
    elapsed = time_s - robot.depart_s
    pose = np.empty(5)
    copy_numbers(goal, pose, 5)
    if time_s >= robot.ready_s - numbers.scan_time_s:
        return pose
    length = math.sqrt((goal[0] - origin[0]) ** 2 + (goal[1] - origin[1]) ** 2 + (goal[2] - origin[2]) ** 2)
    share = driven_share(elapsed, length, numbers.max_speed_m_s, numbers.acceleration_m_s2)
    if share < 1.0:
        for axis in range(3):
            pose[axis] = origin[axis] + share * (goal[axis] - origin[axis])
    turn = turning_time(origin[3], origin[4], goal[3], goal[4], numbers.turn_rate_rad_s)
    if elapsed < turn:
        short_way = (goal[3] - origin[3] + math.pi) % (2.0 * math.pi) - math.pi
        most = elapsed * numbers.turn_rate_rad_s
        pose[3] = origin[3] + min(max(short_way, -most), most)
        pose[4] = origin[4] + min(max(goal[4] - origin[4], -most), most)
    return pose


@njit(cache=True, nogil=True, error_model="numpy")
def grid_position(numbers, pose):
    """(3,) float64 position in grid units."""
    position = np.empty(3)
    for axis in range(3):
        position[axis] = (pose[axis] - numbers.origin_m[axis]) / numbers.voxel_size_m
    return position


@njit(cache=True, nogil=True, error_model="numpy")
def copy_numbers(source, target, count):
    """Copy the first `count` numbers; a loop compiles ten times as fast as an array assignment."""
    for i in range(count):
        target[i] = source[i]


@njit(cache=True, nogil=True, error_model="numpy")
def depart(numbers, blocked, robots, index, time_s, scan):
    """Commit a robot to its target: how far it will get, why no farther, and when it has scanned."""
    robot = robots[index]
    origin, goal = robot.origin, robot.goal
    copy_numbers(goal, origin, 5)
    copy_numbers(robot.target, goal, 5)
    robot.depart_s = time_s
    robot.deciding = False
    start = grid_position(numbers, origin)
    direction = grid_position(numbers, goal)
    length = 0.0
    for axis in range(3):
        direction[axis] -= start[axis]
        length += direction[axis] * direction[axis]
    length = math.sqrt(length)
    way, code = 0.0, _ARRIVED
    if length > 0.0:
        for axis in range(3):
            direction[axis] /= length
        size = (numbers.size[0], numbers.size[1], numbers.size[2])
        way, code = free_way(blocked, size, start, direction, length, scan.crossed[0], scan.entered)
        for mate in range(len(robots)):
            if mate != index and numbers.body_radius_m > 0.0:
                begin = grid_position(numbers, pose_at(numbers, robots[mate], time_s))
                finish = grid_position(numbers, robots[mate].goal)
                touching = 2.0 * numbers.body_radius_m / numbers.voxel_size_m
                clear = way_to_teammate(start, direction, way, begin, finish, touching)
                if clear < way:
                    way, code = clear, _TEAMMATE
        if code != _ARRIVED:
            for axis in range(3):
                goal[axis] = origin[axis] + direction[axis] * way * numbers.voxel_size_m
            robot.blocked_moves += 1
    robot.move_end = code
    way_m = way * numbers.voxel_size_m
    robot.distance_m += way_m
    drive_s = driving_time(way_m, numbers.max_speed_m_s, numbers.acceleration_m_s2)
    turn_s = turning_time(origin[3], origin[4], goal[3], goal[4], numbers.turn_rate_rad_s)
    robot.ready_s = time_s + max(drive_s, turn_s) + numbers.scan_time_s


@njit(cache=True, nogil=True, error_model="numpy")
def advance(rules, state, scan, mission):
    """Work off the events up to the end of the step, the time limit or the mission's end."""
    clock, robots, mail = state.missions[mission], state.robots[mission], state.mail[mission]
    target_s = clock.time_s + rules.numbers[0].period_s
    if math.isinf(target_s):
        target_s = next_robot(robots)[1]
    stop_s = min(target_s, rules.numbers[0].time_limit_s)
    while clock.end == _RUNNING:
        letter, due_s = next_letter(mail)
        robot, ready_s = next_robot(robots)
        if min(due_s, ready_s) > stop_s:
            break
        if due_s <= ready_s:
            clock.time_s = max(clock.time_s, due_s)
            open_letter(rules, state, scan, mission, letter)
        else:
            clock.time_s = ready_s
            scan_and_share(rules, state, scan, mission, robot)
            robots[robot].deciding = True
        if mapped(robots, clock.entropy_end_bits, rules.numbers[0].all_maps):
            clock.end = _MAPPED
    if clock.end == _RUNNING:
        clock.time_s = max(clock.time_s, stop_s)
        if stop_s >= rules.numbers[0].time_limit_s:
            clock.end = _TIME_UP


@njit(cache=True, nogil=True, error_model="numpy")
def next_robot(robots):
    """(robot, time) of the next robot that has driven and scanned; time inf if all decide."""
    soonest, ready_s = 0, math.inf
    for robot in range(len(robots)):
        if not robots[robot].deciding and robots[robot].ready_s < ready_s:
            soonest, ready_s = robot, robots[robot].ready_s
    return soonest, ready_s


@njit(cache=True, nogil=True, error_model="numpy")
def next_letter(mail):
    """(place, time) of the next message that arrives, the earlier sent first; time inf if none."""
    soonest, due_s = 0, math.inf
    for letter in range(len(mail)):
        due = mail[letter].due_s
        if due < due_s or (
            due == due_s and not math.isinf(due) and mail[letter].serial < mail[soonest].serial
        ):
            soonest, due_s = letter, due
    return soonest, due_s


@njit(cache=True, nogil=True, error_model="numpy")
def mapped(robots, entropy_end_bits, all_maps):
    """Whether one robot's map, or all maps, passed the threshold (Rocha04, eq. 41)."""
    passed = 0
    for robot in robots:
        if robot.entropy_bits <= entropy_end_bits:
            passed += 1
    return passed == len(robots) if all_maps else passed > 0


@njit(cache=True, nogil=True, error_model="numpy")
def scan_and_share(rules, state, scan, mission, index):
    """A robot measures from where its drive ended, fuses, and sends what is most useful."""
    numbers, robot = rules.numbers[0], state.robots[mission, index]
    goal = robot.goal
    size = (numbers.size[0], numbers.size[1], numbers.size[2])
    start = grid_position(numbers, goal)
    bodies = place_bodies(
        rules, state.robots[mission], index, state.missions[mission].time_s, start, scan.bodies
    )
    take_scan(
        scan,
        rules.sensor,
        state.truth[mission],
        size,
        numbers.voxel_size_m,
        start,
        goal[3],
        goal[4],
        bodies,
        robot.sensor_chance,
    )
    for ray in range(len(scan.order)):
        scan.order[ray] = ray
    bits = fuse_scan(scan, len(scan.order), state.mean[mission, index], state.precision[mission, index])
    robot.entropy_bits -= bits
    robot.own_bits += bits
    robot.depth_m, robot.half_angle_rad, measurements = visibility_parameters(scan.rays, goal[3], goal[4])
    robot.scans += 1
    robot.measurements += measurements
    copy_numbers(goal, robot.scan_pose, 5)
    for ray in range(len(scan.rays)):
        state.scan_range_m[mission, index, ray] = scan.rays[ray].range_m
        state.scan_returned[mission, index, ray] = scan.rays[ray].returned
        state.scan_utility_bits[mission, index, ray] = scan.utility[ray]
        if scan.rays[ray].returned == _NOTHING:
            scan.utility[ray] = -1.0
    if state.robots.shape[1] > 1 and numbers.burst > 0:
        count = select_measurements(scan.utility, numbers.burst, numbers.i_min_bits, scan.order)
        if count > 0:
            send(rules, state, scan, mission, index, count)


@njit(cache=True, nogil=True, error_model="numpy")
def place_bodies(rules, robots, index, time_s, start, bodies):
    """Put the teammates' bodies that the robot may see, in grid units, into `bodies`; returns how many."""
    numbers, goal, count = rules.numbers[0], robots[index].goal, 0
    if numbers.body_radius_m > 0.0:
        for mate in range(len(robots)):
            if mate != index:
                copy_numbers(grid_position(numbers, pose_at(numbers, robots[mate], time_s)), bodies[count], 3)
                bodies[count, 3] = numbers.body_radius_m / numbers.voxel_size_m
                if in_view(rules.sensor, goal[3], goal[4], start, bodies[count]):
                    count += 1
    return count


@njit(cache=True, nogil=True, error_model="numpy")
def announce(rules, state, scan, mission, robot):
    """Tell the teammates the chosen viewpoint with r̂ and α̂ (RochaMI)."""
    if state.robots.shape[1] > 1 and rules.numbers[0].announcements:
        send(rules, state, scan, mission, robot, _ANNOUNCEMENT)


@njit(cache=True, nogil=True, error_model="numpy")
def send(rules, state, scan, mission, index, count):
    """Broadcast a batch of `count` measurements (`scan.order`), or an announcement (count = -1)."""
    numbers, clock, robot = rules.numbers[0], state.missions[mission], state.robots[mission, index]
    here = robot.origin if count < 0 else robot.goal
    robot.messages_sent += 1
    robot.measurements_sent += max(count, 0)
    robot.bits_sent += message_bits(count)
    letter = -1
    for mate in range(state.robots.shape[1]):
        if mate == index:
            continue
        apart_m = 0.0
        if not math.isinf(numbers.channel_range_m):
            there = pose_at(numbers, state.robots[mission, mate], clock.time_s)
            apart_m = math.sqrt(
                (here[0] - there[0]) ** 2 + (here[1] - there[1]) ** 2 + (here[2] - there[2]) ** 2
            )
        code = deliver(apart_m, numbers.channel_range_m, numbers.loss_probability, robot.channel_chance)
        if code == _LOST:
            robot.messages_lost += 1
        elif code == _OUT_OF_RANGE:
            robot.messages_out_of_range += 1
        elif numbers.delay_s > 0.0:
            if letter < 0:
                letter = post_letter(numbers, state, scan, mission, index, count)
            state.mail_to[mission, letter, mate] = True
        else:
            heard = state.heard[mission, mate, index]
            note_message(state.robots[mission, mate], heard, here, clock.time_s, count)
            if count < 0:
                write_announcement(robot, heard.announced)
            else:
                hear_batch(state, scan, mission, mate, count)


@njit(cache=True, nogil=True, error_model="numpy")
def message_bits(count):
    """What a message costs: a batch of `count` measurements, or an announcement (count = -1)."""
    if count < 0:
        return BITS_PER_ANNOUNCEMENT
    return BITS_PER_BATCH + count * BITS_PER_MEASUREMENT


@njit(cache=True, nogil=True, error_model="numpy")
def write_announcement(robot, announced):
    """Fill (7,): the viewpoint that a robot chose, and r̂ and α̂ of its latest scan."""
    copy_numbers(robot.target, announced, 5)
    announced[5] = robot.depth_m
    announced[6] = robot.half_angle_rad


@njit(cache=True, nogil=True, error_model="numpy")
def note_message(robot, heard, position, sent_s, count):
    """Count a message that a robot hears, and note where its sender was."""
    robot.messages_received += 1
    robot.measurements_received += max(count, 0)
    robot.bits_received += message_bits(count)
    heard.heard_s = sent_s
    copy_numbers(position, heard.position, 3)
    if count < 0:
        heard.announced_s = sent_s


@njit(cache=True, nogil=True, error_model="numpy")
def hear_batch(state, scan, mission, index, count):
    """Fuse received measurements as if the robot had taken them itself (Rocha04, sect. 5)."""
    bits = fuse_scan(scan, count, state.mean[mission, index], state.precision[mission, index])
    state.robots[mission, index].entropy_bits -= bits
    state.robots[mission, index].received_bits += bits


@njit(cache=True, nogil=True, error_model="numpy")
def post_letter(numbers, state, scan, mission, index, count):
    """Put a message into a free place of the mail; returns the place."""
    clock, robot, mail = state.missions[mission], state.robots[mission, index], state.mail[mission]
    place = 0
    while not math.isinf(mail[place].due_s):
        place += 1
    letter = mail[place]
    letter.sent_s = clock.time_s
    letter.due_s = clock.time_s + numbers.delay_s
    letter.serial = clock.letters
    clock.letters += 1
    letter.sender = index
    letter.count = count
    for mate in range(state.robots.shape[1]):
        state.mail_to[mission, place, mate] = False
    copy_numbers(robot.origin if count < 0 else robot.goal, letter.position, 3)
    write_announcement(robot, letter.announced)
    for i in range(count):
        ray, mailed = scan.rays[scan.order[i]], state.mail_rays[mission, place, i]
        copy_numbers(ray.direction, mailed, 3)
        mailed[3] = ray.range_m
        mailed[4] = ray.returned
    return place


@njit(cache=True, nogil=True, error_model="numpy")
def open_letter(rules, state, scan, mission, place):
    """A message arrives: its hearers fuse it, or note what it announces; its place is free again."""
    numbers, letter = rules.numbers[0], state.mail[mission, place]
    letter.due_s = math.inf
    size = (numbers.size[0], numbers.size[1], numbers.size[2])
    start = grid_position(numbers, letter.position)
    for i in range(letter.count):
        ray, mailed = scan.rays[i], state.mail_rays[mission, place, i]
        scan.order[i] = i
        copy_numbers(mailed, ray.direction, 3)
        ray.range_m = mailed[3]
        ray.returned = int(mailed[4])
        trace_measurement(
            scan, i, rules.sensor.numbers[0], size, numbers.voxel_size_m, start, state.truth[mission]
        )
    for robot in range(state.robots.shape[1]):
        if state.mail_to[mission, place, robot]:
            heard = state.heard[mission, robot, letter.sender]
            note_message(state.robots[mission, robot], heard, letter.position, letter.sent_s, letter.count)
            if letter.count < 0:
                copy_numbers(letter.announced, heard.announced, 7)
            else:
                hear_batch(state, scan, mission, robot, letter.count)
