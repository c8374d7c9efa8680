"""Missions as plain arrays and back, bitwise: what a file needs so that they go on where they were."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from entropy_explore_env.errors import RecordError
from entropy_explore_env.missions.reset_options import ResetOptions
from entropy_explore_env.missions.simulation import Missions
from entropy_explore_env.worlds.load import world_bytes, world_from_bytes

_DRAWN = ("truth", "collision", "visible")
"""State that follows from a mission's seed and episode."""


def snapshot(missions: Missions) -> dict[str, np.ndarray]:
    """All that changes in missions, for `restore`.

    Returns:
        Arrays without Python objects, so that NumPy writes and reads them without pickle: `seeds` and
        `episodes` (E,), `observations` (E, A, F) and the arrays of the MissionState, but for what the seeds
        say; and what the latest resets were given: `starts_e` (A, 5), `world_number_e` and `world_e` (the
        bytes that `save_world` writes) of a mission e.
    """
    state = missions.state._asdict()
    kept = {name: array.copy() for name, array in state.items() if name not in _DRAWN}
    kept["seeds"] = np.array([str(seed) for seed in missions.seeds])
    kept["episodes"] = np.array(missions.episodes, np.int64)
    kept["observations"] = missions.observations.copy()
    for mission, options in enumerate(missions.options):
        if options.starts is not None:
            kept[f"starts_{mission}"] = options.starts.copy()
        if options.world_number is not None:
            kept[f"world_number_{mission}"] = np.array(options.world_number, np.int64)
        if options.world is not None:
            kept[f"world_{mission}"] = np.frombuffer(world_bytes(options.world), np.uint8)
    return kept


def restore(missions: Missions, arrays: Mapping[str, np.ndarray]) -> None:
    """Put missions where others of the same scenario were.

    Args:
        missions: Of the same scenario and number.
        arrays: As `snapshot` gave them.

    Raises:
        RecordError: An array is missing or does not fit these missions. Nothing has changed then.
    """
    expected = {**missions.state._asdict(), "observations": missions.observations}
    expected["episodes"] = np.zeros(missions.count, np.int64)
    for name, array in expected.items():
        if name not in _DRAWN:
            check_array(name, arrays.get(name), array)
    seeds = arrays.get("seeds")
    if seeds is None or seeds.shape != (missions.count,) or not all(str(seed).isdecimal() for seed in seeds):
        raise RecordError("seeds", seeds, f"{missions.count} whole numbers ≥ 0")
    given = [_options_of(missions, mission, arrays) for mission in range(missions.count)]
    for mission, options in enumerate(given):
        seed, episode = int(str(seeds[mission])), max(int(arrays["episodes"][mission]), 0)
        missions.start_episode(mission, seed, episode, options)
    for name, array in missions.state._asdict().items():
        if name not in _DRAWN:
            array[...] = arrays[name]
    missions.observations[...] = arrays["observations"]


def _options_of(missions: Missions, mission: int, arrays: Mapping[str, np.ndarray]) -> ResetOptions:
    """What the mission's latest reset was given."""
    starts, number = arrays.get(f"starts_{mission}"), arrays.get(f"world_number_{mission}")
    world = arrays.get(f"world_{mission}")
    if starts is not None:
        check_array(f"starts_{mission}", starts, np.zeros((missions.scenario.robots, 5)))
    if number is not None:
        check_array(f"world_number_{mission}", number, np.array(0))
    return ResetOptions(
        None if starts is None else starts.copy(),
        None if number is None else int(number),
        None if world is None else world_from_bytes(world.tobytes()),
    )


def check_array(name: str, given: np.ndarray | None, expected: np.ndarray) -> None:
    """Raise a RecordError unless an array has the shape and type of the one that it stands for."""
    if given is None or given.shape != expected.shape or given.dtype != expected.dtype:
        found = None if given is None else (given.shape, str(given.dtype))
        raise RecordError(name, found, f"{expected.shape}, {expected.dtype}, as these missions have")
