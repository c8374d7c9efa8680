"""The range coder: what is written is read again, and takes as many bits as its decisions are surprising."""

import math

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from entropy_explore_env.robots.range_coder import (
    CODER,
    Coder,
    begin_reading,
    begin_writing,
    code_bit,
    code_byte,
    code_change,
    end_writing,
)
from tests.reference.scenes import drawn, seeds

FIRST = 3
CONTEXTS = 256 + 73


def new_coder(room):
    return Coder(np.zeros(1, CODER), np.zeros(CONTEXTS, np.uint32), np.full(room, 77, np.uint8))


def written(numbers, changes, flat=False, room=20_000):
    """The bytes of numbers below 256 and of changes, and where they end."""
    coder = new_coder(room)
    begin_writing(coder, FIRST, flat)
    for number in numbers:
        code_byte(coder, 0, number)
    for change in changes:
        code_change(coder, 256, change)
    return coder.data, end_writing(coder, FIRST)


@drawn(100)
@given(
    st.lists(st.integers(0, 255), max_size=60),
    st.lists(st.integers(-255, 255).filter(bool), max_size=60),
    st.booleans(),
)
@example([*range(256)] * 2, [*range(-255, 0), *range(1, 256)] * 2, False)  # after the odds have learned
def test_what_is_written_is_read_again(numbers, changes, flat):
    data, end = written(numbers, changes, flat)
    assert (data[:2] == 77).all() and data[2] == 0  # before its place
    coder = new_coder(0)._replace(data=data.copy())
    coder.data[end:] = 55  # what is behind the end does not matter
    begin_reading(coder, FIRST, end, flat)
    assert [code_byte(coder, 0, 0) for _ in numbers] == numbers
    assert [code_change(coder, 256, 0) for _ in changes] == changes


@pytest.mark.parametrize("reads", [False, True])
@pytest.mark.parametrize(
    ("before", "after"), [(1 << 25, 1 << 24), ((1 << 25) - (1 << 12), (1 << 32) - (1 << 19))]
)
def test_a_byte_is_done_as_soon_as_an_interval_is_shorter_than_its_place(before, after, reads):
    """Half of 2²⁵ is not shorter than 2²⁴; half of 2²⁵ - 2¹² is, and becomes 256 times as long."""
    coder = new_coder(20)
    if reads:
        begin_reading(coder, FIRST, FIRST, True)
    else:
        begin_writing(coder, FIRST, True)
    record = coder.record[0]
    record["range"], done = before, record["place"] + record["waiting"]
    code_bit(coder, 0, 0)
    assert record["range"] == after
    assert record["place"] + record["waiting"] - done == int(after > 1 << 24)


@drawn(40)
@given(seeds)
def test_carries_reach_back_through_bytes_of_255(seed):
    """Of decisions the likely one always comes, and then the unlikely ones: the interval's end moves."""
    rng = np.random.default_rng(seed)
    numbers = [0] * int(rng.integers(200, 400)) + rng.integers(0, 256, 40).tolist() + [255] * 200
    data, end = written(numbers, [])
    coder = new_coder(0)._replace(data=data)
    begin_reading(coder, FIRST, end, False)
    assert [code_byte(coder, 0, 0) for _ in numbers] == numbers


@pytest.mark.parametrize("share", [0.5, 0.1, 0.01])
def test_decisions_take_about_as_many_bits_as_they_are_surprising(share):
    rng, count = np.random.default_rng(3), 4000
    numbers = np.where(rng.random(count) < share, 1, 0).tolist()  # seven decisions that never vary, and one
    entropy = -share * math.log2(share) - (1 - share) * math.log2(1 - share)
    _, end = written(numbers, [])
    bits = 8 * (end - FIRST)
    seen = count * entropy
    assert 0.9 * seen < bits < 1.15 * seen + 7 * 0.02 * count


def test_flat_decisions_take_a_bit_each_and_nothing_more():
    rng = np.random.default_rng(4)
    numbers = rng.integers(0, 256, 1000).tolist()
    _, end = written(numbers, [], flat=True)
    assert end - FIRST in (1000, 1001, 1002)
    _, end = written([], [-1] * 8000, flat=True)
    assert end - FIRST in (2000, 2001, 2002)  # a sign, and one bit for the size 1
    _, end = written([], [-255] * 800, flat=True)
    assert end - FIRST in (1500, 1501, 1502)  # a sign, seven ones, seven places


def test_what_has_no_room_is_counted_but_not_written():
    numbers = list(range(256)) * 4
    data, end = written(numbers, [], room=100)
    _, whole = written(numbers, [])
    assert whole > 100 == len(data) and end == whole
