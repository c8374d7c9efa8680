"""Scenarios with every setting drawn at random from what is allowed, each from a number alone.

A field has its default in half of the scenarios, so that others meet it; a value that people would choose in
most of the rest; and now and then any value of its range, its ends among them. Lengths that people would
choose are some voxels long. Worlds are small.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from entropy_explore_env.settings.action import Action
from entropy_explore_env.settings.channel import Channel, Signal
from entropy_explore_env.settings.ending import Ending
from entropy_explore_env.settings.faults import Faults, Outage, RadioFault, SensorFault
from entropy_explore_env.settings.fiducials import Fiducials
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.localization import Localization
from entropy_explore_env.settings.observation import Observation
from entropy_explore_env.settings.reward import Reward
from entropy_explore_env.settings.robot import Robot
from entropy_explore_env.settings.robot_kind import RobotKind
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.settings.sensor import RangeSensor
from entropy_explore_env.worlds.recipes.catalogue import RECIPES
from entropy_explore_env.worlds.world import World

_DEFAULT, _USUAL = 0.5, 0.85
_MOST_VOXELS = 4000
_MOST_RAYS_ACROSS = 30


class Numbers(NamedTuple):
    """The allowed numbers of a field, and those that people would choose."""

    least: float
    most: float
    usual_least: float
    usual_most: float
    whole: bool = False
    also: tuple[Any, ...] = ()
    """Other values, such as inf or None."""
    voxels: bool = False
    """Whether the usual numbers are in voxel edges."""


def _length(least: float, most: float, usual_least: float, usual_most: float, *also: Any) -> Numbers:  # noqa: ANN401
    return Numbers(least, most, usual_least, usual_most, also=also, voxels=True)


def _count(least: int, most: int, usual_least: int, usual_most: int, *also: Any) -> Numbers:  # noqa: ANN401
    return Numbers(least, most, usual_least, usual_most, whole=True, also=also)


_SWITCH = (True, False)
FIELDS: Mapping[type, Mapping[str, Numbers | Sequence[Any]]] = MappingProxyType(
    {
        Robot: {
            "motion": ("free", "planar"),
            "navigator": ("straight", "planned"),
            "unknown_cost": Numbers(1.0, 1e6, 1.0, 10.0),
            "reach_m": _length(1e-6, 1e6, 1.0, 12.0, math.inf),
            "max_speed_m_s": _length(1e-4, 1e4, 0.2, 20.0),
            "acceleration_m_s2": _length(1e-4, 1e6, 0.2, 20.0),
            "turn_rate_rad_s": Numbers(1e-4, 1e6, 0.1, 10.0, also=(math.inf,)),
            "body_radius_m": _length(1e-6, 1e6, 0.1, 2.5, 0.0),
            "sensor_height_m": _length(1e-6, 1e6, 0.5, 4.0, 0.0),
            "tilts": _SWITCH,
            "when_blocked": ("wander", "wait"),
            "blocked_wait_s": Numbers(1e-4, 1e5, 0.1, 20.0),
            "redecide": Numbers(0.01, 1e6, 0.1, 10.0, also=("at_stop", "on_scan")),
        },
        RangeSensor: {
            "max_range_m": _length(1e-6, 1e6, 1.0, 20.0, math.inf),
            "sigma_min": Numbers(1e-4, 1e4, 0.01, 1.0),
            "sigma_slope_per_m": Numbers(1e-6, 1e6, 1e-3, 0.1, also=(0.0,)),
            "sigma_exponent": Numbers(0.25, 4.0, 0.5, 3.0),
            "range_noise_m": _length(1e-6, 1e6, 0.01, 1.0, 0.0),
            "voxels_behind": _count(0, 1000, 0, 4),
            "scan_time_s": Numbers(1e-4, 1e5, 0.01, 5.0),
            "scan_every_m": _length(1e-3, 1e6, 0.3, 5.0, math.inf),
            "min_range_m": _length(1e-6, 1e6, 0.1, 3.0, 0.0),
        },
        Localization: {
            "xy_m_per_sqrt_m": _length(1e-6, 100.0, 0.01, 0.5, 0.0),
            "z_m_per_sqrt_m": _length(1e-6, 100.0, 0.01, 0.5, 0.0),
            "yaw_rad_per_sqrt_m": Numbers(1e-6, 10.0, 1e-3, 0.3, also=(0.0,)),
            "yaw_rad_per_sqrt_rad": Numbers(1e-6, 10.0, 1e-3, 0.3, also=(0.0,)),
            "margin_m": _length(1e-6, 100.0, 0.05, 1.0, 0.0),
        },
        Fiducials: {
            "number": _count(0, 1000, 0, 8),
            "range_m": _length(1e-6, 1e6, 1.0, 20.0, math.inf),
            "range_sigma_m": _length(1e-6, 1e6, 0.01, 1.0),
            "bearing_sigma_rad": Numbers(1e-6, 10.0, 1e-3, 0.3),
            "own_number": _count(0, 64, 0, 8),
            "own_score": Numbers(1e-6, 2.0, 0.1, 1.0, also=(0.0,)),
            "own_apart_m": _length(1e-6, 1e6, 0.5, 5.0, 0.0),
        },
        Channel: {
            "burst": _count(0, 1_000_000, 0, 200),
            "i_min_bits": Numbers(1e-6, 1e6, 1e-3, 10.0, also=(0.0,)),
            "i_min_fill": Numbers(1e-3, 10.0, 0.1, 2.0, also=(None,)),
            "range_m": _length(1e-9, 1e6, 1.0, 20.0, math.inf),
            "loss_probability": Numbers(1e-6, 1.0, 0.05, 0.9, also=(0.0,)),
            "delay_s": Numbers(1e-6, 3600.0, 0.1, 20.0, also=(0.0,)),
            "reach": ("distance", "line_of_sight", "signal"),
            "announcements": _SWITCH,
            "phase_s": Numbers(1e-3, 3600.0, 0.5, 30.0, also=(0.0,)),
            "repeats": _count(1, 1000, 1, 5),
            "content": ("measurements", "summaries"),
            "summary_every_s": Numbers(1e-3, 3600.0, 0.3, 20.0, also=(0.0,)),
            "summary_threshold_bits": Numbers(1e-6, 5.0, 0.1, 2.0, also=(0.0,)),
        },
        Signal: {
            "budget_db": (-400.0, -10.0, 20.0, 40.0, 500.0),
            "exponent": Numbers(1e-3, 10.0, 1.5, 5.0, also=(0.0,)),
            "wall_loss_db_per_m": Numbers(1e-3, 1e4, 1.0, 100.0, also=(0.0,)),
        },
        Outage: {
            "at_s": Numbers(1e-3, 1e9, 0.5, 30.0, also=(math.inf,)),
            "mean_s": Numbers(1e-3, 1e9, 1.0, 100.0, also=(math.inf,)),
            "lasts_s": Numbers(1e-3, 1e9, 0.1, 30.0, also=(math.inf,)),
        },
        SensorFault: {
            "lost_rays": Numbers(1e-6, 1.0, 0.01, 0.5, also=(0.0,)),
            "range_factor": Numbers(0.1, 10.0, 0.8, 1.25),
            "range_bias_m": (0.0, -1e6, -0.3, 0.02, 0.5, 1e6),
        },
        RadioFault: {
            "garbled": Numbers(1e-6, 1.0, 0.01, 0.5, also=(0.0,)),
            "repeated": Numbers(1e-6, 1.0, 0.01, 0.5, also=(0.0,)),
            "late": Numbers(1e-6, 1.0, 0.01, 0.5, also=(0.0,)),
            "late_s": Numbers(1e-3, 3600.0, 0.1, 20.0),
        },
        Ending: {
            "sigma_end": Numbers(1e-4, 1e4, 0.01, 1.0),
            "termination": ("any", "all", "shared"),
            "seen_share": Numbers(1e-9, 1.0, 0.2, 1.0, also=(None,)),
            "unseen_free_voxels": _count(0, 2**31 - 1, 0, 500, None),
            "return_to_start": _SWITCH,
            "time_limit_s": Numbers(1e-3, 1e9, 1.0, 1e4, also=(math.inf,)),
            "max_cycles": _count(1, 2**62, 1, 100, None),
        },
        Reward: {
            "kind": ("individual", "team"),
            "cost_per_s": Numbers(1e-9, 1e6, 1e-4, 1.0, also=(0.0,)),
        },
        Action: {
            "kind": ("continuous", "discrete", "candidates"),
            "moves": ("all", "axes"),
            "yaws": _count(1, 360, 1, 16),
            "pitches": _count(1, 90, 1, 5),
            "candidates": _count(1, 64, 1, 32),
        },
        Observation: {
            "panorama": _SWITCH,
            "panorama_yaws": _count(1, 360, 1, 32, None),
            "panorama_pitches": _count(1, 90, 1, 5),
            "panorama_utility": ("bits", "log2"),
            "self_state": _SWITCH,
            "drive": _SWITCH,
            "team": _SWITCH,
            "patch": _SWITCH,
            "overview": _SWITCH,
            "candidates": _SWITCH,
            "overlaps": _SWITCH,
            "action_mask": _SWITCH,
            "flat": _SWITCH,
            "while_busy": _SWITCH,
        },
        Scenario: {
            "split": ("train", "validation", "test"),
            "robots": _count(1, 40, 1, 6),
            "start_radius_m": _length(1e-6, 1e6, 2.0, 20.0, math.inf),
            "decision_period_s": Numbers(1e-3, 1e5, 0.1, 10.0, also=(None,)),
            "track_truth": _SWITCH,
        },
    }
)
"""Class → field → its numbers, or its choices. Other fields are drawn by `draw_scenario` itself."""


class Drawn(NamedTuple):
    """A scenario, and the worlds that its missions are to be in; none where it has a recipe."""

    scenario: Scenario
    given: tuple[World, ...]


def draw_scenario(rng: np.random.Generator, few_kernels: bool = False) -> Drawn:
    """Draw all settings of a scenario.

    Args:
        rng: Where from.
        few_kernels: Observations have the default parts, or all, and channels reach by more than distance
            where there are faults, and only there, and so do robots drift; summaries are sent there alone:
            others have kernels of their own, which take seconds to compile.

    Raises:
        EntropyExploreError: Settings were drawn that do not fit each other. Draw again.
    """
    grid = _grid(rng)

    def draw(kind: type, field: str) -> Any:  # noqa: ANN401 - whatever a setting is
        chance = rng.random()
        if chance < _DEFAULT:
            return _default(kind, field)
        return _value(rng, FIELDS[kind][field], chance < _USUAL, grid.voxel_size_m)

    def part(kind: type, made: Callable[..., Any] | None = None, **own: Any) -> Any:  # noqa: ANN401 - an object of the kind
        return (made or kind)(**{field: draw(kind, field) for field in FIELDS[kind]}, **own)

    own = {field: draw(Scenario, field) for field in FIELDS[Scenario]}
    given = rng.random() < 0.3
    faults = _faults(rng, part, own["robots"])
    drifts = faults.happen if few_kernels else rng.random() >= _DEFAULT

    def localization() -> Localization:
        drawn = part(Localization)
        if not drifts:
            return Localization()
        return drawn if drawn.drifts else dataclasses.replace(drawn, yaw_rad_per_sqrt_m=0.01)

    kinds = [
        RobotKind(
            part(Robot, localization=localization(), above_ground_m=_above_ground_m(rng, grid)),
            _sensor(rng, part),
        )
        for _ in range(int(rng.choice([1, 1, 1, 2, 3])))
    ]
    scenario = Scenario(
        name="drawn",
        grid=grid,
        world="empty" if given or rng.random() < 0.5 else str(rng.choice(sorted(RECIPES))),
        robot=kinds[0].robot,
        sensor=kinds[0].sensor,
        extra_kinds=tuple(kinds[1:]),
        channel=_channel(part, faults.happen, few_kernels),
        faults=faults,
        fiducials=_fiducials(rng, part, grid),
        ending=part(Ending),
        reward=part(Reward),
        action=(action := part(Action)),
        observation=_observation(rng, part, few_kernels, action),
        **own,
    )
    return Drawn(scenario, tuple(_world(rng, grid) for _ in range(2)) if given else ())


def _default(kind: type, field: str) -> Any:  # noqa: ANN401
    return next(f.default for f in dataclasses.fields(kind) if f.name == field)


def _value(rng: np.random.Generator, drawn: Numbers | Sequence[Any], usual: bool, voxel_m: float) -> Any:  # noqa: ANN401
    """One of a field's choices, or of its numbers: the usual ones or all, evenly by their logarithm."""
    if not isinstance(drawn, Numbers):
        return drawn[int(rng.integers(len(drawn)))]
    if drawn.also and rng.random() < 0.3:
        return drawn.also[int(rng.integers(len(drawn.also)))]
    least, most = drawn.least, drawn.most
    if not usual and rng.random() < 0.3:
        return least if rng.random() < 0.5 else most
    if usual:
        unit = voxel_m if drawn.voxels else 1.0
        least, most = drawn.usual_least * unit, drawn.usual_most * unit
    if drawn.whole:
        return round(math.exp(rng.uniform(math.log(least + 0.5), math.log(most + 0.5))))
    return float(math.exp(rng.uniform(math.log(least), math.log(most))))


def _grid(rng: np.random.Generator) -> Grid:
    """Return a small grid, flat in a third of the cases; its voxels of any size."""
    while True:
        x, y, z = (int(n) for n in np.exp(rng.uniform(0.0, math.log(60.0), 3)).astype(int))
        z = 1 if rng.random() < 0.33 else z
        if x * y * z <= _MOST_VOXELS:
            break
    size_m = _value(rng, Numbers(1e-6, 1e6, 0.05, 1.0), rng.random() < 0.9, 1.0)
    far = 1e9 if rng.random() < 0.05 else 100.0
    origin = (0.0, 0.0, 0.0) if rng.random() < 0.5 else tuple(rng.uniform(-far, far, 3).tolist())
    return Grid((x, y, z), size_m, origin)


def _sensor(rng: np.random.Generator, part: Callable[..., Any]) -> RangeSensor:
    """Return a sensor with up to a few hundred rays."""
    yaw, pitch = rng.uniform(0.0, 2.0 * math.pi), rng.uniform(0.0, math.pi)
    view = [(yaw, pitch), (2.0 * math.pi, pitch), (yaw, 0.0), (0.0, 0.0)][int(rng.integers(4))]
    step = max(max(view) / rng.integers(1, _MOST_RAYS_ACROSS), 1e-6)
    return part(RangeSensor, field_of_view_rad=view, angular_step_rad=float(step))


def _faults(rng: np.random.Generator, part: Callable[..., Any], robots: int) -> Faults:
    """Return faults: none in half of the scenarios, else each part may fail, of some robots or of all."""

    def some() -> tuple[int, ...]:
        number = int(rng.integers(0, min(robots, 3) + 1))
        return tuple(int(robot) for robot in rng.choice(robots, number, replace=False))

    if rng.random() < _DEFAULT:
        return Faults()
    outages = {name: part(Outage, robots=some()) for name in ("stop", "blind", "silent")}
    sensor, radio = part(SensorFault, robots=some()), part(RadioFault, robots=some())
    return Faults(**outages, sensor=sensor, radio=radio)


def _above_ground_m(rng: np.random.Generator, grid: Grid) -> float | None:
    """In one of twenty kinds of robots a height above ground: few worlds have ground that carries them."""
    return float(rng.uniform(0.5, 3.0)) * grid.voxel_size_m if rng.random() < 0.05 else None


def _fiducials(rng: np.random.Generator, part: Callable[..., Any], grid: Grid) -> Fiducials:
    """Fiducials drawn by each mission, or some places of the grid, which may be in something solid."""
    drawn = part(Fiducials)
    if rng.random() < 0.7:
        return drawn
    shares = rng.uniform(0.0, 1.0, (int(rng.integers(1, 4)), 3)) * 0.999
    places = np.asarray(grid.origin_m) + shares * grid.size_m
    given = tuple((float(x), float(y), float(z)) for x, y, z in places)
    return dataclasses.replace(drawn, number=0, positions_m=given)


def _channel(part: Callable[..., Any], faulty: bool, few_kernels: bool) -> Channel:
    """Return a channel; with few kernels it is limited by more than distance only where there are faults."""

    def fitting(**drawn: Any) -> Channel:  # noqa: ANN401 - whatever a setting is
        if drawn["burst"] == 0 or (few_kernels and not faulty):
            drawn["content"] = "measurements"
        unused = [] if drawn["phase_s"] > 0.0 else ["repeats"]
        if drawn["content"] == "measurements":
            unused += ["summary_every_s", "summary_threshold_bits"]
        return Channel(**drawn | {name: _default(Channel, name) for name in unused})

    channel = part(Channel, fitting, signal=part(Signal))
    if few_kernels and faulty == (channel.reach == "distance"):
        channel = dataclasses.replace(channel, reach="signal" if faulty else "distance")
    return channel


def _observation(
    rng: np.random.Generator, part: Callable[..., Any], few_kernels: bool, action: Action
) -> Observation:
    """Parts of an observation, with a small patch and overview; overlaps are those of candidates alone."""
    patch = tuple(int(2 * n + 1) for n in rng.integers(0, 6, 3))
    overview = tuple(int(n) for n in rng.integers(1, 12, 3))
    drawn = part(Observation, patch_shape=patch, overview_shape=overview)
    if action.kind != "candidates":
        drawn = dataclasses.replace(drawn, overlaps=False)
    if not few_kernels:
        return drawn
    every = bool(rng.random() < 0.5)
    names = ("panorama", "self_state", "drive", "team", "patch", "overview")
    default = Observation()
    return dataclasses.replace(
        drawn, action_mask=False, **{name: every or getattr(default, name) for name in names}
    )


def _world(rng: np.random.Generator, grid: Grid) -> World:
    """Draw solid voxels one by one, in half of the cases under a ceiling."""
    solid = rng.random(grid.shape) < rng.choice([0.02, 0.1, 0.3])
    ceiling = None
    if rng.random() < 0.5:
        ceiling = rng.integers(0, grid.shape[2] + 1, grid.shape[:2]).astype(np.int32)
    return World(grid, solid, "drawn", ceiling=ceiling)
