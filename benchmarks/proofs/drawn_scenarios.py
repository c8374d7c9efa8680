"""Scenarios with every setting drawn at random from what is allowed, each from a number alone.

Each setting is drawn by its annotation, and kept unless the library refuses it beside those before. Half have
their defaults, so that the others meet them; most of the rest have a value that people would choose, near the
default or some voxels long; and now and then any value, the ends of ranges among them. Worlds are small.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from types import NoneType, UnionType
from typing import Any, Literal, NamedTuple, Union, get_args, get_origin

import numpy as np

from entropy_explore_env.errors import EntropyExploreError, SettingError
from entropy_explore_env.missions.simulation import Missions
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.robot import Robot
from entropy_explore_env.settings.robot_kind import RobotKind
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.settings.validation import annotations_of
from entropy_explore_env.worlds.recipes.catalogue import RECIPES
from entropy_explore_env.worlds.world import World

_DEFAULT, _USUAL = 0.5, 0.85
_MOST_VOXELS, _MOST_ROBOTS, _MOST_RAYS = 4000, 40, 900
_MOST_RAYS_ACROSS = 30
_APART = ("name", "grid", "world", "extra_kinds", "angular_step_rad")
"""Settings that are drawn with others."""
_FITTED = {"reach_m": 2.0, "max_speed_m_s": 1.0, "acceleration_m_s2": 1.0, "body_radius_m": 0.3}
"""Settings of the robot that is changed, in voxel edges: the default one is too large for small worlds."""
_SELDOM = {"above_ground_m": 0.1}
"""Setting → share of the scenarios in which it may change: few worlds have ground that carries robots."""
_POWERS = tuple(range(-9, 10))
"""Of ten: nearly all ranges end at one."""
_LARGE = (2**31 - 1, 2**62)
_PARTS = ("panorama", "self_state", "drive", "team", "patch", "overview", "action_mask")
"""Of observations; those with other ones have kernels of their own."""
_DRIFTING = {"robot": {"localization": {"yaw_rad_per_sqrt_m": 0.01}}}
_FAULTY = {"faults": {"blind": {"mean_s": 10.0}}, "channel": {"reach": "signal"}, **_DRIFTING}
_OBSERVANT = {"observation": dict.fromkeys(_PARTS[:-1], True)}
_KERNELS: tuple[dict[str, Any], ...] = ({}, _OBSERVANT, _FAULTY, _FAULTY | _OBSERVANT)
"""Settings from which scenarios of few kernels start."""

Path = tuple[str, ...]


class Drawn(NamedTuple):
    """A scenario, and the worlds that its missions are to be in; none where it has a recipe."""

    scenario: Scenario
    given: tuple[World, ...]


def first_allowed(number: int, few_kernels: bool) -> tuple[Drawn, int]:
    """Draw scenarios until one is allowed and its first mission has room; also return how many were not."""
    refused = 0
    while True:
        try:
            drawn = draw_scenario(np.random.default_rng([number, refused]), few_kernels)
            Missions(drawn.scenario, given=drawn.given).reset(0, number)
            return drawn, refused
        except EntropyExploreError:
            refused += 1


def draw_scenario(rng: np.random.Generator, few_kernels: bool = False) -> Drawn:
    """Draw all settings of a scenario; with few kernels only those that need no further kernels."""
    grid, given = _grid(rng), rng.random() < 0.3
    world = "empty" if given or rng.random() < 0.5 else str(rng.choice(sorted(RECIPES)))
    robot: dict[str, Any] = {
        name: float(np.clip(grid.voxel_size_m * most, 1e-4, 1e4)) for name, most in _FITTED.items()
    }
    robot["body_radius_m"] = min(robot["body_radius_m"], _FITTED["body_radius_m"] * grid.voxel_size_m)
    start = Scenario(name="drawn", grid=grid, world="empty", robot=Robot(**robot))
    if few_kernels:
        start = with_settings(start, _KERNELS[int(rng.integers(len(_KERNELS)))])
    scenario = _walked(start, rng, list(leaves(Scenario)), few_kernels)
    bodies = [path for path in leaves(Scenario) if path[0] in ("robot", "sensor")]
    others = [_walked(start, rng, bodies, few_kernels) for _ in range(int(rng.choice([0, 0, 0, 1, 2])))]
    changes = {"world": world}, {"extra_kinds": tuple(RobotKind(each.robot, each.sensor) for each in others)}
    for change in changes:
        scenario = _changed(scenario, change, few_kernels)
    return Drawn(scenario, tuple(_world(rng, grid) for _ in range(2)) if given else ())


def leaves(kind: type, path: Path = ()) -> Iterator[Path]:
    """Yield the names that lead to each setting that is drawn, such as `robot`, `reach_m`."""
    for name, hint in annotations_of(kind).items():
        if dataclasses.is_dataclass(hint):
            yield from leaves(hint, (*path, name))  # type: ignore[arg-type]
        elif name not in _APART:
            yield (*path, name)


def _walked(scenario: Scenario, rng: np.random.Generator, paths: list[Path], few_kernels: bool) -> Scenario:
    """Return a scenario with settings drawn one after the other, in any order."""
    for place in rng.permutation(len(paths)):
        path = paths[place]
        if rng.random() < _DEFAULT or rng.random() >= _SELDOM.get(path[-1], 1.0):
            continue
        owner: Any = scenario
        for name in path[:-1]:
            owner = getattr(owner, name)
        hint, name = annotations_of(type(owner))[path[-1]], path[-1]
        change: dict[str, Any] = {name: _value(rng, hint, name, getattr(owner, name), scenario)}
        if name == "field_of_view_rad":
            across = int(rng.integers(1, _MOST_RAYS_ACROSS))
            change["angular_step_rad"] = max(max(change[name]) / across, 1e-6)
        for name in reversed(path[:-1]):
            change = {name: change}
        scenario = _changed(scenario, change, few_kernels)
    return scenario


def _changed(scenario: Scenario, change: dict[str, Any], few_kernels: bool) -> Scenario:
    """Return a scenario with a change; without it where that is refused, too large, or has other kernels."""
    try:
        changed = with_settings(scenario, change)
    except SettingError:
        return scenario
    if changed.robots > _MOST_ROBOTS or any(kind.sensor.rays > _MOST_RAYS for kind in changed.kinds):
        return scenario
    return scenario if few_kernels and _kernels_of(changed) != _kernels_of(scenario) else changed


def _kernels_of(scenario: Scenario) -> tuple[Any, ...]:
    """Return what decides which kernels a scenario needs; where nothing fails, also what robots send."""
    faulty, channel = scenario.faults.happen, scenario.channel
    parts = [getattr(scenario.observation, name) for name in _PARTS]
    content = channel.content if not faulty else None
    by_need = scenario.backlog_scans > 0
    return (scenario.drifts, faulty, channel.reach == "distance", content, by_need, *parts)


def _value(rng: np.random.Generator, hint: Any, name: str, default: Any, scenario: Scenario) -> Any:  # noqa: ANN401
    """Draw a value of an annotation."""
    kinds = get_args(hint) if get_origin(hint) in (Union, UnionType) else (hint,)
    kind = kinds[int(rng.integers(len(kinds)))]
    if get_origin(kind) is tuple:
        return _tuple(rng, name, scenario)
    if get_origin(kind) is Literal:
        return str(rng.choice(get_args(kind)))
    if kind is NoneType:
        return None
    if kind is bool:
        return bool(rng.random() < 0.5)
    usual, known = rng.random() < _USUAL, isinstance(default, int | float) and 0.0 < default < math.inf
    if kind is int:
        if not usual:
            return int(rng.choice([*(10**power for power in _POWERS if power >= 0), *_LARGE, 0]))
        return int((default if known else 4) * math.exp(rng.uniform(-1.5, 1.5)))
    if usual and "_m" in name:
        return scenario.grid.voxel_size_m * 10 ** rng.uniform(-1.0, 1.2)
    if usual:
        return (default if known else 1.0) * 10 ** rng.uniform(-0.7, 0.7)
    power = int(rng.choice(_POWERS)) if rng.random() < 0.5 else rng.uniform(_POWERS[0], _POWERS[-1])
    return float(rng.choice([10.0**power, 10.0**power, -(10.0**power), 0.0, math.inf]))


def _tuple(rng: np.random.Generator, name: str, scenario: Scenario) -> Any:  # noqa: ANN401
    """Draw a value of a setting that is a tuple."""
    grid = scenario.grid
    if name == "robots":  # whose fault it is; none = of all
        return tuple(rng.permutation(scenario.robots)[: int(rng.integers(0, 4))].tolist())
    if name == "patch_shape":
        return tuple((2 * rng.integers(0, 6, 3) + 1).tolist())
    if name == "prediction_shape":
        return tuple((2 * rng.integers(0, 56, 2) + 1).tolist())
    if name == "overview_shape":
        return tuple(rng.integers(1, 12, 3).tolist())
    if name == "field_of_view_rad":
        view = rng.uniform(0.0, (2.0 * math.pi, math.pi)) * rng.integers(0, 2, 2)
        return (2.0 * math.pi if rng.random() < 0.25 else float(view[0]), float(view[1]))
    places = np.asarray(grid.origin_m) + rng.uniform(0.0, 0.999, (int(rng.integers(1, 4)), 3)) * grid.size_m
    return tuple(map(tuple, places.tolist()))  # fiducials, which may be in something solid


def _grid(rng: np.random.Generator) -> Grid:
    """Return a small grid, flat in a third of the cases; its voxels of any size."""
    while True:
        x, y, z = (int(n) for n in np.exp(rng.uniform(0.0, math.log(60.0), 3)).astype(int))
        z = 1 if rng.random() < 0.33 else z
        if x * y * z <= _MOST_VOXELS:
            break
    size_m = 10 ** (rng.uniform(-1.3, 0.0) if rng.random() < 0.9 else rng.uniform(-6.0, 6.0))
    far = 1e9 if rng.random() < 0.05 else 100.0
    origin = (0.0, 0.0, 0.0) if rng.random() < 0.5 else tuple(rng.uniform(-far, far, 3).tolist())
    return Grid((x, y, z), size_m, origin)


def _world(rng: np.random.Generator, grid: Grid) -> World:
    """Draw solid voxels one by one, in half of the cases under a ceiling."""
    solid = rng.random(grid.shape) < rng.choice([0.02, 0.1, 0.3])
    ceiling = None
    if rng.random() < 0.5:
        ceiling = rng.integers(0, grid.shape[2] + 1, grid.shape[:2]).astype(np.int32)
    return World(grid, solid, "drawn", ceiling=ceiling)
