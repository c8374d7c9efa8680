"""A queue of voxels by cost, in a ring of buckets (Dial 1969; Denardo & Fox 1979).

A bucket holds the voxels whose keys lie in one interval, in no order: putting in and taking out cost
the same however many wait. Its entries lie in blocks of one cache line; blocks that are emptied serve
again, so that the queue takes the memory of the entries that wait at once.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from entropy_explore_env.compilation.kernels import inlined_kernel, lean_kernel

BUCKETS = 1024
"""Buckets of the ring, a power of two; what lies farther ahead waits in the last one."""

_RING = BUCKETS - 1
_ENTRIES = 15
"""Voxels of a block: with the number of the next block they fill 64 bytes."""
_NONE = -1

_NUMBERS = np.dtype(
    [
        ("current", "i8"),  # number of the bucket that is worked off
        ("waiting", "i8"),  # entries in all buckets
        ("fresh", "i8"),  # first block that was never used
        ("freed", "i8"),  # first block that can be used again; -1 = none
    ],
    align=True,
)


class BucketQueue(NamedTuple):
    """A queue. Its buckets are numbered from 0; `BUCKETS` of them, from the current one on, can be filled."""

    blocks: np.ndarray
    """(N, 16) int32: the next block of the bucket, -1 = none, and 15 voxels."""
    heads: np.ndarray
    """(BUCKETS, 2) int32: first block, -1 = none, and how many voxels it holds; all others are full."""
    numbers: np.ndarray
    """(1,) of _NUMBERS."""


def new_queue(entries: int) -> BucketQueue:
    """A queue with room for this many entries; the memory is taken when it is used."""
    # One block a bucket is partly filled, one is taken out, one is spare.
    blocks = entries // _ENTRIES + 1 + BUCKETS + 2
    return BucketQueue(
        np.empty((blocks, _ENTRIES + 1), np.int32), np.empty((BUCKETS, 2), np.int32), np.zeros(1, _NUMBERS)
    )


@lean_kernel
def clear_queue(queue):
    """Empty a queue, whatever it holds; the current bucket is the first."""
    for place in range(BUCKETS):
        queue.heads[place, 0], queue.heads[place, 1] = _NONE, 0
    numbers = queue.numbers[0]
    numbers.current, numbers.waiting, numbers.fresh, numbers.freed = 0, 0, 0, _NONE


@inlined_kernel
def queue_full(queue):
    """Whether no block is left but the spare one, which `keep_entries` needs."""
    numbers = queue.numbers[0]
    return numbers.freed == _NONE and numbers.fresh >= len(queue.blocks) - 1


@inlined_kernel
def put(queue, bucket, voxel):
    """Put a voxel into a bucket: one before the current counts as it, one beyond the ring as the last."""
    numbers, heads, blocks = queue.numbers[0], queue.heads, queue.blocks
    place = min(max(bucket, numbers.current), numbers.current + _RING) & _RING
    count = heads[place, 1]
    if heads[place, 0] == _NONE or count == _ENTRIES:
        block = numbers.freed
        if block == _NONE:
            block = numbers.fresh
            numbers.fresh += 1
        else:
            numbers.freed = blocks[block, 0]
        blocks[block, 0] = heads[place, 0]
        heads[place, 0] = block
        count = 0
    blocks[heads[place, 0], count + 1] = voxel
    heads[place, 1] = count + 1
    numbers.waiting += 1


@inlined_kernel
def go_on(queue):
    """Make the first bucket that is not empty the current one; returns whether there is one."""
    numbers, heads, current = queue.numbers[0], queue.heads, queue.numbers[0].current
    if numbers.waiting == 0:
        return False
    while heads[current & _RING, 0] == _NONE:
        current += 1
    numbers.current = current
    return True


@inlined_kernel
def take_block(queue):
    """Take the block that came last out of the current bucket, which is not empty.

    Returns:
        (block, count): its voxels are `blocks[block, 1 … count]`; give it back by `free_block` when
        they are worked off.
    """
    numbers, heads = queue.numbers[0], queue.heads
    place = numbers.current & _RING
    block, count = np.int64(heads[place, 0]), np.int64(heads[place, 1])
    heads[place, 0] = queue.blocks[block, 0]
    heads[place, 1] = _ENTRIES
    numbers.waiting -= count
    return block, count


@inlined_kernel
def free_block(queue, block):
    """Let a block that was taken out serve again."""
    queue.blocks[block, 0] = queue.numbers[0].freed
    queue.numbers[0].freed = block


@lean_kernel
def keep_entries(queue, mark, bit):
    """Drop entries whose voxel does not bear a mark, and all but the first of each voxel.

    Args:
        queue: Changed in place; with one block to spare.
        mark: (V,) uint32; afterwards as before.
        bit: The bit of a mark that says that the voxel waits.
    """
    numbers, heads, blocks = queue.numbers[0], queue.heads, queue.blocks
    numbers.waiting = 0
    for bucket in range(numbers.current, numbers.current + BUCKETS):
        place = bucket & _RING
        block, count = heads[place, 0], heads[place, 1]
        heads[place, 0], heads[place, 1] = _NONE, 0
        while block != _NONE:
            for entry in range(1, count + 1):
                voxel = blocks[block, entry]
                if mark[voxel] & bit:
                    mark[voxel] = np.uint32(mark[voxel] ^ bit)
                    put(queue, bucket, voxel)
            after = blocks[block, 0]
            blocks[block, 0] = numbers.freed
            numbers.freed = block
            block, count = after, _ENTRIES
    for place in range(BUCKETS):
        block, count = heads[place, 0], heads[place, 1]
        while block != _NONE:
            for entry in range(1, count + 1):
                voxel = blocks[block, entry]
                mark[voxel] = np.uint32(mark[voxel] | bit)
            block, count = blocks[block, 0], _ENTRIES
