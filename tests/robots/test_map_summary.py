"""Summaries of maps: what comes back, how much more than nothing, and what is refused."""

import math
import zlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from entropy_explore_env.errors import RecordError, SettingError
from entropy_explore_env.robots.map_summary import (
    decode_map,
    encode_map,
    new_summary_tree,
    summary_bytes,
    tree_bits,
    write_summary,
)
from entropy_explore_env.robots.map_tree import begin_walk, new_tree, write_tree
from entropy_explore_env.robots.range_coder import begin_writing, end_writing
from tests.reference.scenes import drawn, seeds

SIZES = [(7, 11, 5), (13, 6, 1), (1, 1, 1), (1, 9, 2)]


def drawn_map(shape, seed):
    """A map in patches: coverages 0, 1 and between, some voxels never measured."""
    rng = np.random.default_rng(seed)
    patches = rng.integers(0, 4, tuple(-(-n // 3) for n in shape))
    for axis in range(3):
        patches = np.repeat(patches, 3, axis)
    patches = patches[: shape[0], : shape[1], : shape[2]]
    mean = np.select([patches == 0, patches == 1], [0.0, 1.0], rng.random(shape)).astype(np.float32)
    precision = np.where(patches == 3, 0.0, 10.0 ** rng.uniform(-3, 5, shape)).astype(np.float32)
    return mean, precision


def textbook(mean, precision, threshold, region, leaves):
    """The same tree by recursion: fills `leaves` with the voxels and the variance of each, in order."""
    voxels = [tuple(v) for v in np.argwhere(np.ones([high - low for low, high in region]))]
    voxels = [tuple(low + o for (low, _), o in zip(region, v, strict=True)) for v in voxels]
    known = [precision[v] > 0.0 and 1.0 / precision[v] <= (2.0**-10 * 2.0 ** (255 / 16)) ** 2 for v in voxels]
    if not any(known):
        return
    levels = np.bincount([min(int(mean[v] * 32), 31) for v in voxels], minlength=32) / len(voxels)
    bits = -sum(q * math.log2(q) for q in levels if q > 0)
    if all(known) and (len(voxels) == 1 or bits <= threshold):
        leaves.append(voxels)
        return
    halves = []
    for low, high in region:
        middle = low + (high - low + 1) // 2
        halves.append([(low, middle), (middle, high)] if middle < high else [(low, high)])
    for x in halves[0]:
        for y in halves[1]:
            for z in halves[2]:
                textbook(mean, precision, threshold, (x, y, z), leaves)


@drawn(60)
@given(st.sampled_from(SIZES), seeds, st.sampled_from([0.0, 0.5, 1.5, 5.0]))
def test_what_comes_back_is_what_the_leaves_of_the_textbook_say(shape, seed, threshold):
    mean, precision = drawn_map(shape, seed)
    leaves = []
    textbook(mean, precision, threshold, tuple((0, n) for n in shape), leaves)
    data = encode_map(mean, precision, threshold)
    nodes, rest = divmod(tree_bits(data, shape) - 16 * len(leaves), 2)
    assert rest == 0 and max(len(leaves), 1) <= nodes < 2 * mean.size
    assert len(data) <= summary_bytes(mean.size)
    summary = decode_map(data, shape)
    said = np.zeros(shape, bool)
    for voxels in leaves:
        at = tuple(np.array(voxels).T)
        said[at] = True
        assert len(set(summary.mean[at])) == len(set(summary.precision[at])) == 1
        centre = mean[at].astype(np.float64).mean()
        assert abs(summary.mean[at][0] - centre) <= 0.5 / 255 + 1e-6
        spread = ((mean[at].astype(np.float64) - summary.mean[at][0]) ** 2).mean()
        variance = 1.0 / np.float64(precision[at].min()) + spread
        sigma = max(math.sqrt(variance), 2.0**-10)
        assert (
            sigma * (1 - 1e-5)
            <= 1.0 / math.sqrt(summary.precision[at][0])
            <= sigma * 2.0 ** (1 / 16) * (1 + 1e-5)
        )
    assert (summary.precision[~said] == 0.0).all() and (summary.mean[~said] == 0.5).all()
    assert (summary.precision <= precision).all()  # never more than the sender had


def test_what_is_alike_takes_few_bits_and_what_is_noise_takes_many():
    rng = np.random.default_rng(3)
    known = np.full((200, 160, 1), 400.0, np.float32)
    noise = rng.random(known.shape).astype(np.float32)
    plan = np.zeros(known.shape, np.float32)
    plan[40:42], plan[:, 90:91] = 1.0, 1.0
    sizes = [8 * len(encode_map(m, known, 0.5)) for m in (np.zeros_like(noise), plan, noise)]
    assert sizes[0] < 400 and sizes[1] < 20_000 and sizes[2] > 200_000
    thresholds = [8 * len(encode_map(plan, known, bits)) for bits in (0.0, 0.2, 0.5, 5.0)]
    assert thresholds == sorted(thresholds, reverse=True) and thresholds[0] > thresholds[-1]


@drawn(200)
@given(seeds, st.data())
def test_broken_summaries_are_refused_by_name(seed, data):
    mean, precision = drawn_map((7, 11, 5), seed)
    whole = encode_map(mean, precision, 0.5)
    kind = data.draw(st.sampled_from(["cut", "longer", "bit", "foreign"]))
    if kind == "cut":
        broken = whole[: data.draw(st.integers(0, len(whole) - 1))]
    elif kind == "longer":
        broken = whole + b"x"
    elif kind == "bit":
        at = data.draw(st.integers(0, len(whole) - 1))
        broken = whole[:at] + bytes([whole[at] ^ (1 << data.draw(st.integers(0, 7)))]) + whole[at + 1 :]
    else:
        broken = data.draw(st.binary(max_size=80))
    try:
        found = decode_map(broken, (7, 11, 5))
    except RecordError as error:
        assert "7 × 11 × 5" in str(error)
    else:
        raise AssertionError(found)


def test_a_summary_of_another_map_and_bad_input_are_named():
    mean, precision = drawn_map((7, 11, 5), 1)
    whole = encode_map(mean, precision, 0.5)
    for shape in [(7, 11, 4), (11, 7, 5), (1, 1, 1)]:
        with pytest.raises(RecordError, match="map summary"):
            decode_map(whole, shape)
    with pytest.raises(RecordError):
        decode_map("text", (7, 11, 5))  # type: ignore[arg-type]
    with pytest.raises(SettingError, match="threshold_bits"):
        encode_map(mean, precision, math.nan)
    with pytest.raises(SettingError, match="precision"):
        encode_map(mean, -precision - 1.0, 0.5)
    with pytest.raises(SettingError, match=r"precision.*float32"):
        encode_map(mean, precision.astype(float) + 1e300, 0.5)
    with pytest.raises(SettingError, match="coverages from 0 to 1"):
        encode_map(mean + 2.0, precision, 0.5)
    with pytest.raises(SettingError, match=r"precision.*\(7, 11, 5\)"):
        encode_map(mean, precision[:3], 0.5)


def test_the_checksum_is_that_of_zlib():
    mean, precision = drawn_map((7, 11, 5), 2)
    data = encode_map(mean, precision, 0.5)
    shape = b"".join(n.to_bytes(4, "little") for n in (7, 11, 5))
    assert int.from_bytes(data[2:6], "little") == zlib.crc32(shape + data[1:2] + data[6:])


def test_where_learning_would_take_more_room_than_there_is_all_decisions_count_alike():
    shape, corner, found = (2, 2, 1), (0, 0, 0), 0
    for seed in range(200):
        rng = np.random.default_rng(seed)
        mean = rng.choice([0.0, 1.0, rng.random()], 4).astype(np.float32)
        precision = np.where(rng.random(4) < 0.4, 0.0, 10.0 ** rng.uniform(-3, 5, 4)).astype(np.float32)
        lengths = []
        for flat in (False, True):
            tree = new_summary_tree(4)
            begin_writing(tree.coder, 6, flat)
            begin_walk(tree, shape, corner, shape)
            write_tree(tree, mean, precision, 0.0)
            lengths.append(end_writing(tree.coder, 6))
        if lengths[1] < lengths[0]:
            found += 1
            tree = new_tree(np.zeros(lengths[1], np.uint8), 4)
            length = write_summary(tree, mean, precision, shape, corner, shape, 0.0)
            flat_data = tree.coder.data[:length].tobytes()
            learned = encode_map(mean.reshape(shape), precision.reshape(shape), 0.0)
            assert length == lengths[1] and len(learned) == lengths[0] and flat_data[1] != learned[1]
            for one, other in zip(decode_map(flat_data, shape), decode_map(learned, shape), strict=True):
                np.testing.assert_array_equal(one, other)
    assert found > 5


def test_a_map_that_cannot_be_foreseen_is_never_longer_than_its_bound():
    """Voxels whose coverage and σ were chosen so that what contexts have learned misleads them."""
    shape = (23, 16, 1)
    rng = np.random.default_rng(5)
    longest = 0
    for run in (1, 2, 7, 30):
        number = np.arange(23 * 16).reshape(shape)
        flips = ((number // run) % 2 == 0) ^ (rng.random(shape) < 0.02)
        mean = np.where(flips, rng.random(shape), 1.0 - rng.random(shape)).astype(np.float32)
        precision = (10.0 ** rng.uniform(-3, 5, shape)).astype(np.float32)
        data = encode_map(mean, precision, 0.0)
        longest = max(longest, len(data))
        summary = decode_map(data, shape)
        np.testing.assert_allclose(summary.mean, mean, atol=1 / 32 + 1 / 255)
        assert (summary.precision <= precision).all()
    assert 23 * 16 < longest <= summary_bytes(23 * 16)


@drawn(100)
@given(seeds)
def test_only_the_box_is_looked_at_and_the_bytes_do_not_depend_on_it(seed):
    rng = np.random.default_rng(seed)
    shape = SIZES[int(rng.integers(len(SIZES)))]
    mean, precision = drawn_map(shape, seed)
    low = tuple(int(rng.integers(0, n)) for n in shape)
    high = tuple(int(rng.integers(a + 1, n + 1)) for a, n in zip(low, shape, strict=True))
    inside = np.zeros(shape, bool)
    inside[tuple(slice(a, b) for a, b in zip(low, high, strict=True))] = True
    tree = new_summary_tree(mean.size)
    tree.levels[:] = 7
    length = write_summary(tree, mean.ravel(), precision.ravel(), shape, low, high, 0.5)
    boxed = np.where(inside, precision, np.float32(0.0))
    assert tree.coder.data[:length].tobytes() == encode_map(mean, boxed, 0.5)
