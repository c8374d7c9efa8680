"""Maps shared as summaries: when, what, how many bits, and that nothing comes twice."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from entropy_explore_env.belief.entropy import map_entropy_bits
from entropy_explore_env.belief.pooling import Pool, fresh_sums, pool_belief
from entropy_explore_env.missions.simulation import Missions
from entropy_explore_env.missions.summaries import precision_of_place
from entropy_explore_env.robots.localization import pack_covariance
from entropy_explore_env.robots.map_summary import decode_map, encode_map, is_summary
from tests.reference.scenes import drawn, free_box, random_actions, robots_of, seeds, started, wander

QUIET = {"announcements": False}
SUMMARIES = {"content": "summaries", "summary_every_s": 2.0}
DRIFT = {"xy_m_per_sqrt_m": 0.1, "z_m_per_sqrt_m": 0.05, "yaw_rad_per_sqrt_m": 0.05}
FAULTS = {
    "radio": {"garbled": 0.1, "repeated": 0.3, "late": 0.4, "late_s": 5.0},
    "silent": {"at_s": 20.0, "lasts_s": 9.0, "robots": (1,)},
}
WORLD = {"world": "furnished", "robots": 3, "track_truth": True}


def played(steps=60, seed=1, count=1, threads=1, **changes):
    """Missions of random actions over a channel of summaries."""
    channel = {**SUMMARIES, **changes.pop("channel", {})}
    scenario = free_box(**{**WORLD, **changes}, channel=channel)
    missions = Missions(scenario, count, threads=threads)
    missions.reset_some(range(count), [seed + mission for mission in range(count)])
    wander(missions, steps, seed)
    return missions


def fused(missions, robot, said):
    """(mean, precision) of a robot's belief and a summary, by eqs. 17-18 of Rocha04 in float64."""
    mean, precision = (array[0, robot].astype(float) for array in (missions.mean, missions.precision))
    total = precision + said.precision
    return (mean * precision + said.mean * said.precision.astype(float)) / total, total


@pytest.mark.parametrize(
    ("threshold", "drift"), [(0.0, None), (0.5, None), (5.0, None), (0.5, DRIFT), (0.0, DRIFT)]
)
def test_a_robot_sends_what_it_measured_itself_as_encode_map_writes_it(threshold, drift):
    """The same mission twice, once without sending: until the first summary they are the same."""
    every = {"summary_every_s": 8.0, "summary_threshold_bits": threshold, **QUIET}
    world = {**WORLD, "robot": {"localization": drift} if drift else {}}
    sending = started(free_box(**world, channel={**SUMMARIES, **every}), 4)
    waiting = started(free_box(**world, channel={**SUMMARIES, **every, "summary_every_s": 3600.0}), 4)
    rng = np.random.default_rng(2)
    while not robots_of(sending, "bits_sent").any():
        actions = random_actions(sending, rng)
        sending.step(*actions)
        waiting.step(*actions)
    (sender,) = np.flatnonzero(robots_of(sending, "bits_sent"))
    assert 8.0 <= sending.state.missions[0]["time_s"] < 12.0
    shape, state = sending.grid.shape, waiting.state
    own = [array[0, sender].reshape(shape) for array in (state.own_mean, state.own_precision)]
    data, bits = encode_map(*own, threshold), 160 + (320 if drift else 0)
    assert robots_of(sending, "bits_sent")[sender] == bits + 8 * len(data)
    said = decode_map(data, shape)
    assert (said.precision > 0.0).any()
    if drift:
        most = precision_of_place(state.estimates[0, sender]["packed"], 0.5)
        assert (said.precision > most).any()  # the pose's error is common to all that a summary says
        said = said._replace(precision=np.minimum(said.precision, np.float32(most)))
    for mate in set(range(3)) - {sender}:
        mean, precision = fused(waiting, mate, said)
        np.testing.assert_allclose(sending.precision[0, mate], precision, rtol=1e-6)
        np.testing.assert_allclose(sending.mean[0, mate], mean, atol=1e-6)
        assert robots_of(sending, "bits_received")[mate] == bits + 8 * len(data)
        gained = robots_of(waiting, "entropy_bits")[mate] - robots_of(sending, "entropy_bits")[mate]
        assert gained > 0.0 and robots_of(sending, "heard_bits")[mate] == pytest.approx(gained)
    assert not sending.state.own_precision[0, sender].any()
    assert sending.state.summaries[0, sender]["high"].tolist() == [0, 0, 0]


def test_an_own_map_is_the_belief_without_the_prior_and_without_what_was_heard():
    missions = played(channel={**QUIET, "summary_every_s": 3600.0})
    state, prior = missions.state, np.float64(missions.rules.params["prior_precision"][0])
    own, known = state.own_precision[0].astype(float), state.precision[0].astype(float)
    measured = own > 0.0
    assert measured.any() and not measured.all()
    np.testing.assert_allclose(known[measured], own[measured] + prior, rtol=1e-4)
    np.testing.assert_allclose(known[~measured], prior, rtol=1e-6)
    mean = (state.own_mean[0] * own + 0.5 * prior) / (own + prior)
    np.testing.assert_allclose(state.mean[0][measured], mean[measured], atol=1e-4)
    for robot in range(3):
        places = np.argwhere(measured[robot].reshape(missions.grid.shape))
        kept = state.summaries[0, robot]
        assert kept["low"].tolist() == places.min(axis=0).tolist()
        assert kept["high"].tolist() == (places.max(axis=0) + 1).tolist()


@drawn(40)
@given(
    seeds,
    st.integers(2, 3),
    st.fixed_dictionaries(
        {
            "summary_every_s": st.sampled_from([0.0, 1.0, 4.0]),
            "summary_threshold_bits": st.sampled_from([0.0, 0.5, 5.0]),
            "loss_probability": st.sampled_from([0.0, 0.4]),
            "delay_s": st.sampled_from([0.0, 0.5, 3.0]),
        }
    ),
    st.sampled_from([({}, None), (FAULTS, None), ({}, DRIFT)]),
    st.sampled_from([{}, {"grid": {"shape": (9, 14, 1)}}]),
)
def test_no_measurement_comes_twice_and_none_more_precise_than_it_was(
    seed, robots, channel, faults_and_drift, grid
):
    """No robot's map is anywhere more precise than the joint map, which holds each measurement once."""
    faults, drift = faults_and_drift
    missions = played(
        50,
        seed % 1000,
        robots=robots,
        robot={"localization": drift} if drift else {},
        fiducials={"number": 3} if drift else {},
        faults=faults,
        channel={**QUIET, **channel},
        **grid,
    )
    state, prior = missions.state, np.float64(missions.rules.params["prior_precision"][0])
    known, joint = state.precision[0].astype(float), state.joint_precision[0].astype(float)
    measured = joint > prior * (1.0 + 1e-6)
    assert (known <= joint * (1.0 + 1e-4)).all()
    assert (known[:, ~measured] <= prior * (1.0 + 1e-6)).all()
    own = robots_of(missions, "gained_bits") + robots_of(missions, "heard_bits")
    carried, start = robots_of(missions, "entropy_bits"), state.missions[0]["entropy_start_bits"]
    np.testing.assert_allclose(carried, map_entropy_bits(missions.precision[0]), rtol=1e-5)
    np.testing.assert_allclose(carried + own, start, rtol=1e-5)
    if not channel["loss_probability"] and not faults:
        assert robots_of(missions, "messages_received").min() > 1
        assert robots_of(missions, "heard_bits").min() > 0.0


def test_summaries_bring_nearly_all_that_teammates_measured():
    missions = played(120, channel={"summary_every_s": 0.0, "summary_threshold_bits": 0.0})
    state, prior = missions.state, np.float64(missions.rules.params["prior_precision"][0])
    joint, known = state.joint_precision[0].astype(float), state.precision[0].astype(float)
    measured = joint > 2.0 * prior
    shares = (known - prior)[:, measured] / (joint - prior)[measured]
    assert shares.mean() > 0.9  # a leaf is as precise as its least known voxel
    assert (known[:, ~measured] <= 2.0 * prior).all()


def test_the_pooled_belief_follows_what_summaries_say():
    missions = played(observation={"overview": True, "overview_shape": (3, 4, 2)})
    params, cells = missions.rules.params[0], missions.rules.cells
    for robot in range(3):
        sums = fresh_sums(cells)
        pool = Pool(cells, sums, float(params["prior_precision"]), float(params["end_precision"]))
        pool_belief(pool, missions.state.mean[0, robot], missions.state.precision[0, robot])
        np.testing.assert_allclose(missions.state.pooled[0, robot], sums, atol=1e-6)


def test_summaries_wait_for_their_time_and_for_a_scan():
    missions = started(free_box(**WORLD, channel={**SUMMARIES, **QUIET, "summary_every_s": 4.0}), 2)
    sent = [[] for _ in range(3)]

    def note(_):
        for robot, kept in enumerate(missions.state.summaries[0]):
            if kept["sent"] > len(sent[robot]):
                sent[robot].append(float(kept["sent_s"]))
                assert kept["sent_s"] <= missions.state.missions[0]["time_s"]

    wander(missions, 150, 3, note)
    for robot in range(3):
        assert len(sent[robot]) > 4 and sent[robot][0] >= 4.0
        assert (np.diff(sent[robot]) >= 4.0).all() and np.diff(sent[robot]).min() < 8.0
        assert robots_of(missions, "messages_sent")[robot] == len(sent[robot])
    assert not robots_of(missions, "measurements_sent").any()


def test_a_delayed_summary_holds_what_was_measured_before_it_was_sent():
    """Whatever the delay, in the end all hold the same, but for what is still under way."""
    at_once = played(60, channel={**QUIET, "delay_s": 0.0})
    late = played(60, channel={**QUIET, "delay_s": 1.7})
    under_way = late.state.in_flight_parcels[0]["bytes"] > 0
    assert (np.isfinite(late.state.in_flight[0]["due_s"]) == under_way).all()
    assert robots_of(late, "bits_sent").sum() == pytest.approx(robots_of(at_once, "bits_sent").sum(), rel=0.1)
    received = robots_of(late, "bits_received").sum() + 2 * (
        8 * late.state.in_flight_parcels[0]["bytes"].sum() + 160 * under_way.sum()
    )
    assert received == 2 * robots_of(late, "bits_sent").sum()


def test_no_two_summaries_under_way_have_one_place():
    late = {"radio": {"late": 0.5, "late_s": 4.0}}
    channel = {**SUMMARIES, **QUIET, "summary_every_s": 0.0, "delay_s": 3.0}
    missions = started(free_box(**WORLD, channel=channel, faults=late), 6)
    most = []

    def note(_):
        parcels = missions.state.in_flight_parcels[0]
        live = parcels["place"][parcels["bytes"] > 0].tolist()
        assert len(set(live)) == len(live)
        most.append(len(live))
        for place in live:
            length = int(parcels["bytes"][parcels["place"] == place].max())
            assert is_summary(
                missions.state.in_flight_summaries[0, place, :length].tobytes(), missions.grid.shape
            )

    wander(missions, 80, 6, note)
    assert max(most) > 8


def test_a_place_is_known_as_well_as_its_covariance_says():
    packed = np.zeros(10)
    assert math.isinf(precision_of_place(packed, 0.5))
    pack_covariance(np.diag([0.04, 0.01, 0.0, 9.0]), packed)
    assert precision_of_place(packed, 0.5) == pytest.approx(0.25 / 0.05)  # the yaw is no part of it
