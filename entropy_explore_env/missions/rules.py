"""The numbers of a scenario that compiled code needs, in one tuple."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from entropy_explore_env.belief.pooling import Cells, new_cells
from entropy_explore_env.config import Observation, Scenario
from entropy_explore_env.robots.range_sensor import SensorModel, sensor_model

NUMBERS = np.dtype(
    [
        ("size", "i8", (3,)),  # X, Y, Z voxels
        ("voxel_size_m", "f8"),
        ("origin_m", "f8", (3,)),  # lower corner of voxel (0, 0, 0)
        ("prior_precision", "f8"),
        ("end_precision", "f8"),
        ("planar", "?"),
        ("discrete", "?"),
        ("reach_m", "f8"),
        ("max_speed_m_s", "f8"),
        ("acceleration_m_s2", "f8"),
        ("turn_rate_rad_s", "f8"),
        ("body_radius_m", "f8"),
        ("scan_time_s", "f8"),
        ("scan_every_m", "f8"),
        ("burst", "i8"),
        ("i_min_bits", "f8"),
        ("channel_range_m", "f8"),
        ("loss_probability", "f8"),
        ("delay_s", "f8"),
        ("announcements", "?"),
        ("period_s", "f8"),  # length of a step; inf = until the next robot has to decide
        ("all_maps", "?"),
        ("time_limit_s", "f8"),
        ("max_cycles", "i8"),
        ("team_reward", "?"),
        ("cost_per_s", "f8"),
        ("panorama_log", "?"),
        ("scored", "?"),
    ],
    align=True,
)
"""The numbers of a scenario, in the units of `config`; inf stands for "never" and "all"."""

_NEVER = 2**62


class Rules(NamedTuple):
    """A scenario for compiled code; D gazes or directions."""

    numbers: np.ndarray
    """(1,) NUMBERS."""
    sensor: SensorModel
    moves: np.ndarray
    """(K, 3) int64, discrete moves in voxels."""
    gazes: np.ndarray
    """(D, 2) float64, discrete gazes: yaw, pitch."""
    delayed: int | None
    """None where messages arrive at once: then nothing of the mail is compiled."""
    cells: Cells | None
    """Of the overview; None without it."""
    panorama: np.ndarray
    """(D, 3) float64 unit vectors of the panorama's rays; D = 0 without it."""


def rules_of(scenario: Scenario) -> Rules:
    """The rules of a scenario."""
    ending, robot, channel = scenario.ending, scenario.robot, scenario.channel
    values = {
        "size": scenario.grid.shape,
        "voxel_size_m": scenario.grid.voxel_size_m,
        "origin_m": scenario.grid.origin_m,
        "prior_precision": np.float32(scenario.sigma_prior**-2),
        "end_precision": ending.sigma_end**-2,
        "planar": scenario.planar,
        "discrete": scenario.action.kind == "discrete",
        "reach_m": robot.reach_m,
        "max_speed_m_s": robot.max_speed_m_s,
        "acceleration_m_s2": robot.acceleration_m_s2,
        "turn_rate_rad_s": robot.turn_rate_rad_s,
        "body_radius_m": robot.body_radius_m,
        "scan_time_s": scenario.sensor.scan_time_s,
        "scan_every_m": scenario.sensor.scan_every_m,
        "burst": min(channel.burst, scenario.sensor.rays),
        "i_min_bits": channel.i_min_bits,
        "channel_range_m": channel.range_m,
        "loss_probability": channel.loss_probability,
        "delay_s": channel.delay_s,
        "announcements": channel.announcements,
        "period_s": math.inf if scenario.decision_period_s is None else scenario.decision_period_s,
        "all_maps": ending.whose == "all",
        "time_limit_s": ending.time_limit_s,
        "max_cycles": _NEVER if ending.max_cycles is None else ending.max_cycles,
        "team_reward": scenario.reward.kind == "team",
        "cost_per_s": scenario.reward.cost_per_s,
        "scored": scenario.scored,
        "panorama_log": scenario.observation.panorama_utility == "log2",
    }
    numbers = np.zeros(1, NUMBERS)
    for name in numbers.dtype.names or ():
        numbers[name] = values[name]
    return Rules(
        numbers=numbers,
        sensor=sensor_model(scenario.sensor),
        moves=discrete_moves(scenario),
        gazes=gaze_set(scenario.action.yaws, 1 if scenario.planar else scenario.action.pitches),
        delayed=1 if channel.delay_s > 0.0 else None,
        cells=None if (shape := overview_shape(scenario)) is None else new_cells(scenario.grid.shape, shape),
        panorama=panorama_directions(scenario),
    )


def overview_shape(scenario: Scenario) -> tuple[int, int, int] | None:
    """Cells of the overview: as set, but no more than there are voxels along an axis; None without it."""
    if not scenario.observation.overview:
        return None
    x, y, z = scenario.observation.overview_shape
    return min(x, scenario.grid.shape[0]), min(y, scenario.grid.shape[1]), min(z, scenario.grid.shape[2])


def gaze_set(yaws: int, pitches: int) -> np.ndarray:
    """(yaws·pitches, 2) float64: yaw from 0 counter-clockwise, pitch from -π/4 (up) to π/4 (down)."""
    yaw = np.arange(yaws) * (2.0 * math.pi / yaws)
    yaw = np.where(yaw > math.pi, yaw - 2.0 * math.pi, yaw)
    pitch = np.linspace(-math.pi / 4, math.pi / 4, pitches) if pitches > 1 else np.zeros(1)
    return np.stack(np.meshgrid(yaw, pitch, indexing="ij"), axis=-1).reshape(-1, 2)


def discrete_moves(scenario: Scenario) -> np.ndarray:
    """(K, 3) int64 voxel offsets within reach, the nearest first; the first is to stay.

    Planar robots have none that change height. (1, 3) zeros where actions are not discrete.
    """
    if scenario.action.kind != "discrete":
        return np.zeros((1, 3), np.int64)
    reach = scenario.robot.reach_m / scenario.grid.voxel_size_m + 1e-9
    farthest = [min(math.floor(reach), n - 1) for n in scenario.grid.shape]
    if scenario.layer is not None:
        farthest[2] = 0
    steps = [np.arange(-most, most + 1) for most in farthest]
    offsets = np.stack(np.meshgrid(*steps, indexing="ij"), axis=-1).reshape(-1, 3)
    lengths = np.sqrt((offsets**2).sum(axis=1))
    offsets, lengths = offsets[lengths <= reach], lengths[lengths <= reach]
    return np.ascontiguousarray(offsets[np.argsort(lengths, kind="stable")], np.int64)


def panorama_directions(scenario: Scenario) -> np.ndarray:
    """(D, 3) float64 unit vectors of the panorama's rays, map frame; (0, 3) without it."""
    settings: Observation = scenario.observation
    if not settings.panorama:
        return np.zeros((0, 3))
    yaws = settings.panorama_yaws or (32 if scenario.grid.flat else 16)
    gazes = gaze_set(yaws, 1 if scenario.planar else settings.panorama_pitches)
    yaw, pitch = gazes[:, 0], gazes[:, 1]
    directions = [np.cos(yaw) * np.cos(pitch), np.sin(yaw) * np.cos(pitch), -np.sin(pitch)]
    return np.ascontiguousarray(np.stack(directions, axis=-1))
