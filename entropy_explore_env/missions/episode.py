"""What an episode of a mission begins with: drawn or given, and written into the mission's arrays."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from entropy_explore_env.belief.entropy import map_entropy_bits
from entropy_explore_env.belief.map_update import PRIOR_MEAN
from entropy_explore_env.belief.pooling import fresh_sums
from entropy_explore_env.missions.faults import draw_faults
from entropy_explore_env.missions.fiducials import fiducial_places
from entropy_explore_env.missions.localization import begin_estimates
from entropy_explore_env.missions.reset_options import ResetOptions
from entropy_explore_env.missions.rules import Rules
from entropy_explore_env.missions.starts import checked_starts, start_poses
from entropy_explore_env.missions.state import MissionState
from entropy_explore_env.randomness import Stream, generator, splitmix_states
from entropy_explore_env.settings.ending import gaussian_entropy_bits
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.worlds.load import make_world, require_unchanged
from entropy_explore_env.worlds.sight import driven_up_to, visible_from
from entropy_explore_env.worlds.splits import draw_world_number
from entropy_explore_env.worlds.world import World

_FILLED_WHOLE = ("truth", "collision", "mean", "precision")
"""Arrays that a start fills with something other than zeros: worlds, and beliefs at the prior."""


class FixedWorlds(NamedTuple):
    """Worlds that no recipe makes anew."""

    given: tuple[World, ...]
    """Given as objects."""
    read: World | None
    """From the scenario's file; None where it names none, or where worlds were given."""


class Start(NamedTuple):
    """What a mission starts with."""

    mission: int
    seed: int
    episode: int
    """How many resets without a seed it is behind the seed's own."""
    world: World
    poses: np.ndarray
    """(A, 5) float64."""
    options: ResetOptions
    """What of it was given."""
    world_number: int | None
    """Of the world, where a recipe made it."""
    fiducials: np.ndarray
    """(F, 3) float64."""


def draw_start(
    scenario: Scenario, fixed: FixedWorlds, mission: int, seed: int, episode: int, options: ResetOptions
) -> Start:
    """Return what a mission would start with as an episode of a seed.

    Args:
        fixed: Its worlds that no recipe makes.
        seed: Of all its random streams.
        episode: How many resets without a seed it is behind the seed's own.

    Raises:
        SettingError: Robots cannot be where they were put.
        WorldError: The world has too little room for the team, or its file has changed since it was read.
    """
    number = options.world_number
    if options.world is not None:
        world = options.world
    elif fixed.given:
        world = fixed.given[(seed + episode) % len(fixed.given)]  # the next one with each episode
    elif fixed.read is not None:
        require_unchanged(scenario, fixed.read)
        world = fixed.read
    else:
        if number is None:
            number = draw_world_number(scenario.split, generator(seed, episode, Stream.WORLD))
        world = make_world(scenario, number)
    if options.starts is not None:
        poses = checked_starts(scenario, world, options.starts)
    else:
        poses = start_poses(scenario, world, generator(seed, episode, Stream.STARTS))
    fiducials = fiducial_places(scenario, world, seed, episode)
    return Start(mission, seed, episode, world, poses, options, number, fiducials)


def fill_start(scenario: Scenario, rules: Rules, state: MissionState, start: Start) -> None:
    """Write a mission's start into its arrays: all but its world, which `truth` and `collision` hold already.

    Args:
        state: Changed in place, the rows of this mission alone.
        start: As drawn.
    """
    mission, seed, episode, world = start.mission, start.seed, start.episode, start.world
    prior = rules.params["prior_precision"][0]
    for name, array in state._asdict().items():
        if name not in _FILLED_WHOLE:
            array[mission] = np.zeros((), array.dtype)
    state.mean[mission], state.precision[mission] = PRIOR_MEAN, prior
    state.pooled[mission] = fresh_sums(rules.cells)
    if scenario.track_truth:
        state.joint_mean[mission], state.joint_precision[mission] = PRIOR_MEAN, prior
        _set_seen_goal(scenario, state, mission, start)
    for field in ("reached_s", "seen_s", "seen_m"):
        state.missions[mission][field] = -1.0
    _set_entropies(scenario, state, mission, float(prior), world.visible_voxels(scenario))
    robots = state.robots[mission]
    for field in ("origin", "goal", "target", "scan_pose"):
        robots[field] = start.poses
    robots["deciding"] = True
    robots["redecide_s"] = np.inf
    robots["i_min_bits"] = robots["next_i_min_bits"] = scenario.channel.i_min_bits
    robots["sensor_rng"][:, 0] = splitmix_states(seed, episode, Stream.SENSOR, len(robots))
    robots["channel_rng"][:, 0] = splitmix_states(seed, episode, Stream.CHANNEL, len(robots))
    state.heard[mission]["heard_s"] = state.heard[mission]["announced_s"] = -1.0
    state.in_flight[mission]["due_s"] = np.inf
    draw_faults(scenario, seed, episode, state.faults[mission])
    remembering = state.experience[mission]
    remembering["candidates_rng"][:, 0] = splitmix_states(seed, episode, Stream.CANDIDATES, len(remembering))
    begin_estimates(seed, episode, start.poses, state.estimates[mission])
    state.fiducials[mission] = start.fiducials


def _set_seen_goal(scenario: Scenario, state: MissionState, mission: int, start: Start) -> None:
    """Write what can be seen, from places within reach where that ends the mission, and how much must be."""
    clock, ending, world = state.missions[mission], scenario.ending, start.world
    by_seen = ending.by_seen
    visible = visible_from(world, scenario, start.poses) if by_seen else world.visible(scenario)
    state.visible[mission] = visible.ravel()
    if by_seen:
        near = driven_up_to(world, scenario, start.poses)
        state.drivable[mission] = (visible & near[:, :, None]).ravel()
    clock["visible"], clock["visible_free"] = visible.sum(), (visible & ~world.occupied).sum()
    if ending.seen_share is not None:
        clock["explored_end"] = math.ceil(ending.seen_share * clock["visible"] - 1e-9)
    if ending.unseen_free_voxels is not None:
        clock["explored_free_end"] = clock["visible_free"] - ending.unseen_free_voxels


def _set_entropies(
    scenario: Scenario, state: MissionState, mission: int, prior_precision: float, visible_voxels: int
) -> None:
    """Set H(0) by eq. 25, and H_th: voxels that can be seen at σ_end, the others at the prior."""
    voxel_bits = float(map_entropy_bits(np.full((1, 1, 1), prior_precision, np.float32)))
    known_bits = gaussian_entropy_bits(scenario.ending.sigma_end)
    hidden = scenario.grid.voxels - visible_voxels
    clock = state.missions[mission]
    clock["entropy_start_bits"] = clock["joint_bits"] = scenario.grid.voxels * voxel_bits
    clock["entropy_end_bits"] = visible_voxels * known_bits + hidden * voxel_bits
    state.robots[mission]["entropy_bits"] = clock["entropy_start_bits"]
