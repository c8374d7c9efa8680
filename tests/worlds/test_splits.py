"""Splits have no world number in common, and no world."""

from __future__ import annotations

import hashlib
import itertools
from typing import get_args, get_type_hints

import numpy as np
import pytest

from entropy_explore_env.randomness import Stream, generator
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.scenario import Scenario
from entropy_explore_env.settings.scenarios import BHATTACHARYA_OFFICE, ROOM_FURNISHED
from entropy_explore_env.worlds import splits
from entropy_explore_env.worlds.load import make_world
from entropy_explore_env.worlds.splits import WORLD_NUMBERS, draw_world_number


def test_the_ranges_are_those_of_the_contract():
    assert WORLD_NUMBERS["train"] == range(0, 2_147_483_648)
    assert WORLD_NUMBERS["validation"] == range(2_147_483_648, 2_148_532_224)
    assert WORLD_NUMBERS["test"] == range(2_148_532_224, 2_149_580_800)
    assert tuple(WORLD_NUMBERS) == get_args(get_type_hints(Scenario)["split"])
    assert all(f"`{split}`" in str(splits.__doc__) for split in WORLD_NUMBERS)
    with pytest.raises(TypeError):
        WORLD_NUMBERS["train"] = range(3)


@pytest.mark.parametrize("split", WORLD_NUMBERS)
def test_numbers_are_drawn_from_the_whole_range_of_the_split(split):
    numbers = WORLD_NUMBERS[split]
    drawn = [draw_world_number(split, generator(seed, 0, Stream.WORLD)) for seed in range(400)]
    assert all(number in numbers for number in drawn)
    tenth = len(numbers) // 10
    assert min(drawn) < numbers.start + tenth and max(drawn) >= numbers.stop - tenth


@pytest.mark.parametrize(
    "scenario", [ROOM_FURNISHED, BHATTACHARYA_OFFICE], ids=lambda scenario: scenario.name
)
def test_no_world_repeats_across_splits(scenario):
    """Whole worlds compared, 300 of each split, as missions draw them."""
    seen = {}
    for split in WORLD_NUMBERS:
        those = with_settings(scenario, {"split": split})
        worlds = (make_world(those, generator(seed, 0, Stream.WORLD)) for seed in range(300))
        seen[split] = {hashlib.sha256(world.occupied).hexdigest() for world in worlds}
        assert len(seen[split]) == 300
    for one, other in itertools.combinations(seen.values(), 2):
        assert not one & other


def test_the_same_number_is_the_same_world_whatever_the_split():
    number = WORLD_NUMBERS["validation"].start
    scenarios = [with_settings(ROOM_FURNISHED, {"split": split}) for split in WORLD_NUMBERS]
    first, *others = [make_world(scenario, number) for scenario in scenarios]
    for other in others:
        np.testing.assert_array_equal(first.occupied, other.occupied)
    neighbours = make_world(ROOM_FURNISHED, number - 1), make_world(ROOM_FURNISHED, number + 1)
    assert all((first.occupied != other.occupied).any() for other in neighbours)
