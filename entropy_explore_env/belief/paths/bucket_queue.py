"""A priority queue of voxels by cost: a ring of buckets (Dial 1969; Denardo & Fox 1979).

A bucket holds the voxels whose keys lie in one interval, in no order: pushing and popping take the same
time whatever the length of the queue. The voxels of a bucket lie in a linked list of blocks of one cache
line each. Emptied blocks are used again, so the queue needs only the memory of what it holds at one time.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from entropy_explore_env.compilation.kernels import inlined_kernel, lean_kernel, record_type

BUCKETS = 1024
"""Buckets of the ring, a power of two; keys beyond the ring go into the last one."""

BUCKET_WIDTH = 1.0 - 2.0**-20
"""Width of a bucket in cheapest steps: below 1, so that rounding puts no step's ends into one bucket."""
_RING_MASK = BUCKETS - 1
_BLOCK_ENTRIES = 15
"""Voxels of a block: with the number of the next block they fill 64 bytes."""
_NO_BLOCK = -1

_STATE = record_type(
    [
        ("current", "i8"),  # number of the bucket that is processed now
        ("entries", "i8"),  # voxels in all buckets
        ("unused", "i8"),  # first of the blocks that were never used
        ("free", "i8"),  # first block of the list of emptied ones; -1 = none
    ],
)


class BucketQueue(NamedTuple):
    """A queue. Buckets are numbered from 0; at any time `BUCKETS` of them, from the current one on, exist."""

    blocks: np.ndarray
    """(N, 16) int32: the next block of the bucket, -1 = none, and 15 voxels."""
    heads: np.ndarray
    """(BUCKETS, 2) int32: first block of a bucket, -1 = none, and how many voxels it holds.

    All other blocks of a bucket are full.
    """
    state: np.ndarray
    """(1,) of _STATE."""


def new_queue(entries: int) -> BucketQueue:
    """Return a queue for this many entries; the system provides the memory when it is first written."""
    # One block of each bucket is partly filled, one is popped, one is spare.
    blocks = entries // _BLOCK_ENTRIES + 1 + BUCKETS + 2
    return BucketQueue(
        np.empty((blocks, _BLOCK_ENTRIES + 1), np.int32),
        np.empty((BUCKETS, 2), np.int32),
        np.zeros(1, _STATE),
    )


@lean_kernel
def clear_queue(queue):
    """Empty a queue; its current bucket becomes the first one."""
    for place in range(BUCKETS):
        queue.heads[place, 0], queue.heads[place, 1] = _NO_BLOCK, 0
    state = queue.state[0]
    state.current, state.entries, state.unused, state.free = 0, 0, 0, _NO_BLOCK


@inlined_kernel
def queue_full(queue):
    """Return whether only the spare block is left, which `compact` needs."""
    state = queue.state[0]
    return state.free == _NO_BLOCK and state.unused >= len(queue.blocks) - 1


@inlined_kernel
def push(queue, bucket, voxel):
    """Push a voxel into a bucket: the current one if it is earlier, the last one if it is beyond the ring."""
    state, heads, blocks = queue.state[0], queue.heads, queue.blocks
    place = min(max(bucket, state.current), state.current + _RING_MASK) & _RING_MASK
    count = heads[place, 1]
    if heads[place, 0] == _NO_BLOCK or count == _BLOCK_ENTRIES:
        block = state.free
        if block == _NO_BLOCK:
            block = state.unused
            state.unused += 1
        else:
            state.free = blocks[block, 0]
        blocks[block, 0] = heads[place, 0]
        heads[place, 0] = block
        count = 0
    blocks[heads[place, 0], count + 1] = voxel
    heads[place, 1] = count + 1
    state.entries += 1


@inlined_kernel
def advance(queue):
    """Make the first bucket that is not empty the current one; False if the queue is empty."""
    state, heads, current = queue.state[0], queue.heads, queue.state[0].current
    if state.entries == 0:
        return False
    while heads[current & _RING_MASK, 0] == _NO_BLOCK:
        current += 1
    state.current = current
    return True


@inlined_kernel
def pop_block(queue):
    """Pop the latest block of the current bucket, which must not be empty.

    Returns:
        (block, count): its voxels are `blocks[block, 1 … count]`. Return it by `free_block` when they are
        processed.
    """
    state, heads = queue.state[0], queue.heads
    place = state.current & _RING_MASK
    block, count = np.int64(heads[place, 0]), np.int64(heads[place, 1])
    heads[place, 0] = queue.blocks[block, 0]
    heads[place, 1] = _BLOCK_ENTRIES
    state.entries -= count
    return block, count


@inlined_kernel
def free_block(queue, block):
    """Let a popped block be used again."""
    queue.blocks[block, 0] = queue.state[0].free
    queue.state[0].free = block


@lean_kernel
def compact(queue, mark, bit):
    """Drop the entries that are out of date, and all but the first entry of each voxel.

    Args:
        queue: Changed in place; one block must be spare.
        mark: (V,) uint32; the same afterwards.
        bit: The bit of `mark` that is set while a voxel is in the queue: entries without it are out of date.
    """
    state, heads, blocks = queue.state[0], queue.heads, queue.blocks
    state.entries = 0
    for bucket in range(state.current, state.current + BUCKETS):
        place = bucket & _RING_MASK
        block, count = heads[place, 0], heads[place, 1]
        heads[place, 0], heads[place, 1] = _NO_BLOCK, 0
        while block != _NO_BLOCK:
            for entry in range(1, count + 1):
                voxel = blocks[block, entry]
                if mark[voxel] & bit:
                    mark[voxel] = np.uint32(mark[voxel] ^ bit)  # so that a second entry is dropped
                    push(queue, bucket, voxel)
            following = blocks[block, 0]
            blocks[block, 0] = state.free
            state.free = block
            block, count = following, _BLOCK_ENTRIES
    for place in range(BUCKETS):
        block, count = heads[place, 0], heads[place, 1]
        while block != _NO_BLOCK:
            for entry in range(1, count + 1):
                voxel = blocks[block, entry]
                mark[voxel] = np.uint32(mark[voxel] | bit)
            block, count = blocks[block, 0], _BLOCK_ENTRIES
