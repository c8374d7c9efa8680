"""A scenario as compiled code takes it: parameters, sensors, actions."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from entropy_explore_env.belief.pooling import Cells, new_cells, no_cells
from entropy_explore_env.compilation.kernels import record_type
from entropy_explore_env.robots.faults import FAULT_PARAMS
from entropy_explore_env.robots.localization import LOCALIZATION_PARAMS
from entropy_explore_env.robots.range_sensor import SensorModel, team_sensors
from entropy_explore_env.robots.rotations import directions_of
from entropy_explore_env.settings.observation import Observation
from entropy_explore_env.settings.robot import Robot
from entropy_explore_env.settings.scenario import Scenario

PARAMS = record_type(
    [
        ("size", "i8", (3,)),  # X, Y, Z voxels
        ("voxel_size_m", "f8"),
        ("origin_m", "f8", (3,)),  # lower corner of voxel (0, 0, 0)
        ("prior_precision", "f8"),
        ("end_precision", "f8"),
        ("discrete", "?"),
        ("proposed", "?"),  # whether actions are numbers of candidates
        (
            "action_axes",
            "i8",
        ),  # components of an action that are a displacement: 2 if the whole team is planar
        ("pitches", "i8"),  # of discrete gazes
        # of the robot
        ("kind", "i8"),  # the number of its kind
        ("body_number", "i8"),  # its number among `collision_bodies`
        ("planar", "?"),
        ("level", "?"),  # whether it is planar and never looks up or down
        ("planned", "?"),  # whether it plans its paths
        ("reach_m", "f8"),
        ("max_speed_m_s", "f8"),
        ("acceleration_m_s2", "f8"),
        ("turn_rate_rad_s", "f8"),
        ("body_radius_m", "f8"),
        ("blocked_wait_s", "f8"),  # 0 = a blocked robot decides anew at once
        ("redecide_on_scan", "?"),
        ("redecide_every_s", "f8"),  # inf = not by time
        ("scan_time_s", "f8"),
        ("scan_every_m", "f8"),
        ("rays", "i8"),  # R of its sensor
        # of all
        ("bodies", "i8"),  # how many `collision_bodies` there are
        ("burst", "i8"),
        ("i_min_bits", "f8"),
        ("i_min_fill", "f8"),  # 0 = I_min stays as it is
        ("channel_range_m", "f8"),
        ("line_of_sight", "?"),  # whether messages need it; else, where they pass through air, these:
        ("budget_db", "f8"),  # of Signal, as the next two
        ("path_loss_exponent", "f8"),
        ("wall_loss_db_per_m", "f8"),
        ("loss_probability", "f8"),
        ("delay_s", "f8"),
        ("longest_delay_s", "f8"),  # with that of late messages
        ("announcements", "?"),
        ("phase_s", "f8"),
        ("summary_every_s", "f8"),  # 0 where no summaries are sent
        ("summary_threshold_bits", "f8"),
        ("period_s", "f8"),  # length of a step; inf = until the next robot has to decide
        ("all_maps", "?"),
        ("shared_maps", "?"),  # those of all robots that still work
        ("one_map", "?"),  # that of one robot that still works
        ("by_seen", "?"),  # whether the mission ends by what was seen
        ("time_limit_s", "f8"),
        ("max_cycles", "i8"),
        ("team_reward", "?"),
        ("cost_per_s", "f8"),
        ("panorama_log", "?"),
        ("track_truth", "?"),
    ],
)
"""The parameters of a scenario for one of its robots, in the units of `settings`; inf = never, or all."""

_NEVER = 2**62


class ActionSet(NamedTuple):
    """The discrete actions: K moves × D gazes."""

    moves: np.ndarray
    """(K, 3) int64, in voxels."""
    gazes: np.ndarray
    """(D, 2) float64: yaw, pitch."""


class Rules(NamedTuple):
    """A scenario for compiled code."""

    params: np.ndarray
    """(A,) PARAMS; what is not the robot's own is the same in all."""
    sensors: SensorModel
    """Of the team."""
    actions: ActionSet
    cells: Cells
    """Of the overview; none without it."""
    panorama: np.ndarray
    """(D, 3) float64 unit vectors of the panorama's rays; D = 0 without it."""
    faults: np.ndarray | None
    """(A,) FAULT_PARAMS; None = nothing goes wrong."""
    localization: np.ndarray | None
    """(A,) LOCALIZATION_PARAMS; None = all robots know where they are."""
    slots: int | None
    """Most messages that are under way at once; None = all arrive at once."""
    repeats: int | None
    """How often a batch is broadcast in a phase; None = batches are sent at once."""


def rules_of(scenario: Scenario) -> Rules:
    """Return the rules of a scenario."""
    ending, channel = scenario.ending, scenario.channel
    bodies, pitches = collision_bodies(scenario), 1 if scenario.planar else scenario.action.pitches
    shared = {
        "size": scenario.grid.shape,
        "voxel_size_m": scenario.grid.voxel_size_m,
        "origin_m": scenario.grid.origin_m,
        "prior_precision": np.float32(scenario.sigma_prior**-2),
        "end_precision": ending.sigma_end**-2,
        "discrete": scenario.action.kind == "discrete",
        "proposed": scenario.action.kind == "candidates",
        "action_axes": 2 if scenario.planar else 3,
        "pitches": pitches,
        "bodies": len(bodies),
        "burst": min(channel.burst, max(kind.sensor.rays for kind in scenario.kinds)),
        "i_min_bits": channel.i_min_bits,
        "i_min_fill": channel.i_min_fill or 0.0,
        "channel_range_m": channel.range_m,
        "line_of_sight": channel.reach == "line_of_sight",
        "budget_db": channel.signal.budget_db,
        "path_loss_exponent": channel.signal.exponent,
        "wall_loss_db_per_m": channel.signal.wall_loss_db_per_m,
        "loss_probability": channel.loss_probability,
        "delay_s": channel.delay_s,
        "longest_delay_s": scenario.longest_delay_s,
        "announcements": channel.announcements,
        "phase_s": channel.phase_s,
        "summary_every_s": channel.summary_every_s if scenario.shares_summaries else 0.0,
        "summary_threshold_bits": channel.summary_threshold_bits,
        "period_s": math.inf if scenario.decision_period_s is None else scenario.decision_period_s,
        "all_maps": ending.termination == "all",
        "shared_maps": ending.termination == "shared",
        "one_map": ending.termination == "one",
        "by_seen": ending.by_seen,
        "time_limit_s": ending.time_limit_s,
        "max_cycles": _NEVER if ending.max_cycles is None else ending.max_cycles,
        "team_reward": scenario.reward.kind == "team",
        "cost_per_s": scenario.reward.cost_per_s,
        "track_truth": scenario.track_truth,
        "panorama_log": scenario.observation.panorama_utility == "log2",
    }
    params = np.zeros(scenario.robots, PARAMS)
    for name, value in shared.items():
        params[name] = value
    for number in range(scenario.robots):
        robot, sensor = scenario.kind_of(number).robot, scenario.kind_of(number).sensor
        own = params[number]
        own["kind"] = number % len(scenario.kinds)
        own["body_number"] = bodies.index(_collision_body(scenario, robot))
        own["planar"] = scenario.layer_of(robot) is not None
        own["level"] = scenario.looks_level(robot)
        own["planned"] = robot.navigator == "planned"
        for name in ("reach_m", "max_speed_m_s", "acceleration_m_s2", "turn_rate_rad_s", "body_radius_m"):
            own[name] = getattr(robot, name)
        own["blocked_wait_s"] = robot.blocked_wait_s if robot.when_blocked == "wait" else 0.0
        own["redecide_on_scan"] = robot.redecide == "on_scan"
        own["redecide_every_s"] = math.inf if isinstance(robot.redecide, str) else robot.redecide
        for name in ("scan_time_s", "scan_every_m", "rays"):
            own[name] = getattr(sensor, name)
    overview, size = overview_shape(scenario), scenario.grid.shape
    return Rules(
        params=params,
        sensors=team_sensors([scenario.kind_of(number).sensor for number in range(scenario.robots)]),
        actions=ActionSet(discrete_moves(scenario), gaze_set(scenario.action.yaws, pitches)),
        cells=no_cells(size) if overview is None else new_cells(size, overview),
        panorama=panorama_directions(scenario),
        faults=fault_params(scenario),
        localization=localization_params(scenario),
        slots=scenario.message_slots or None,
        repeats=channel.repeats if channel.phase_s > 0.0 else None,
    )


def action_count(scenario: Scenario, rules: Rules) -> int:
    """Return the number of actions where they are numbers."""
    if scenario.action.kind == "candidates":
        return scenario.action.candidates
    return len(rules.actions.moves) * len(rules.actions.gazes)


def fault_params(scenario: Scenario) -> np.ndarray | None:
    """Return (A,) FAULT_PARAMS, what is wrong with each robot; None = nothing ever is."""
    if not scenario.faults.happen:
        return None
    params = np.zeros(scenario.robots, FAULT_PARAMS)
    params["range_factor"] = 1.0
    names = {
        "sensor": ("lost_rays", "range_factor", "range_bias_m"),
        "radio": ("garbled", "repeated", "late", "late_s"),
    }
    for part, fields in names.items():
        fault = getattr(scenario.faults, part)
        rows = list(fault.robots) or slice(None)
        for name in fields:
            params[name][rows] = getattr(fault, name)
    return params


def localization_params(scenario: Scenario) -> np.ndarray | None:
    """Return (A,) LOCALIZATION_PARAMS, how each robot localises itself; None = all know where they are."""
    if not scenario.drifts:
        return None
    params, fiducials = np.zeros(scenario.robots, LOCALIZATION_PARAMS), scenario.fiducials
    for number in range(scenario.robots):
        kind, own = scenario.kind_of(number), params[number]
        drift, sensor = kind.robot.localization, kind.sensor
        flies = scenario.layer_of(kind.robot) is None
        own["xy_per_m"] = drift.xy_m_per_sqrt_m**2
        own["z_per_m"] = drift.z_m_per_sqrt_m**2 if flies else 0.0
        own["yaw_per_m"] = drift.yaw_rad_per_sqrt_m**2
        own["yaw_per_rad"] = drift.yaw_rad_per_sqrt_rad**2
        own["range_m"] = min(fiducials.range_m, sensor.max_range_m)
        own["range_sigma_m"], own["bearing_sigma_rad"] = fiducials.range_sigma_m, fiducials.bearing_sigma_rad
        own["landmark_score"], own["landmarks_apart_m"] = fiducials.own_score, fiducials.own_apart_m
        own["half_yaw_rad"] = 0.5 * sensor.columns * sensor.angular_step_rad
        own["half_pitch_rad"] = math.pi if scenario.grid.flat else 0.5 * sensor.rows * sensor.angular_step_rad
    return params


class Body(NamedTuple):
    """What a collision mask depends on."""

    radius_m: float
    """0 = only the voxel that it is in counts."""
    ground_layer: int | None
    """Layer of the ground that must carry it; None = it needs none."""


POINT = Body(0.0, None)
"""A body that collides with solid voxels alone, so that it needs no collision mask of its own."""


def collision_bodies(scenario: Scenario) -> list[Body]:
    """Return the team's bodies that differ in what they collide with."""
    return list(dict.fromkeys(_collision_body(scenario, kind.robot) for kind in scenario.kinds))


def _collision_body(scenario: Scenario, robot: Robot) -> Body:
    small = robot.body_radius_m <= 0.5 * scenario.grid.voxel_size_m + 1e-9
    ground = scenario.ground_layer_of(robot)
    return Body(0.0 if small and ground is None else robot.body_radius_m, ground)


def overview_shape(scenario: Scenario) -> tuple[int, int, int] | None:
    """Return the overview's cells: as set, but at most the voxels along an axis; None without it."""
    if not scenario.observation.overview:
        return None
    x, y, z = scenario.observation.overview_shape
    return min(x, scenario.grid.shape[0]), min(y, scenario.grid.shape[1]), min(z, scenario.grid.shape[2])


def gaze_set(yaws: int, pitches: int) -> np.ndarray:
    """Return (yaws·pitches, 2) float64: yaw from 0 counter-clockwise, pitch from -π/4 (up) to π/4 (down)."""
    yaw = np.arange(yaws) * (2.0 * math.pi / yaws)
    yaw = np.where(yaw > math.pi, yaw - 2.0 * math.pi, yaw)
    pitch = np.linspace(-math.pi / 4, math.pi / 4, pitches) if pitches > 1 else np.zeros(1)
    return np.stack(np.meshgrid(yaw, pitch, indexing="ij"), axis=-1).reshape(-1, 2)


def discrete_moves(scenario: Scenario) -> np.ndarray:
    """Return (K, 3) int64 voxel offsets within reach, the nearest first; the first is to stay.

    The reach is the longest one of the team; a team of planar robots has none that change height. Where the
    scenario asks for moves along the axes, the farthest one each way. (1, 3) zeros where actions are not
    discrete.
    """
    if scenario.action.kind != "discrete":
        return np.zeros((1, 3), np.int64)
    reach_m = max(kind.robot.reach_m for kind in scenario.kinds)
    reach = reach_m / scenario.grid.voxel_size_m + 1e-9
    farthest = [min(math.floor(reach), n - 1) for n in scenario.grid.shape]
    if scenario.in_planes:
        farthest[2] = 0
    axes_only = scenario.action.moves == "axes"
    offsets = _along_axes(farthest) if axes_only else _within_box(farthest)
    lengths = np.sqrt((offsets**2).sum(axis=1))
    offsets, lengths = offsets[lengths <= reach], lengths[lengths <= reach]
    return np.ascontiguousarray(offsets[np.argsort(lengths, kind="stable")], np.int64)


def _along_axes(farthest: list[int]) -> np.ndarray:
    """Return (K, 3) offsets: to stay, and so far along each axis, both ways; in lexicographic order."""
    offsets = np.zeros((7, 3), np.int64)
    for axis, most in enumerate(farthest):
        offsets[1 + 2 * axis : 3 + 2 * axis, axis] = -most, most
    return np.unique(offsets, axis=0)  # an axis without room adds nothing


def _within_box(farthest: list[int]) -> np.ndarray:
    """Return (K, 3) offsets up to so far along each axis, in lexicographic order."""
    steps = [np.arange(-most, most + 1) for most in farthest]
    return np.stack(np.meshgrid(*steps, indexing="ij"), axis=-1).reshape(-1, 3)


def panorama_directions(scenario: Scenario) -> np.ndarray:
    """Return (D, 3) float64 unit vectors of the panorama's rays, map frame; (0, 3) without it."""
    settings: Observation = scenario.observation
    if not settings.panorama:
        return np.zeros((0, 3))
    yaws = settings.panorama_yaws or (32 if scenario.grid.flat else 16)
    gazes = gaze_set(yaws, 1 if scenario.planar else settings.panorama_pitches)
    return directions_of(gazes[:, 0], gazes[:, 1])
