"""The values of a mission's state by name, and the digest by which a replay is compared with its record."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping

import numpy as np

from entropy_explore_env.missions.simulation import Missions
from entropy_explore_env.missions.state import FROM_WORLD


def state_values(missions: Missions, mission: int) -> dict[str, np.ndarray]:
    """Return the values of a mission's state, but for what follows from its world, by array and field.

    Args:
        missions: Missions of which one is read.
        mission: Which one.

    Returns:
        Name → array, a view of the state, in the order of MissionState.
    """
    values: dict[str, np.ndarray] = {}
    for name, array in missions.state._asdict().items():
        if name in FROM_WORLD:
            continue
        if array.dtype.names is None:
            values[name] = array[mission, ...]
            continue
        values |= {f"{name}.{field}": array[field][mission, ...] for field in array.dtype.names}
    return values


def state_digest(missions: Missions, mission: int) -> str:
    """Return the SHA-256 of a mission's values."""
    return named_digest(state_values(missions, mission))


def named_digest(parts: Mapping[str, np.ndarray]) -> str:
    """Return the SHA-256 of arrays with their names, types and shapes, in the order given."""
    digest = hashlib.sha256()
    for name, part in parts.items():
        digest.update(f"{name} {part.dtype.str} {part.shape}\n".encode())
        digest.update(np.ascontiguousarray(part).reshape(-1).view(np.uint8).data)
    return digest.hexdigest()
