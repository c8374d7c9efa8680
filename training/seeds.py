"""Seeds of missions: learning, validation and tables never share one.

| for | seeds |
| --- | --- |
| tables and tests | 0, 1, 2, … |
| validation | 2³² + 0, 1, 2, … |
| learning, and pairs of missions | ≥ 2⁶³, drawn for each run |
"""

from __future__ import annotations

import numpy as np

_VALIDATION, _LEARNING = 2**32, 2**63
_PAIRS_KEY = 2


def validation_seeds(missions: int) -> list[int]:
    """Return the seeds of validation; every run has the same, so that runs compare."""
    return [_VALIDATION + mission for mission in range(missions)]


def pair_seeds(seed: int, part: int, pairs: int) -> list[int]:
    """Seeds of the pairs of missions of one part of a search; those of learning, and never one twice."""
    return _drawn(seed, (_PAIRS_KEY, part), pairs)


def learning_seeds(seed: int, missions: int) -> list[int]:
    """Seeds of the missions that a run with this seed begins with."""
    return _drawn(seed, (0,), missions)


def _drawn(seed: int, key: tuple[int, ...], missions: int) -> list[int]:
    """Seeds of learning that follow from a run's seed and a key; others for every key."""
    sequence = np.random.SeedSequence(entropy=seed, spawn_key=key)
    return [_LEARNING + int(drawn) for drawn in sequence.generate_state(missions, np.uint64)]
