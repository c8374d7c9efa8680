"""Figures that are carried along equal those of the whole map, and nobody acts on them."""

from __future__ import annotations

import numpy as np
import pytest

from entropy_explore_env.belief.entropy import map_entropy_bits
from entropy_explore_env.missions.simulation import Missions
from entropy_explore_env.missions.state import PROGRESS
from entropy_explore_env.reports.metrics import joint_figures
from tests.reference.scenes import free_box, random_actions, started, wander

NOISY = {"sensor": {"range_noise_m": 0.2, "max_range_m": 2.0}, "channel": {"loss_probability": 0.4}}


@pytest.mark.parametrize("settings", [{}, NOISY, {"world": "furnished"}], ids=["box", "noisy", "furnished"])
def test_the_joint_map_is_scored_as_if_it_were_looked_at_whole(settings):
    missions = started(free_box(track_truth=True, **settings), seed=4)
    clock, state = missions.state.missions[0], missions.state
    assert (clock["explored"], clock["error"], clock["wrong"]) == (0, 0.0, 0)
    for step in range(5):
        wander(missions, 12, step)
        mean, precision, truth = state.joint_mean[0], state.joint_precision[0], state.truth[0]
        measured = precision > missions.rules.params[0]["prior_precision"]
        whole = map_entropy_bits(precision.reshape(1, *missions.grid.shape))[0]
        assert clock["joint_bits"] == pytest.approx(whole, rel=1e-6)
        assert clock["explored"] == measured.sum() > 0
        assert clock["explored_visible"] == (measured & state.visible[0]).sum()
        assert clock["error"] == pytest.approx(np.abs(mean - truth)[measured].sum(dtype=np.float64), rel=1e-6)
        assert clock["wrong"] == ((mean > 0.5) != (truth > 0.5))[measured].sum()
    figures = joint_figures(missions, 0)
    assert 0.0 < (figures["explored"] or 0.0) <= 1.0
    assert figures["entropy_bits"] == clock["joint_bits"]


def test_the_joint_map_knows_what_all_robots_measured_and_no_more():
    """Without a channel it is the product of all robots' maps, one prior counted once."""
    missions = started(free_box(track_truth=True, channel={"burst": 0}), seed=2)
    wander(missions, 30, 0)
    state, prior = missions.state, missions.rules.params[0]["prior_precision"]
    together = state.precision[0].astype(np.float64).sum(axis=0) - (missions.scenario.robots - 1) * prior
    np.testing.assert_allclose(state.joint_precision[0], together, rtol=1e-5)
    assert clock_bits(missions) <= state.robots[0]["entropy_bits"].min()


def clock_bits(missions: Missions) -> float:
    return float(missions.state.missions[0]["joint_bits"])


def test_nobody_acts_on_the_score():
    plain, scored = (started(free_box(track_truth=flag), seed=3) for flag in (False, True))
    for missions in (plain, scored):
        wander(missions, 40, 1)
    assert plain.state.joint_mean.shape == plain.state.visible.shape == (1, 0)
    np.testing.assert_array_equal(plain.state.mean, scored.state.mean)
    np.testing.assert_array_equal(plain.observations, scored.observations)
    for field in ("entropy_bits", "gained_bits", "heard_bits", "redundant", "goal"):
        np.testing.assert_array_equal(plain.state.robots[field], scored.state.robots[field])


def test_times_on_the_way_are_those_of_the_best_map():
    missions = started(free_box(ending={"sigma_end": 2.0}), seed=5)
    clock, robots = missions.state.missions[0], missions.state.robots[0]
    asked = clock["entropy_start_bits"] - clock["entropy_end_bits"]
    expected, rng = [-1.0] * len(PROGRESS), np.random.default_rng(0)
    assert clock["reached_s"].tolist() == expected
    for _ in range(2000):
        missions.step(*random_actions(missions, rng))
        share = (clock["entropy_start_bits"] - robots["entropy_bits"].min()) / asked
        for mark, least in enumerate(PROGRESS):
            if expected[mark] < 0.0 and share >= least:
                expected[mark] = float(clock["time_s"])
        if clock["end"]:
            break
    assert clock["reached_s"].tolist() == expected
    assert 0.0 < expected[0] < expected[1] < expected[2] <= expected[3] == clock["time_s"]


def test_bits_gained_and_heard_add_up_to_what_the_map_lost():
    missions = started(free_box(channel={"i_min_bits": 0.5}), seed=1)
    wander(missions, 50, 2)
    robots, clock = missions.state.robots[0], missions.state.missions[0]
    lost = clock["entropy_start_bits"] - robots["entropy_bits"]
    np.testing.assert_allclose(robots["gained_bits"] + robots["heard_bits"], lost, rtol=0, atol=1e-6)
    assert (robots["heard_bits"] > 0.0).all()
    assert (robots["redundant"] > 0).all() and (robots["redundant"] <= robots["measurements"]).all()
