"""An adaptive binary range coder: decisions as few bytes as their odds allow, and back (Martin 1979).

Each decision has a context, and each context learns how often its decisions were 0: fast at first, then as a
moving average over about 32 of them. The form is that of LZMA, of whose last bytes those are left out that
are zeros: whoever reads beyond the end reads zeros.

Writing and reading are one: `code_bit`, and what is made of it, writes what it is given, or disregards that
and returns what was written.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from entropy_explore_env.compilation.kernels import inlined_kernel, lean_kernel, record_type

CODER = record_type(
    [
        ("low", "u8"),  # writing: lower end of the interval; reading: how far the code is above it
        ("range", "u8"),  # its length
        ("held", "u8"),  # writing: the byte that a carry may still change
        ("waiting", "i8"),  # bytes that wait for it: the held one, and those of 255 behind it
        ("place", "i8"),  # in the data: of the next byte
        ("last", "i8"),  # where the data end; writing: behind the last byte that is not 0
        ("flat", "?"),  # whether all decisions count as equally likely, so that many bytes are never needed
        ("reads", "?"),  # whether decisions are read, not written
    ]
)
"""How far a coder has come."""

_HALF = np.uint32(1 << 15)
"""Of the odds of 0, in 2⁻¹⁶."""
_SHIFTS = sum(min((n + 1).bit_length(), 5) << (4 * n) for n in range(16))
"""Four bits for each number of decisions: the shift by which the next one moves the odds."""
_MOST_COUNTED = 15
_FULL, _TOP, _BYTE = np.uint64(0xFFFFFFFF), np.uint64(1 << 24), np.uint64(0xFF)
_CARRIED = np.uint64(0xFF000000)
_8, _12, _24, _32 = np.uint64(8), np.uint64(12), np.uint64(24), np.uint64(32)


class Coder(NamedTuple):
    """A coder, its contexts, and what it writes or reads."""

    record: np.ndarray
    """(1,) CODER."""
    odds: np.ndarray
    """(C,) uint32 of each context: the odds of 0 in 2⁻¹⁶, times 16, and how many decisions it has seen."""
    data: np.ndarray
    """(M,) uint8."""


@lean_kernel
def begin_writing(coder, place, flat):
    """Write from a place ≥ 1 of the data on; all contexts have seen nothing.

    The byte before it becomes 0: it would take a carry, and there is none.
    """
    record = coder.record[0]
    record.low, record.range, record.held = np.uint64(0), _FULL, np.uint64(0)
    record.waiting, record.place, record.last = 1, place - 1, place
    record.flat, record.reads = flat, False
    forget(coder.odds)


@lean_kernel
def begin_reading(coder, first, last, flat):
    """Read the data from place `first` up to, not including, `last`."""
    record = coder.record[0]
    record.low, record.range = np.uint64(0), _FULL
    record.place, record.last, record.flat, record.reads = first, last, flat, True
    forget(coder.odds)
    for _ in range(4):
        record.low = record.low << _8 | get(record, coder.data)


@lean_kernel
def forget(odds):
    """Let all contexts have seen nothing."""
    for context in range(len(odds)):
        odds[context] = _HALF << np.uint32(4)


@inlined_kernel
def odds_of_zero(coder, record, context):
    """Return twelve bits, never 0: how likely a context's next decision is 0."""
    if record.flat:
        return np.uint64(1 << 11)
    return np.uint64(coder.odds[context] >> np.uint32(8))


@inlined_kernel
def learn(coder, record, context, bit):
    """Let a context see a decision."""
    if record.flat:
        return
    known = np.int64(coder.odds[context])
    odds, seen = known >> 4, known & 15
    shift = (np.uint64(_SHIFTS) >> np.uint64(4 * seen)) & np.uint64(15)
    if bit == 0:
        odds += (65536 - odds) >> np.int64(shift)
    else:
        odds -= odds >> np.int64(shift)
    coder.odds[context] = np.uint32(odds << 4 | min(seen + 1, _MOST_COUNTED))


@inlined_kernel
def code_bit(coder, context, bit):
    """Write or read a decision, 0 or 1, of a context; returns it."""
    record = coder.record[0]
    bound = (record.range >> _12) * odds_of_zero(coder, record, context)
    if record.reads:
        bit = int(record.low >= bound)
    if bit == 0:
        record.range = bound
    else:
        record.range -= bound
        record.low = record.low - bound if record.reads else record.low + bound
    learn(coder, record, context, bit)
    while record.range < _TOP:
        record.range <<= _8
        if record.reads:
            record.low = record.low << _8 | get(record, coder.data)
        else:
            shift_out(record, coder.data)
    return bit


@lean_kernel
def shift_out(record, data):
    """Write the highest byte of the interval's lower end as soon as no carry can change it any more."""
    if record.low < _CARRIED or record.low > _FULL:
        carry = record.low >> _32
        byte = record.held
        while record.waiting > 0:
            put(record, data, (byte + carry) & _BYTE)
            byte = _BYTE
            record.waiting -= 1
        record.held = (record.low >> _24) & _BYTE
    record.waiting += 1
    record.low = (record.low << _8) & _FULL


@inlined_kernel
def put(record, data, byte):
    """Write a byte, if there is room: it is counted in any case."""
    if record.place < len(data):
        data[record.place] = np.uint8(byte)
    record.place += 1
    if byte != 0:
        record.last = record.place


@lean_kernel
def end_writing(coder, first):
    """Write what is left; returns where the data, which began at place `first`, end.

    Where that is beyond the array there was too little room, and the data are not whole.
    """
    record = coder.record[0]
    inside = record.low + _TOP - np.uint64(1)
    record.low = inside & ~(_TOP - np.uint64(1))  # in the interval, and ends in three bytes of 0
    for _ in range(2):  # what is held, and the first byte of it
        shift_out(record, coder.data)
    return max(record.last, first)


@inlined_kernel
def get(record, data):
    """Return the next byte; 0 behind the end."""
    byte = np.uint64(data[record.place]) if record.place < record.last else np.uint64(0)
    record.place += 1
    return byte


@lean_kernel
def code_byte(coder, contexts, byte):
    """Write or read a number below 256 as eight decisions, of the 256 contexts from number `contexts` on."""
    node = 1
    for place in range(7, -1, -1):
        node = node << 1 | code_bit(coder, contexts + node, (byte >> place) & 1)
    return node & 255


@lean_kernel
def code_change(coder, contexts, change):
    """Write or read a whole number other than 0, between -256 and 256: its sign, and its size in gamma code.

    Elias's gamma code tells how many bits there are below the highest one, and then these.

    Args:
        contexts: Number of the first of 73 contexts.
        change: The number.
    """
    negative, bits, told = code_bit(coder, contexts, int(change < 0)), 0, abs(change)
    while bits < 7 and code_bit(coder, contexts + 1 + bits, int(told >> (bits + 1) > 0)) == 1:
        bits += 1
    size = 1
    for place in range(bits - 1, -1, -1):
        size = size << 1 | code_bit(coder, contexts + 9 + 8 * bits + place, (told >> place) & 1)
    return -size if negative == 1 else size
