"""Random draws: their numbers, and that every kind of draw has a stream of its own."""

import itertools
import math

import numpy as np
import pytest

from entropy_explore_env.errors import SettingError
from entropy_explore_env.randomness import (
    Stream,
    check_seed,
    draw_gaussian,
    draw_uniform,
    generator,
    splitmix_states,
)
from tests.reference.scenes import free_box, random_actions, started

MANY = 20_000


def uniform(seed, count=MANY):
    state = np.array([seed], np.uint64)
    return np.array([draw_uniform(state) for _ in range(count)])


def test_uniform_numbers_are_those_of_splitmix64():
    """Published outputs for the seed 1234567, their upper 53 bits as shares of 1."""
    published = [
        6457827717110365317,
        3203168211198807973,
        9817491932198370423,
        4593380528125082431,
        16408922859458223821,
    ]
    assert uniform(1234567, 5).tolist() == [(number >> 11) / 2**53 for number in published]


def test_gaussian_numbers_are_standard_normal():
    state = np.array([7], np.uint64)
    numbers = np.array([draw_gaussian(state) for _ in range(MANY)])
    assert np.isfinite(numbers).all()
    assert abs(numbers.mean()) < 4 / math.sqrt(MANY)
    assert abs(numbers.std() - 1.0) < 0.02
    assert abs((np.abs(numbers) < 1.0).mean() - 0.6827) < 0.015


def test_streams_are_independent_of_each_other():
    """Of other kinds, robots, seeds and episodes."""
    states = [
        int(state)
        for seed, episode, stream in itertools.product((0, 1), (0, 1), Stream)
        for state in splitmix_states(seed, episode, stream, 3)
    ]
    assert len(set(states)) == len(states)
    numbers = np.array([uniform(state, 1500) for state in states[:10]])
    apart = np.corrcoef(numbers)[np.triu_indices(10, 1)]
    assert np.abs(apart).max() < 0.12


def test_a_robot_s_stream_does_not_depend_on_the_size_of_the_team():
    one, four = (splitmix_states(5, 2, Stream.SENSOR, robots) for robots in (1, 4))
    assert one[0] == four[0]


def test_generators_repeat_by_seed_and_episode():
    first = generator(3, 1, Stream.WORLD).random(4)
    assert (generator(3, 1, Stream.WORLD).random(4) == first).all()
    for other in ((4, 1, Stream.WORLD), (3, 2, Stream.WORLD), (3, 1, Stream.STARTS)):
        assert (generator(*other).random(4) != first).all()


@pytest.mark.parametrize("seed", [-1, 1.0, "1", True, math.nan, [1]])
def test_a_seed_that_is_no_whole_number_is_refused(seed):
    with pytest.raises(SettingError) as raised:
        check_seed(seed)
    assert str(raised.value) == f"seed = {seed!r}: expected a whole number ≥ 0, or None"


def test_seeds():
    assert check_seed(3) == check_seed(np.int32(3)) == 3
    assert check_seed(2**64) == 2**64
    assert check_seed(None) != check_seed(None)


def traces(missions, steps):
    """World, starts and all distances measured in a mission of given random actions."""
    rng, told = np.random.default_rng(0), [missions.state.truth.copy(), missions.state.robots["goal"].copy()]
    for _ in range(steps):
        missions.step(*random_actions(missions, rng))
        told.append(missions.state.scan_range_m.copy())
    return told


@pytest.mark.parametrize(
    "channel",
    [{"loss_probability": 0.5}, {"range_m": 1.0}, {"delay_s": 0.8}, {"burst": 0}, {"announcements": False}],
)
def test_the_channel_changes_neither_world_nor_starts_nor_range_noise(channel):
    noisy = {"world": "furnished", "robots": 3, "sensor": {"range_noise_m": 0.05}}
    plain = traces(started(free_box(**noisy), seed=4), 25)
    changed = traces(started(free_box(**noisy, channel=channel), seed=4), 25)
    for one, other in zip(plain, changed, strict=True):
        np.testing.assert_array_equal(one, other)


def test_range_noise_changes_neither_world_nor_starts_nor_loss():
    lossy = {"world": "furnished", "robots": 3, "channel": {"loss_probability": 0.4, "i_min_bits": 0.0}}
    plain = started(free_box(**lossy), seed=4)
    noisy = started(free_box(**lossy, sensor={"range_noise_m": 0.05}), seed=4)
    told = [traces(missions, 25)[:2] for missions in (plain, noisy)]
    for one, other in zip(*told, strict=True):
        np.testing.assert_array_equal(one, other)
    both = [missions.state.robots[0] for missions in (plain, noisy)]
    # As many messages were sent (whatever they are worth), so the same ones were lost.
    assert (both[0]["messages_sent"] == both[1]["messages_sent"]).all()
    assert (both[0]["messages_lost"] == both[1]["messages_lost"]).all()
    assert (both[0]["channel_rng"] == both[1]["channel_rng"]).all()
    assert (both[0]["sensor_rng"] != both[1]["sensor_rng"]).all()
