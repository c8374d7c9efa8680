"""What records of earlier format versions hold, and how the state at their end is verified.

- 1: the first form; the digest covers names, types, shapes and bytes of the state (`named_digest`).
- 2: the same, and `world`, a world that was given as an object.
- 3: `reward_function`, and where there is one `world`, `world_number` and `starts`; the digest covers values
  only (`state_digest`), so that names and grouping in the code may change.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping

import numpy as np

from entropy_explore_env.missions.simulation import Missions
from entropy_explore_env.reports.state_values import state_digest, state_values

FORMAT_VERSION = 3
"""Of records that are written."""
LAST_NAMED_DIGEST = 2
"""The last format version whose digest also covers names, types and shapes."""
REQUIRED: Mapping[int, tuple[str, ...]] = {1: (), 2: ("world",), 3: ("reward_function",)}
"""Format version → the entries that it has beside those of all versions."""
OPTIONAL: Mapping[int, tuple[str, ...]] = {1: (), 2: (), 3: ("world", "starts", "world_number")}
"""Format version → the entries that it may have."""
VALUES_SINCE_NAMED_DIGEST: frozenset[str] = frozenset()
"""Values of the state that are newer than the digest of versions 1 and 2, which leaves them out."""


def digest_of_version(missions: Missions, mission: int, version: int) -> str:
    """The digest of a mission's state as records of a format version have it."""
    if version > LAST_NAMED_DIGEST:
        return state_digest(missions, mission)
    values = state_values(missions, mission).items()
    return named_digest({name: value for name, value in values if name not in VALUES_SINCE_NAMED_DIGEST})


def named_digest(parts: Mapping[str, np.ndarray]) -> str:
    """SHA-256 of arrays with their names, types and shapes, in the order given."""
    digest = hashlib.sha256()
    for name, part in parts.items():
        digest.update(f"{name} {part.dtype.str} {part.shape}\n".encode())
        digest.update(np.ascontiguousarray(part).reshape(-1).view(np.uint8).data)
    return digest.hexdigest()
