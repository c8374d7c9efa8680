"""Seeds of missions: those for learning, for validation and for tables have none in common.

| for | seeds |
| --- | --- |
| tables and tests | 0, 1, 2, … |
| validation | 2³² + 0, 1, 2, … |
| learning | ≥ 2⁶³, drawn for each run and runner |
"""

from __future__ import annotations

import numpy as np

_VALIDATION, _LEARNING = 2**32, 2**63


def validation_seeds(missions: int) -> list[int]:
    """The first seeds for validation; the same for every run, so that runs compare."""
    return [_VALIDATION + mission for mission in range(missions)]


def learning_seeds(seed: int, missions: int, runner: int = 0) -> list[int]:
    """Seeds of a runner's missions.

    Args:
        seed: Of the run.
        missions: How many.
        runner: Its number: runners of a run share no seed.
    """
    drawn = np.random.SeedSequence(entropy=seed, spawn_key=(runner,)).generate_state(missions, np.uint64)
    return [_LEARNING + int(number) for number in drawn]
