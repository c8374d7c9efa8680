"""One scan of one robot in a mission, compiled: measure → fuse → select → send."""

from __future__ import annotations

from entropy_explore_env.compilation.kernels import lean_kernel
from entropy_explore_env.missions.faults import blinded, spoil
from entropy_explore_env.missions.fiducials import sight_fiducials
from entropy_explore_env.missions.landmarks import choose_landmark, sight_landmarks
from entropy_explore_env.missions.localization import (
    believe_scan,
    believed_pose,
    estimate_of,
    note_scan_pose,
)
from entropy_explore_env.missions.messages import fuse_measurements, send_batch
from entropy_explore_env.missions.need import share_by_need
from entropy_explore_env.missions.own_maps import note_measured
from entropy_explore_env.missions.phases import collect_batch
from entropy_explore_env.missions.poses import copy_numbers, grid_size, pose_at, to_grid_units, within_grid
from entropy_explore_env.missions.scan_log import log_scan
from entropy_explore_env.missions.scoring import note_idle, note_seen, score_scan
from entropy_explore_env.missions.summaries import share_summary
from entropy_explore_env.robots.channel import select_measurements, steered_i_min
from entropy_explore_env.robots.range_sensor import (
    Return,
    Scene,
    SensorPose,
    first_rays,
    take_scan,
    visibility_parameters,
)

_NOTHING = int(Return.NOTHING)


@lean_kernel
def scan_and_share(mission, sensor, index, work):
    """Let a robot measure from where it is, fuse, and send what is most useful."""
    clock, team = mission.clock, mission.team
    params, robot = team.params[index], team.robots[index]
    scan = first_rays(work.scan, params.rays)
    x, y, z, yaw, pitch = pose_at(params, robot, clock.time_s)
    pose = SensorPose(within_grid(params, (x, y, z)), yaw, pitch)
    bodies = work.bodies[: place_bodies(team, index, clock.time_s, work.bodies)]
    scene = Scene(mission.truth, grid_size(params), params.voxel_size_m, bodies)
    if not blinded(team.faults, index, clock.time_s):
        sight_fiducials(team.localization, params, index, sensor, scene, pose)
        sight_landmarks(team.localization, params, index, sensor, scene, pose, work.covariances)
    take_scan(scan, sensor, scene, pose, robot.sensor_rng)
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
    own_map = mission.maps.beliefs.mean[index], mission.maps.beliefs.precision[index]
    choose_landmark(team.localization, params, index, scene, scan, own_map, work.covariances)
    note_scan(robot, mission.latest, scan, index)
    log_scan(work.log, scan, index, clock.time_s, robot.scan_pose)
    if params.track_truth:
        known = clock.explored_visible
        score_scan(clock, mission.joint, mission.truth, scan, params.prior_precision)
        note_idle(clock, team.robots, clock.explored_visible == known)
        note_seen(clock, team.robots)
    if len(team.robots) > 1 and params.burst > 0:
        share(mission, scan, sensor, index, work.recipients)


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
def share(mission, scan, sensor, index, recipients):
    """Select the most useful measurements of a robot's scan, and send them, now or in the next phase.

    Where robots send summaries, send one if it is time; where they send by need, what teammates lack.
    """
    team, params = mission.team, mission.team.params[index]
    robot = team.robots[index]
    note_measured(team.summaries, index, scan, grid_size(params))
    clock, in_flight = mission.clock, mission.in_flight
    if share_summary(team.summaries, team, mission.maps, clock, in_flight, index, recipients):
        return
    if params.i_min_fill > 0.0:
        robot.next_i_min_bits = steered_i_min(robot.i_min_bits, scan.utility, params.burst, params.i_min_fill)
    if share_by_need(team.backlog, mission, scan, sensor, index, recipients):
        return
    count = select_measurements(scan.utility, params.burst, robot.i_min_bits, scan.order)
    if count > 0 and not collect_batch(mission.phases, team, scan, index, count):
        send_batch(team, mission.maps, clock, in_flight, scan, index, count, recipients)


@lean_kernel
def place_bodies(team, index, time_s, bodies):
    """Put the bodies of a robot's teammates, in grid units, into `bodies`; returns how many."""
    count = 0
    for mate in range(len(team.robots)):
        params = team.params[mate]
        if mate != index and params.body_radius_m > 0.0:
            place = to_grid_units(params, pose_at(params, team.robots[mate], time_s))
            copy_numbers(place, bodies[count], 3)
            bodies[count, 3] = params.body_radius_m / params.voxel_size_m
            count += 1
    return count
