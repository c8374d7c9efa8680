"""What a robot learns from how its drives ended and what its scans brought, computed by hand."""

import numpy as np
import pytest

from entropy_explore_env.planner.memory import chosen_number, learn, trust_in, weigh_time
from entropy_explore_env.planner.model import new_proposers
from entropy_explore_env.planner.propose import propose
from entropy_explore_env.planner.recipe import ALL_AROUND, NARROW_STRAIGHT
from entropy_explore_env.planner.records import CANDIDATE, EXPERIENCE, Kind
from entropy_explore_env.planner.thresholds import REMEMBERED_EDGES
from entropy_explore_env.robots.motion import MoveEnd
from entropy_explore_env.settings.localization import Localization
from entropy_explore_env.viewpoints.expected_scan import expected_bits
from tests.planner.situations import ACTION, ALONG_X, BACK, BY_SEEN, MOST, ONE_RAY, knowledge, unknown_world
from tests.reference.scenes import free_box, started

RADIUS = 1.5
"""Of the robot, voxel edges."""


def learned(experience, candidates, here, *args, **others):
    """Learn from what a robot at `here` knows, as where all bits count; see `knowledge`."""
    known = knowledge(*args, here=here, **others)
    number = chosen_number(candidates, known["target"])
    learn(experience, candidates, known, number, known["came_bits"], RADIUS)
    return known


@pytest.fixture
def proposed():
    """What was proposed: a gaze that should bring 50 bits, and the first stop on the way to a far place."""
    candidates, experience = np.zeros(MOST, CANDIDATE), np.zeros(1, EXPERIENCE)[0]
    for number, (at, kind) in enumerate([(ALONG_X, Kind.SPOT), (BACK, Kind.FAR)]):
        candidates[number]["viewpoint"] = at
        candidates[number]["goal"], candidates[number]["kind"] = at + np.array([0, 2, 0, 0, 0]), kind
        candidates[number]["bits"] = 50.0
    return candidates, experience


def test_what_brought_a_tenth_or_more_is_no_failure(proposed):
    candidates, experience = proposed
    learned(experience, candidates, ALONG_X, ALONG_X, 5.0)
    assert experience["failures"] == 0 and not experience["going"]
    assert trust_in(experience, False, ALONG_X) == 1.0


@pytest.mark.parametrize(("known", "failures"), [(False, 1), (True, 0)])
def test_to_see_all_a_scan_failed_if_what_it_was_to_show_is_still_unknown(known, failures):
    """However many bits it brought of what was known before."""
    proposer = new_proposers(BY_SEEN)[0]
    precision, situation = unknown_world()
    candidates = np.zeros(MOST, CANDIDATE)
    for part in (False, True):
        last = knowledge(ALONG_X, 1e6 if part else 0.0)
        propose(proposer, situation._replace(knowledge=last), candidates, False)
        assert situation.experience["failures"] == (failures if part else 0)
        found = expected_bits(situation.belief, proposer.refined, ALONG_X, proposer.scratch.scan)
        candidates[0]["viewpoint"] = ALONG_X
        candidates[0]["kind"], candidates[0]["bits"] = Kind.SPOT, found
        if known:
            precision[:] = 100.0


@pytest.mark.parametrize(("most", "scans", "failures"), [(2600.0, 64, 1), (2600.0, 63, 0), (2400.0, 64, 0)])
def test_after_many_low_gain_scans_from_one_place_half_of_what_was_expected_is_asked(
    proposed, most, scans, failures
):
    """50 bits are poor where more than 2,500 were ever expected; 24 of them came each time."""
    candidates, experience = proposed
    experience["most_bits"] = most
    for _ in range(scans):
        learned(experience, candidates, ALONG_X, ALONG_X, 24.0)
    assert experience["failures"] == failures
    assert trust_in(experience, True, ALONG_X) == pytest.approx(24.0 / 50.0 if failures else 1.0)


def test_low_gain_scans_are_counted_from_where_a_robot_went_last(proposed):
    candidates, experience = proposed
    experience["most_bits"] = 2600.0
    step = np.array([0.0, 0.4, 0.0, 0.0, 0.0])
    counts = []
    for at in (ALONG_X, ALONG_X, ALONG_X + step, ALONG_X + 2 * step, ALONG_X + 3 * step, ALONG_X):
        learned(experience, candidates, at, at, 30.0)
        counts.append(int(experience["low_gain_scans"]))
    assert counts == [1, 2, 3, 4, 1, 1]
    candidates["bits"] = 60.0
    learned(experience, candidates, ALONG_X, ALONG_X, 30.0)
    assert experience["low_gain_scans"] == 0


def test_many_low_gain_scans_count_until_one_is_not_poor_wherever_the_robot_goes(proposed):
    """And as long as they do, it chooses by the plain rate, c = 1."""
    candidates, experience = proposed
    experience["most_bits"] = 2600.0
    proposer = new_proposers(ONE_RAY, ALL_AROUND)[0]

    def exponent_after(at):
        last = learned(experience, candidates, at, at, 30.0, time_s=1.0, gained_bits=30.0)
        weigh_time(proposer.recipe, experience, last)
        return float(experience["exponent"])

    assert [exponent_after(ALONG_X) for _ in range(64)] == [1.15] * 63 + [1.0]
    assert exponent_after(BACK) == 1.0
    candidates["bits"] = 60.0
    assert exponent_after(BACK) == 1.15


def test_what_brought_less_is_remembered_until_it_is_far_behind(proposed):
    candidates, experience = proposed
    learned(experience, candidates, ALONG_X, ALONG_X, 4.0)
    assert experience["failures"] == 1
    alike, turned = ALONG_X + np.array([0.5, 0, 0, 0.05, 0]), ALONG_X + np.array([0, 0, 0, 0.2, 0])
    assert trust_in(experience, False, alike) == pytest.approx(4.0 / 50.0)
    assert trust_in(experience, False, turned) == 1.0
    assert trust_in(experience, True, turned) == pytest.approx(4.0 / 50.0)
    away = ALONG_X + np.array([6.1, 0, 0, 0, 0])
    learned(experience, candidates, away, away, 60.0)
    assert trust_in(experience, True, ALONG_X) == 1.0


def test_a_drive_that_was_cut_short_loses_its_goal_and_its_trust(proposed):
    candidates, experience = proposed
    learned(experience, candidates, BACK, BACK, 60.0)
    assert experience["going"] and experience["goal"].tolist() == (BACK + np.array([0, 2, 0, 0, 0])).tolist()
    short = BACK - np.array([2.0, 0, 0, 0, 0])
    learned(experience, candidates, short, BACK, 60.0, MoveEnd.TEAMMATE)
    assert not experience["going"] and experience["blocked"] == 4
    assert trust_in(experience, False, BACK) == 0.0


def test_where_the_ground_ended_is_remembered_just_beyond_the_body(proposed):
    candidates, experience = proposed
    short = np.array([3.5, 5.5, 2.5, 0.0, 0.0])
    learned(experience, candidates, short, BACK, 60.0, MoveEnd.EDGE)
    assert experience["edges"] == 1
    np.testing.assert_allclose(experience["edge_at"][0], (3.5 + 2.5, 5.5, 2.5))
    aslant = short + np.array([3.0, 4.0, 0, 0, 0])
    for _ in range(REMEMBERED_EDGES):  # the 65th takes the place of the first
        learned(experience, candidates, short, aslant, 60.0, MoveEnd.EDGE)
    np.testing.assert_allclose(experience["edge_at"][0], (3.5 + 0.6 * 2.5, 5.5 + 0.8 * 2.5, 2.5))
    learned(experience, candidates, short, short, 60.0, MoveEnd.EDGE)  # it went nowhere: no direction
    assert experience["edges"] == REMEMBERED_EDGES + 1


def test_a_robot_that_drives_on_judges_nothing_and_keeps_its_goal(proposed):
    candidates, experience = proposed
    learned(experience, candidates, ALONG_X, BACK, 0.0, under_way=True)
    assert experience["going"] and experience["failures"] == 0


def test_a_robot_under_way_beyond_reach_keeps_its_goal_until_it_stops(proposed):
    """Its target was pulled within reach when it was proposed again, so that it is like no candidate."""
    candidates, experience = proposed
    learned(experience, candidates, BACK, BACK, 60.0)
    goal = experience["goal"].tolist()
    beyond = BACK + np.array([0, 4.0, 0, 0, 0])
    learned(experience, candidates, ALONG_X, beyond, 0.0, under_way=True)
    assert experience["going"] and experience["goal"].tolist() == goal
    learned(experience, candidates, ALONG_X, ALONG_X, 0.0, under_way=True)
    assert not experience["going"]  # it chose a gaze nearby instead
    learned(experience, candidates, BACK, BACK, 60.0)
    learned(experience, candidates, beyond, beyond, 60.0)
    assert not experience["going"]


@pytest.mark.parametrize("end", [MoveEnd.ARRIVED, MoveEnd.CORNERS])
def test_a_robot_that_drifts_is_where_it_meant_to_be_if_nothing_cut_its_drive_short(proposed, end):
    candidates, experience = proposed
    off = BACK + np.array([-0.3, 0.2, 0, 0.01, 0])
    learned(experience, candidates, off, BACK, 60.0, end, uncertain=True)
    assert experience["going"] and experience["failures"] == 0
    learned(experience, candidates, off, BACK, 4.0, end, uncertain=True)
    assert trust_in(experience, False, BACK) == pytest.approx(4.0 / 50.0)
    learned(experience, candidates, off, BACK, 60.0, MoveEnd.OBSTACLE, uncertain=True)
    assert not experience["going"] and trust_in(experience, False, BACK) == 0.0


def test_a_robot_that_does_not_drift_is_judged_by_where_it_stands(proposed):
    candidates, experience = proposed
    learned(experience, candidates, BACK - np.array([0.3, 0, 0, 0, 0]), BACK, 60.0, MoveEnd.CORNERS)
    assert not experience["going"] and trust_in(experience, False, BACK) == 0.0


def test_nothing_is_remembered_of_free_drives_with_drift():
    drift = {"localization": Localization(xy_m_per_sqrt_m=0.05, z_m_per_sqrt_m=0.05)}
    robot = {"reach_m": 1.0, **drift}
    missions = started(free_box(robots=1, robot=robot, world="empty", action=ACTION), seed=1)
    own, experience = missions.state.robots[0, 0], missions.state.experience[0, 0]
    assert missions.estimates is not None
    off_edges, drives = 0.0, 0
    rng = np.random.default_rng(0)
    for _ in range(12):
        target, free = own["target"].copy(), own["move_end"] == MoveEnd.ARRIVED.code
        missed = np.linalg.norm(missions.estimates[0, 0]["place"] - target[:3]) / 0.5
        if free and own["scans"] > 0:
            failed = experience["failed"][: experience["failures"]]
            unreached = failed[experience["share"][: experience["failures"]] == 0.0]
            assert not any(np.allclose(each[:3] * 0.5, target[:3]) for each in unreached)
            off_edges, drives = max(off_edges, missed), drives + 1
        missions.step(np.zeros((1, 1, 5)), rng.integers(0, MOST, (1, 1)))
    assert drives >= 6 and off_edges > 0.01


def fail_at(candidates, experience, target, came_bits=1.0):
    candidates[0]["viewpoint"] = target
    learned(experience, candidates, target, target, came_bits)


def test_more_failures_than_are_remembered_push_out_the_oldest(proposed):
    candidates, experience = proposed
    places = [ALONG_X + np.array([1.1 * (n % 5), 1.1 * (n // 5), 0, 0, 0]) for n in range(20)]
    for target in places:
        fail_at(candidates, experience, target)
    assert experience["failures"] == 20
    assert trust_in(experience, False, places[3]) == 1.0
    assert trust_in(experience, False, places[4]) == pytest.approx(0.02)


def test_a_fifth_gaze_that_fails_at_one_place_makes_wider_ones_alike(proposed):
    """0.15 rad from the last: apart from it while four failed, alike from the fifth on."""
    candidates, experience = proposed
    beside = ALONG_X + np.array([0, 0, 0, 0, 0.15])
    trusted = []
    for number in range(7):
        fail_at(candidates, experience, ALONG_X + np.array([0, 0, 0, 0.5 * number, 0]))
        trusted.append(trust_in(experience, False, beside + np.array([0, 0, 0, 0.5 * number, 0])))
    assert trusted == pytest.approx([1.0] * 4 + [0.02] * 3)
    elsewhere = beside + np.array([1.5, 0, 0, 3.0, 0])
    assert trust_in(experience, False, elsewhere) == 1.0


def test_robots_leave_where_a_decision_brings_a_tenth_of_the_mean_rate(proposed):
    """1,000 bits in 10 s: 20 bits in 2 s are enough to stay, 19 are not. What the last of several scans
    brought has no say, and under way nothing changes."""
    proposer, experience = new_proposers(ONE_RAY)[0], proposed[1]
    assert proposer.recipe.leave_below == 0.1 and proposer.recipe.exponent == 2.2

    def exponent_after(bits, under_way=False):
        experience["decided_s"], experience["decided_bits"] = 8.0, 1000.0 - bits
        came = knowledge(ALONG_X, 7.0, under_way=under_way, time_s=10.0, gained_bits=1000.0)
        weigh_time(proposer.recipe, experience, came)
        return experience["exponent"], experience["decided_s"], experience["decided_bits"]

    assert exponent_after(20.0) == (2.2, 10.0, 1000.0)
    experience["looked_far"] = True
    assert exponent_after(19.0) == (1.0, 10.0, 1000.0)
    assert not experience["looked_far"]  # what far places were worth then was another measure
    experience["looked_far"] = True
    assert exponent_after(500.0, under_way=True) == (1.0, 8.0, 500.0)
    assert exponent_after(18.0) == (1.0, 10.0, 1000.0) and experience["looked_far"]


def test_a_recipe_with_a_small_exponent_keeps_it_when_a_robot_leaves(proposed):
    recipe = NARROW_STRAIGHT._replace(exponent=0.7)
    proposer, experience = new_proposers(ONE_RAY, recipe)[0], proposed[1]
    weigh_time(proposer.recipe, experience, knowledge(ALONG_X, 0.0, time_s=10.0, gained_bits=0.0))
    assert experience["exponent"] == 0.7
    weigh_time(proposer.recipe, experience, knowledge(ALONG_X, 0.0, time_s=20.0, gained_bits=1.0))
    weigh_time(proposer.recipe, experience, knowledge(ALONG_X, 0.0, time_s=30.0, gained_bits=1.0))
    assert experience["exponent"] == 0.7
