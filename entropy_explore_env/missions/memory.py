"""How much memory missions need, estimated from their settings before any of it is taken."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from entropy_explore_env.errors import SettingError, counted
from entropy_explore_env.missions.observation.layout import observation_parts
from entropy_explore_env.missions.rules import action_count, overview_shape, rules_of
from entropy_explore_env.missions.state import state_arrays
from entropy_explore_env.prediction.predictor import scratch_bytes
from entropy_explore_env.robots.range_sensor import scan_bytes
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.worlds.recipes.catalogue import RECIPES
from entropy_explore_env.worlds.world import World

_SHOWN_BYTES, _SPACE_BYTES, _LAYOUT_BYTES = 8, 10, 16
"""Of a number of an observation: in the missions and handed out, its bounds in a space, and in the layout."""
_LAYER_BYTES = 10
"""Of a voxel of a world for each kind of robot: two masks, and the number of a start."""
_SEARCH_BYTES, _PROPOSAL_BYTES = 21, 43
"""Of a voxel in a thread's memory for paths, and for candidates, once searches have come there."""
_PARTS = (
    ("pooled maps", "Observation.overview_shape", ("pooled",)),
    ("scans", "RangeSensor.angular_step_rad", ("scan_",)),
    ("delayed messages", "Channel.delay_s", ("in_flight",)),
    ("the broadcast in phases", "Channel.phase_s", ("phase",)),
    ("scans to be sent by need", "RangeSensor.angular_step_rad", ("backlog",)),
    ("candidates", "Action.candidates", ("candidates", "experience")),
    (
        "what robots heard",
        "Scenario.robots",
        ("missions", "robots", "heard", "faults", "estimates", "fiducials", "landmarks", "summaries"),
    ),
)
"""Purpose, setting that lowers it, and how the names of arrays of the state begin; the others are maps."""
_LAST_GROUP = Path("/sys/fs/cgroup/memory.max")
_SETTING_OF_PART = {
    "panorama": "Observation.panorama_yaws",
    "self": "Observation.self_state",
    "drive": "Observation.drive",
    "team": "Observation.team",
    "patch": "Observation.patch_shape",
    "overview": "Observation.overview_shape",
    "prediction": "Observation.prediction_shape",
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
    """Return about what missions hold in memory after their first steps, adapters included.

    Kept out: Python's own objects, compiled code, pictures, and whatever strategies hold.

    Args:
        scenario: The task, its grid that of its world.
        batch: How many missions there are.
    """
    cells = math.prod(overview_shape(scenario) or (0,))
    sizes = {
        name: math.prod(array.shape) * array.dtype.itemsize
        for name, array in state_arrays(scenario, batch.missions, cells).items()
    }
    needs = []
    for purpose, setting, beginnings in _PARTS:
        names = [name for name in sizes if name.startswith(beginnings)]
        needs.append(Need(purpose, sum(sizes.pop(name) for name in names), setting))
    maps = sum(sizes.values()) + _world_bytes(scenario, batch)
    rows = batch.missions * scenario.robots
    shown = _SHOWN_BYTES * rows + _SPACE_BYTES * (rows + scenario.robots) + _LAYOUT_BYTES
    return [
        Need("maps", maps, "missions" if batch.missions > 1 else "Grid.voxel_size_m"),
        *needs,
        *(
            Need(f"observations: {name}", shown * (part.stop - part.start), _SETTING_OF_PART[name])
            for name, part in observation_parts(scenario).items()
        ),
        *_scratch_needs(scenario, batch),
    ]


def _world_bytes(scenario: Scenario, batch: Batch) -> int:
    """Return about the size of worlds with their masks and starts; worlds of recipes are drawn anew."""
    drawn = scenario.world in RECIPES and scenario.world != "empty"
    worlds = len(batch.given) or (batch.missions if drawn else 1)
    return worlds * (1 + _LAYER_BYTES * len(set(scenario.kinds))) * scenario.grid.voxels


def _scratch_needs(scenario: Scenario, batch: Batch) -> list[Need]:
    """Return the scratch memory that each thread needs, and what all share of actions."""
    voxels, sensors = scenario.grid.voxels, [kind.sensor for kind in scenario.kinds]
    scans = scan_bytes(scenario.grid, sensors, max(sensor.rays for sensor in sensors))
    plans = any(kind.robot.navigator == "planned" for kind in scenario.kinds) * _SEARCH_BYTES * voxels
    proposing = (scenario.action.kind == "candidates") * _PROPOSAL_BYTES * voxels
    predicting = scenario.observation.prediction * scratch_bytes()
    masks = 0
    if scenario.action.kind == "discrete":
        masks = batch.missions * scenario.robots * action_count(scenario, rules_of(scenario))
    most = "threads" if batch.threads > 1 else None
    return [
        Need("rays of a scan", batch.threads * scans, most or "RangeSensor.angular_step_rad"),
        Need("paths", batch.threads * plans, most or "Grid.voxel_size_m"),
        Need("proposing candidates", batch.threads * proposing, most or "Grid.voxel_size_m"),
        Need("action masks", masks, "Robot.reach_m"),
        Need("predictions", batch.threads * predicting, most or "Observation.prediction"),
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
