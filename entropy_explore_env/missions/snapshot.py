"""Missions as plain arrays and back, bitwise: what a file needs so that they go on where they were."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from entropy_explore_env.errors import RecordError
from entropy_explore_env.missions.reset_options import ResetOptions, mission_options
from entropy_explore_env.missions.simulation import Missions
from entropy_explore_env.missions.state import FROM_WORLD
from entropy_explore_env.missions.state_ranges import check_ranges
from entropy_explore_env.worlds.load import world_bytes, world_from_bytes
from entropy_explore_env.worlds.world import World

_MOST_EPISODES = 2**53
_MOST_DIGITS = 4000


def snapshot(missions: Missions) -> dict[str, np.ndarray]:
    """Return all that changes in missions, for `restore`.

    Returns:
        Arrays without Python objects, so that NumPy writes and reads them without pickle: `seeds` and
        `episodes` (E,), `observations` (E, A, F) and the arrays of the MissionState, but for what the seeds
        say; and what the latest resets were given: `starts_e` (A, 5), `world_number_e` and `world_e` (the
        bytes that `save_world` writes) of a mission e.

    Raises:
        RecordError: A mission's world changes under way.
    """
    for mission in range(missions.count):
        check_world_stays(missions, mission)
    state = missions.state._asdict()
    kept = {name: array.copy() for name, array in state.items() if name not in FROM_WORLD}
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
        RecordError: An array is missing or does not fit these missions, or a number in it is in no mission
            of the scenario. Nothing has changed then.
        SettingError: Starts or a world number are not allowed, likewise.
        WorldError: A world cannot be used, likewise.
    """
    expected = {**missions.state._asdict(), "observations": missions.observations}
    expected["episodes"] = np.zeros(missions.count, np.int64)
    for name, array in expected.items():
        if name not in FROM_WORLD:
            check_array(name, arrays.get(name), array)
    seeds = arrays.get("seeds")
    if seeds is None or seeds.shape != (missions.count,) or not all(map(_is_seed, seeds)):
        raise RecordError("seeds", seeds, f"{missions.count} whole numbers ≥ 0")
    episodes, observations = arrays["episodes"], arrays["observations"]
    if not ((episodes >= 0) & (episodes < _MOST_EPISODES)).all():
        raise RecordError("episodes", episodes, f"from 0, the first, to {_MOST_EPISODES - 1}")
    low, high = missions.layout.low.astype(np.float32), missions.layout.high.astype(np.float32)
    if not ((observations >= low) & (observations <= high)).all():
        raise RecordError("observations", observations, "within the observation space")
    check_ranges(missions.scenario, arrays)
    starts = [
        missions.draw_episode(
            mission,
            int(str(seeds[mission])),
            int(episodes[mission]),
            _options_of(missions, mission, arrays),
        )
        for mission in range(missions.count)
    ]
    missions.begin(starts)
    for name, array in missions.state._asdict().items():
        if name not in FROM_WORLD:
            array[...] = arrays[name]
    missions.observations[...] = observations


def check_world_stays(missions: Missions, mission: int) -> None:
    """Raise a RecordError if a mission's world changes under way: nothing would hold these changes."""
    if missions.world_changes[mission]:
        raise RecordError("mission", "its world changes under way", "one in a world that stays as it is")


def _is_seed(seed: np.str_) -> bool:
    """Return whether a text is a seed's digits, and no more than Python turns into a number."""
    return str(seed).isdecimal() and len(str(seed)) <= _MOST_DIGITS


def _options_of(missions: Missions, mission: int, arrays: Mapping[str, np.ndarray]) -> ResetOptions:
    """Return what the mission's latest reset was given."""
    starts, number = arrays.get(f"starts_{mission}"), arrays.get(f"world_number_{mission}")
    content = arrays.get(f"world_{mission}")
    if starts is not None:
        check_array(f"starts_{mission}", starts, np.zeros((missions.scenario.robots, 5)))
    if number is not None:
        check_array(f"world_number_{mission}", number, np.array(0))
        number = int(number)
    world = None if content is None else _saved_world(f"world_{mission}", content)
    given = {"starts": starts, "world": number if world is None else world}
    return mission_options(given, missions.scenario)


def _saved_world(name: str, content: np.ndarray) -> World:
    """Return the world in the bytes of its file."""
    try:
        return world_from_bytes(content.tobytes())
    except Exception:  # of a broken archive: zipfile and NumPy raise a dozen kinds
        raise RecordError(name, f"{content.size} bytes", "the bytes of a saved world") from None


def check_array(name: str, given: np.ndarray | None, expected: np.ndarray) -> None:
    """Raise a RecordError unless an array has the shape and type of the one that it stands for."""
    if given is None or given.shape != expected.shape or given.dtype != expected.dtype:
        found = None if given is None else (given.shape, str(given.dtype))
        raise RecordError(name, found, f"{expected.shape}, {expected.dtype}, as these missions have")
