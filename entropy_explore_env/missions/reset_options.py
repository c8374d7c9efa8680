"""What a reset may fix instead of drawing it: where the robots start, and the world.

Options of `reset`, in every adapter (A robots, E missions):

    starts  (A, 5), or of several missions (E, A, 5): the robots' poses x, y, z, yaw, pitch; map frame,
            metres, radians. Checked by `checked_starts`.
    world   a world number of the scenario's split (worlds/splits.py), or a World of the same grid; of
            several missions also a list of E of them, None = drawn.

The random streams stay as they are: what is given is not drawn, everything else is drawn as without it.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from entropy_explore_env.errors import SettingError, WorldError, did_you_mean
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.settings.validation import is_whole
from entropy_explore_env.worlds.recipes.catalogue import RECIPES
from entropy_explore_env.worlds.splits import WORLD_NUMBERS
from entropy_explore_env.worlds.world import World

NAMES = ("starts", "world")
"""The options of every adapter."""


class ResetOptions(NamedTuple):
    """What is given for one mission; None = drawn."""

    starts: np.ndarray | None = None
    """(A, 5) float64, finite."""
    world_number: int | None = None
    world: World | None = None

    def filled_up(self, others: ResetOptions) -> ResetOptions:
        """Return these options, and of others what these leave open."""
        starts = others.starts if self.starts is None else self.starts
        if self.world is None and self.world_number is None:
            return ResetOptions(starts, others.world_number, others.world)
        return ResetOptions(starts, self.world_number, self.world)


DRAWN = ResetOptions()
"""Nothing is given."""


def named_options(
    options: object, allowed: Collection[str] = NAMES, ignored: Mapping[str, object] = MappingProxyType({})
) -> dict[str, Any]:
    """Return the options of a reset, by name.

    Args:
        options: As given to `reset`.
        allowed: Their names.
        ignored: Options that are taken and mean nothing, with the value that they must have.

    Raises:
        SettingError: They are no mapping, or one of them is unknown.
    """
    if options is None:
        return {}
    if not isinstance(options, Mapping):
        raise SettingError("options", options, "a dict, or None")
    for name, value in options.items():
        if name not in allowed and not (name in ignored and value is ignored[name]):
            known = "only " + ", ".join(allowed)
            raise SettingError("options", name, known + did_you_mean(name, allowed))
    return dict(options)


def mission_options(options: Mapping[str, Any], scenario: Scenario) -> ResetOptions:
    """Return what is given for one mission.

    Args:
        options: As `named_options` gives them; other names than these are left alone.

    Raises:
        SettingError: The starts are no (A, 5) finite numbers, or the world is no number that the scenario
            has, nor a World.
        WorldError: The World has another grid.
    """
    starts, world = options.get("starts"), options.get("world")
    shape = (scenario.robots, 5)
    return ResetOptions(
        None if starts is None else _finite_poses(starts, shape, f"{shape}"),
        _world_number(world, scenario) if world is not None and not isinstance(world, World) else None,
        _fitting_world(world, scenario) if isinstance(world, World) else None,
    )


def batch_options(options: Mapping[str, Any], scenario: Scenario, missions: int) -> list[ResetOptions]:
    """Return what is given for each of E missions.

    Args:
        options: As for `mission_options`; one value for all missions, or E values.

    Raises:
        SettingError: As for `mission_options`, or there are not E values.
        WorldError: A World has another grid.
    """
    starts, world = options.get("starts"), options.get("world")
    each = [dict(options) for _ in range(missions)]
    if starts is not None:
        shape = (scenario.robots, 5)
        if np.ndim(_as_numbers(starts)) == 3:
            shape = (missions, *shape)
        poses = _finite_poses(starts, shape, f"{(scenario.robots, 5)} or {(missions, scenario.robots, 5)}")
        for mission in range(missions):
            each[mission]["starts"] = poses[mission] if poses.ndim == 3 else poses
    if isinstance(world, Sequence | np.ndarray) and not isinstance(world, str | bytes):
        if (isinstance(world, np.ndarray) and world.ndim != 1) or len(world) != missions:
            raise SettingError("world", world, f"one world, or {missions} of them")
        for mission in range(missions):
            each[mission]["world"] = world[mission]
    return [mission_options(given, scenario) for given in each]


def _as_numbers(starts: object) -> np.ndarray:
    """Return an array of whatever was given; one of objects where it is no array of numbers."""
    try:
        return np.asarray(starts)
    except Exception:  # lists of different lengths, or an __array__ of somebody else's
        return np.asarray(None)


def _finite_poses(starts: object, shape: tuple[int, ...], shapes: str) -> np.ndarray:
    """Return a new float64 array of this shape, or an error that names the shapes allowed."""
    poses = _as_numbers(starts)
    if poses.shape != shape or poses.dtype.kind not in "fiu" or not np.isfinite(poses).all():
        allowed = f"finite numbers of shape {shapes}: x, y, z, yaw, pitch of each robot"
        raise SettingError("starts", starts, allowed)
    return poses.astype(np.float64)


def _world_number(number: object, scenario: Scenario) -> int:
    """Return a world number, if the scenario has worlds by number and this one in its split."""
    if scenario.world not in RECIPES:
        allowed = "a World of the scenario's grid: only the worlds of recipes have numbers"
        raise SettingError("world", number, allowed)
    numbers = WORLD_NUMBERS[scenario.split]
    if not is_whole(number, numbers.start, numbers.stop - 1):
        allowed = f"a World, or a world number of the split '{scenario.split}': "
        allowed += f"a whole number from {numbers.start} to {numbers.stop - 1}"
        for split, others in WORLD_NUMBERS.items():
            if is_whole(number, others.start, others.stop - 1):
                allowed += f"; {number} is of the split '{split}'"
        raise SettingError("world", number, allowed)
    return int(number)


def _fitting_world(world: World, scenario: Scenario) -> World:
    if world.grid != scenario.grid:
        raise WorldError("world.grid", world.grid, f"that of the scenario, {scenario.grid}")
    return world
