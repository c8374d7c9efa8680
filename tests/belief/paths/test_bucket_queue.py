"""The bucket queue against a sorted list."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from entropy_explore_env.belief.paths.bucket_queue import (
    BUCKETS,
    advance,
    clear_queue,
    compact,
    free_block,
    new_queue,
    pop_block,
    push,
    queue_full,
)
from tests.reference.scenes import drawn

ENTRIES = 400


def emptied(queue):
    found = []
    while advance(queue):
        block, count = pop_block(queue)
        voxels = queue.blocks[block, count:0:-1].tolist()
        found += [(int(queue.state[0]["current"]), voxel) for voxel in voxels]
        free_block(queue, block)
    return found


@drawn(60)
@given(st.lists(st.tuples(st.integers(0, BUCKETS - 1), st.integers(0, 99)), max_size=ENTRIES))
def test_entries_are_popped_by_bucket_the_latest_first(entries):
    queue = new_queue(ENTRIES)
    for _ in range(2):  # a used queue is as good as a new one
        clear_queue(queue)
        for bucket, voxel in entries:
            push(queue, bucket, voxel)
        assert emptied(queue) == sorted(entries[::-1], key=lambda entry: entry[0])
    assert not advance(queue)


def test_the_ring_turns_and_keys_beyond_it_go_into_the_last_bucket():
    queue = new_queue(ENTRIES)
    clear_queue(queue)
    push(queue, 700, 1)
    assert emptied(queue) == [(700, 1)]
    push(queue, 3, 2)  # before the current one
    push(queue, 700 + BUCKETS - 1, 3)
    push(queue, 10**7, 4)
    push(queue, 1100, 5)
    assert emptied(queue) == [(700, 2), (1100, 5), (700 + BUCKETS - 1, 4), (700 + BUCKETS - 1, 3)]


@drawn(40)
@given(
    st.lists(st.tuples(st.integers(0, 40), st.integers(0, 30)), min_size=30, max_size=ENTRIES),
    st.sets(st.integers(0, 30)),
)
def test_compacting_keeps_the_first_entry_of_each_queued_voxel(entries, queued):
    queue = new_queue(ENTRIES)
    clear_queue(queue)
    for bucket, voxel in entries:
        push(queue, bucket, voxel)
    mark = np.array([0b1011 if voxel in queued else 0b1001 for voxel in range(31)], np.uint32)
    before = mark.copy()
    compact(queue, mark, 2)
    np.testing.assert_array_equal(mark, before)
    first = {voxel: min(b for b, v in entries if v == voxel) for _, voxel in entries if voxel in queued}
    assert sorted(emptied(queue)) == sorted((bucket, voxel) for voxel, bucket in first.items())


def test_compacting_works_with_one_spare_block():
    queue = new_queue(ENTRIES)
    queue = queue._replace(blocks=queue.blocks[:12])
    clear_queue(queue)
    count = 0
    while not queue_full(queue):
        push(queue, count % 2, count % 150)
        count += 1
    mark = np.ones(150, np.uint32)
    compact(queue, mark, 1)
    assert sorted(voxel for _, voxel in emptied(queue)) == list(range(min(count, 150)))
