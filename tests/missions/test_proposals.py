"""Candidates as state: saved, restored, pickled, batched, replayed and seen through views."""

import math

import numpy as np
import pytest

from entropy_explore_env.errors import ActionError
from entropy_explore_env.missions.view import view_of
from entropy_explore_env.missions.view_candidates import ViewProposer
from entropy_explore_env.missions.view_observation import ViewObserver
from entropy_explore_env.planner.candidate_features import COLUMNS, CONTEXT, FEATURES
from entropy_explore_env.planner.records import Kind
from entropy_explore_env.randomness import Stream, splitmix_states
from entropy_explore_env.reports.state_digest import state_digest
from entropy_explore_env.settings.action import Action
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.observation import Observation
from tests.reference.scenes import free_box, started, wander

MOST = 9
ACTION = Action("candidates", candidates=MOST)
SEEN = Observation(panorama=False, action_mask=True, overlaps=True)


def walked(steps=8, seed=1, missions=2, **changes):
    these = started(free_box(**{"action": ACTION, "observation": SEEN, **changes}), seed, missions)
    wander(these, steps, seed)
    return these


def test_numbers_beyond_the_candidates_are_refused():
    missions = walked()
    before = state_digest(missions, 0), missions.observations.tobytes()
    for number in (-1, MOST):
        with pytest.raises(ActionError, match=f"from 0 to {MOST - 1}"):
            missions.step(np.zeros((2, 2, 1)), np.full((2, 2), number))
    assert (state_digest(missions, 0), missions.observations.tobytes()) == before


def test_views_hold_the_candidates_and_write_them_as_actions():
    missions = walked()
    deciding = np.argwhere(missions.state.robots["deciding"])
    assert len(deciding) and len(deciding) < 4
    for mission, robot in np.ndindex(2, 2):
        view = view_of(missions, mission, robot)
        if not view.deciding:
            assert view.candidates.shape == (0, 5)
            continue
        kinds = missions.state.candidates[mission, robot]["kind"]
        assert len(view.candidates) == (kinds != Kind.NONE).sum() > 1
        for number, viewpoint in enumerate(view.candidates):
            nudged = viewpoint + np.array([1e-4, 0, 0, 2.0 * math.pi, 0])
            assert view.action_for(viewpoint) == view.action_for(nudged) == number
        with pytest.raises(ValueError, match="read-only"):
            view.candidates[0] = 0.0


@pytest.mark.parametrize("drift", [0.0, 0.1])
def test_a_view_is_proposed_what_a_mission_is(drift):
    """From the same random state the same candidates and features, bitwise."""
    robot = {"localization": {"xy_m_per_sqrt_m": drift, "yaw_rad_per_sqrt_rad": drift}}
    fresh = started(free_box(action=ACTION, observation=SEEN, robot=robot), 5)
    proposer = ViewProposer(fresh.scenario, np.random.default_rng(0), overlaps=True)
    proposer._experience["candidates_rng"][:, 0] = splitmix_states(5, 0, Stream.CANDIDATES, 2)
    for _ in range(12):
        for robot in range(2):
            view = view_of(fresh, 0, robot)
            if view.deciding:
                proposed = proposer.propose(view)
                np.testing.assert_array_equal(proposed, view.candidates)
                np.testing.assert_array_equal(proposer.propose(view), proposed)  # asked again, the same
                parts = fresh.layout.split(fresh.observations[0, robot])
                np.testing.assert_array_equal(proposer.features(robot), parts["candidates"])
                np.testing.assert_array_equal(proposer.context(robot), parts["context"])
                np.testing.assert_array_equal(proposer.overlaps(robot), parts["overlaps"])
                variance, covariance = proposer._proposers[0].refined.pose_variance, view.covariance
                assert variance[0] == pytest.approx(np.trace(covariance[:3, :3]) / 0.5**2)
                assert variance[1] == covariance[3, 3]
        wander(fresh, 1, 7)
    assert bool(np.any(variance > 0.0)) == (drift > 0.0)


def test_a_policy_observes_and_acts_through_views_of_other_actions():
    missions = started(free_box(), 2)
    observer = ViewObserver(missions.scenario, SEEN, ACTION, np.random.default_rng(4))
    view = view_of(missions, 0, 1)
    parts = observer.layout.split(observer.observe(view))
    assert parts["candidates"].shape == (MOST, len(FEATURES)) and parts["context"].shape == (len(CONTEXT),)
    there = parts["candidates"].any(axis=1)
    np.testing.assert_array_equal(parts["action_mask"], there)
    first, none = observer.viewpoint(view, 0), observer.viewpoint(view, MOST - 1)
    assert np.linalg.norm(first[:3] - view.pose[:3]) <= view.kind.robot.reach_m * (1 + 1e-9)
    assert there[MOST - 1] or (none == first).all()


def test_who_drives_on_has_the_viewpoint_to_which_it_drives_among_its_candidates():
    settings = {"robot": {"redecide": 0.4, "navigator": "planned"}, "decision_period_s": None}
    missions = walked(0, 3, 1, **settings)
    rng, under_way = np.random.default_rng(1), 0
    for _ in range(40):
        robots = missions.state.robots[0]
        for robot in np.flatnonzero(robots["deciding"] & robots["under_way"]):
            view = view_of(missions, 0, int(robot))
            apart = np.abs(view.candidates - view.target).max(axis=1)
            number = int(np.argmin(apart))
            assert apart[number] < 1e-6
            kept = missions.layout.split(missions.observations[0, robot])["candidates"][number]
            assert kept[COLUMNS["kept"]] == 1.0
            under_way += 1
        missions.step(np.zeros((1, 2, 1)), rng.integers(0, MOST, (1, 2)))
    assert under_way > 3


def test_candidates_are_described_where_their_parts_lie_and_what_a_scan_brought_is_remembered():
    """A plan of 5 × 7 voxels: a viewpoint of which a million bits were expected brings a few."""
    sensor = {"field_of_view_rad": (1.0, 0.0), "angular_step_rad": 0.5}
    settings = {"grid": Grid((5, 7, 1), 0.5), "robots": 1, "sensor": sensor}
    missions = walked(0, 0, 1, **{**settings, "action": Action("candidates", candidates=2)})
    parts = missions.layout.split(missions.observations[0, 0])
    own, candidates = missions.state.experience[0, 0], missions.state.candidates[0, 0]
    there = candidates["kind"] != Kind.NONE
    assert there[0] and (parts["action_mask"] == there).all() and parts["context"].any()
    assert ((parts["candidates"][:, 0] > 0.0) == there).all()
    assert (np.diag(parts["overlaps"]) == there).all()
    candidates["bits"] = 1e6
    missions.step(np.zeros((1, 1, 1)), np.zeros((1, 1), np.int64))
    came = missions.state.scan_utility_bits[0, 0].sum()
    assert came > 1.0 and own["failures"] == 1
    assert own["share"][0] == pytest.approx(came / 1e6, rel=1e-6)


def test_where_actions_are_others_nothing_of_it_is_called(monkeypatch):
    def refuse(*_):
        raise AssertionError("proposed")

    monkeypatch.setattr("entropy_explore_env.missions.compiled_step.propose_missions", refuse)
    wander(started(with_settings(free_box(), {"action": {"kind": "discrete"}})), 2, 0)
    with pytest.raises(AssertionError, match="proposed"):
        started(free_box(action=ACTION))
