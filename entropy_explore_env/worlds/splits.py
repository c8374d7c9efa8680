"""Which worlds are for training, for validation and for tests: disjoint ranges of world numbers.

A recipe makes a world from a grid and a world number and nothing else, so the same number is the same
world in every mission. A mission draws its number, from the range of its scenario's split, by its own
stream of worlds. The ranges are part of the contract: they do not change between versions.

| split | world numbers |
| --- | --- |
| `train` | 0 … 2³¹ − 1 |
| `validation` | 2³¹ … 2³¹ + 2²⁰ − 1 |
| `test` | 2³¹ + 2²⁰ … 2³¹ + 2²¹ − 1 |
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

WORLD_NUMBERS: Mapping[str, range] = MappingProxyType(
    {
        "train": range(0, 2**31),
        "validation": range(2**31, 2**31 + 2**20),
        "test": range(2**31 + 2**20, 2**31 + 2**21),
    }
)
"""Split → its world numbers."""


def draw_world_number(split: str, rng: np.random.Generator) -> int:
    """Return the number of a mission's world: uniform over the split's range.

    Args:
        split: `train`, `validation` or `test`.
        rng: The mission's stream of worlds; one draw.
    """
    numbers = WORLD_NUMBERS[split]
    return int(rng.integers(numbers.start, numbers.stop))
