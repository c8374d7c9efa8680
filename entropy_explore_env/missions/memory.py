"""How much memory missions need, counted from their settings before any of it is taken."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from entropy_explore_env.belief.raycast import longest_crossing
from entropy_explore_env.errors import SettingError, counted
from entropy_explore_env.missions.observation.layout import observation_parts
from entropy_explore_env.missions.rules import (
    POINT,
    collision_bodies,
    discrete_moves,
    gaze_set,
    overview_shape,
)
from entropy_explore_env.missions.state import state_arrays
from entropy_explore_env.planner.model import proposal_bytes
from entropy_explore_env.robots.map_summary import summary_bytes
from entropy_explore_env.robots.navigator import navigator_bytes
from entropy_explore_env.robots.range_sensor import scan_bytes
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.worlds.recipes.catalogue import RECIPES
from entropy_explore_env.worlds.world import World

_SPACE_BYTES = 10
"""Of a number of an observation in its space: two float32 bounds, and whether there are these bounds."""
_MAPS = (
    *("truth", "collision", "mean", "precision", "joint_mean", "joint_precision"),
    *("visible", "drivable", "own_mean", "own_precision"),
)
_LAST_GROUP = Path("/sys/fs/cgroup/memory.max")
_SETTING_OF_PART = {
    "panorama": "Observation.panorama_yaws",
    "self": "Observation.self_state",
    "drive": "Observation.drive",
    "team": "Observation.team",
    "patch": "Observation.patch_shape",
    "overview": "Observation.overview_shape",
    "candidates": "Action.candidates",
    "context": "Observation.candidates",
    "overlaps": "Observation.overlaps",
    "action_mask": "Observation.action_mask",
}
"""Part of an observation → the setting that makes it smaller, or leaves it out."""


class Batch(NamedTuple):
    """How many missions there are to be."""

    missions: int
    """E."""
    threads: int = 1
    given: Sequence[World] = ()
    """Worlds that are given as objects: they are in memory already."""


class Need(NamedTuple):
    """Memory for one purpose."""

    purpose: str
    bytes: int
    setting: str
    """Class and field of the setting that lowers it most directly, or `missions`, `threads`."""


def memory_needs(scenario: Scenario, batch: Batch) -> list[Need]:
    """Return what missions hold in memory after their first steps, adapters included.

    Kept out: Python's own objects, compiled code, pictures, and whatever strategies hold.

    Args:
        scenario: The task, its grid that of its world.
        batch: How many missions there are.
    """
    missions, cells = batch.missions, math.prod(overview_shape(scenario) or (0,))
    sizes = {
        name: math.prod(array.shape) * array.dtype.itemsize
        for name, array in state_arrays(scenario, missions, cells).items()
    }
    delayed = sum(size for name, size in sizes.items() if name.startswith("in_flight"))
    phases = sum(size for name, size in sizes.items() if name.startswith("phase"))
    scans = sum(sizes[name] for name in ("scan_range_m", "scan_returned", "scan_utility_bits"))
    robots = sum(sizes[name] for name in ("missions", "robots", "heard", "faults", "estimates"))
    robots += sizes["fiducials"] + sizes["landmarks"] + sizes["summaries"]
    proposed = sizes["candidates"] + sizes["experience"]
    maps = sum(sizes[name] for name in _MAPS) + _world_bytes(scenario, batch)
    burst = "Channel.burst" if scenario.channel.burst > 1 else "robots"
    return [
        Need("maps", maps, "missions" if missions > 1 else "Grid.voxel_size_m"),
        Need("pooled maps", sizes["pooled"], "Observation.overview_shape"),
        Need("what robots heard", robots, "Scenario.robots"),
        Need("scans", scans, "RangeSensor.angular_step_rad"),
        Need("delayed messages", delayed, "Channel.delay_s" if scenario.robots < 100 else burst),
        Need("the broadcast in phases", phases, "Channel.phase_s"),
        Need("candidates", proposed, "Action.candidates"),
        *_observation_needs(scenario, batch),
        *_scratch_needs(scenario, batch),
    ]


def _world_bytes(scenario: Scenario, batch: Batch) -> int:
    """Return the size of worlds with their masks, starts and visible voxels, and of no-fly masks."""
    voxels, planar = scenario.grid.voxels, scenario.grid.shape[0] * scenario.grid.shape[1]
    layouts = 0
    for kind in set(scenario.kinds):
        layouts += 2 * voxels + 8 * (voxels if scenario.layer_of(kind.robot) is None else planar)
    if batch.given:
        collisions_apart = any(w.ceiling is not None or w.unreadable is not None for w in batch.given)
        held = len(batch.given) * layouts
    else:
        from_file = scenario.world not in RECIPES  # such a world may have a ceiling, or unreadable voxels
        collisions_apart = from_file or any(name in scenario.world for name in ("terrain", "cliff"))
        worlds = 1 if from_file or scenario.world == "empty" else batch.missions
        held = worlds * (layouts + voxels + (4 * planar if collisions_apart else 0))
    if not collisions_apart:  # what robots collide with is what rays are cast through
        return held
    bodies = collision_bodies(scenario)
    planned = any(kind.robot.navigator == "planned" for kind in scenario.kinds)
    masks = batch.missions * voxels * ((len(bodies) if planned else 0) + (4 if bodies == [POINT] else 0))
    return held + masks


def _observation_needs(scenario: Scenario, batch: Batch) -> list[Need]:
    """Return a need for each part: the missions' observations, those handed out last, and their spaces."""
    rows = batch.missions * scenario.robots
    each = 8 * rows + _SPACE_BYTES * (rows + scenario.robots) + 16
    return [
        Need(f"observations: {name}", each * (part.stop - part.start), _SETTING_OF_PART[name])
        for name, part in observation_parts(scenario).items()
    ]


def _scratch_needs(scenario: Scenario, batch: Batch) -> list[Need]:
    """Scratch memory of each thread, and what all share of actions."""
    kinds, grid = scenario.kinds, scenario.grid
    sensors, robots = [kind.sensor for kind in kinds], [kind.robot for kind in kinds]
    rays = max(sensor.rays for sensor in sensors)
    longest_m = max(math.inf if robot.navigator == "planned" else robot.reach_m for robot in robots)
    drive = 12 * longest_crossing(*grid.shape, longest_m / grid.voxel_size_m, 1)
    if scenario.channel.reach != "distance":
        drive += 12 * longest_crossing(*grid.shape, math.inf, 1)
    scans = batch.threads * (scan_bytes(grid, sensors, rays) + drive + 33 * scenario.robots)
    plans = navigator_bytes(scenario) if any(robot.navigator == "planned" for robot in robots) else 0
    masks = 0
    if scenario.action.kind == "discrete":
        gazes = gaze_set(scenario.action.yaws, 1 if scenario.planar else scenario.action.pitches)
        masks = batch.missions * scenario.robots * len(discrete_moves(scenario)) * len(gazes)
    proposing = proposal_bytes(scenario) if scenario.action.kind == "candidates" else 0
    most = "threads" if batch.threads > 1 else None
    summaries = batch.threads * (grid.voxels + summary_bytes(grid.voxels)) if scenario.shares_summaries else 0
    return [
        Need("rays of a scan", scans, most or "RangeSensor.angular_step_rad"),
        Need("paths", batch.threads * plans, most or "Grid.voxel_size_m"),
        Need("proposing candidates", batch.threads * proposing, most or "Grid.voxel_size_m"),
        Need("action masks", masks, "Robot.reach_m"),
        Need("writing summaries", summaries, most or "Grid.voxel_size_m"),
    ]


def check_memory(scenario: Scenario, batch: Batch) -> None:
    """Raise a SettingError where missions need more memory than there is; it names the setting to lower.

    Args:
        scenario: The task, its grid that of its world.
        batch: How many missions there are to be.
    """
    there_is = memory_there_is()
    needs = memory_needs(scenario, batch)
    needed = sum(need.bytes for need in needs)
    if there_is is None or needed <= there_is:
        return
    most = max(needs, key=lambda need: need.bytes)
    value = _value_of(scenario, batch, most.setting)
    lower = "enlarge" if most.setting.endswith(("voxel_size_m", "step_rad")) else "lower"
    if isinstance(value, bool):
        lower = "do without"
    also = " or ".join(f"fewer {what}" for what in ("missions", "robots") if not most.setting.endswith(what))
    asked = f"{counted(batch.missions, 'mission')} of {counted(scenario.robots, 'robot')}"
    allowed = (
        f"what fits into {there_is / 2**30:.1f} GiB of memory: {asked} "
        f"need{'s' * (batch.missions == 1)} {needed / 2**30:.1f} GiB, {most.bytes / 2**30:.1f} of them for "
        f"{most.purpose}; {lower} {most.setting}, or have {also}"
    )
    raise SettingError(most.setting, value, allowed)


def _value_of(scenario: Scenario, batch: Batch, setting: str) -> object:
    """Return the value that a setting of a Need has."""
    owner, _, field = setting.rpartition(".")
    if not owner:
        return getattr(batch, field)
    parts = {"Scenario": scenario, "RangeSensor": scenario.sensor}
    return getattr(parts.get(owner) or getattr(scenario, owner.lower()), field)


def memory_there_is() -> int | None:
    """Return the bytes of memory that this process may have; None where the system does not say."""
    try:
        there_is = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):
        return None
    try:
        limit = _LAST_GROUP.read_text().strip()
    except OSError:
        return there_is
    return min(there_is, int(limit)) if limit.isdecimal() else there_is
