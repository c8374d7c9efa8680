"""What candidates see and what a robot learns, computed by hand; candidates in beliefs drawn at random."""

import math

import numpy as np
import pytest
from hypothesis import given

from entropy_explore_env.belief.fields import Belief
from entropy_explore_env.belief.paths.lattice import belief_costs, new_lattice
from entropy_explore_env.belief.paths.search import new_search
from entropy_explore_env.belief.visibility import CONE
from entropy_explore_env.planner.candidate_features import COLUMNS
from entropy_explore_env.planner.memory import chosen_number, learn, trust_in, weigh_time
from entropy_explore_env.planner.model import Situation, new_proposers
from entropy_explore_env.planner.propose import propose
from entropy_explore_env.planner.recipe import ALL_AROUND, NARROW_PLANNED, NARROW_STRAIGHT, recipe_for
from entropy_explore_env.planner.records import CANDIDATE, EXPERIENCE, KNOWLEDGE, MATE, Kind
from entropy_explore_env.planner.thresholds import REMEMBERED_EDGES
from entropy_explore_env.planner.views import clear_marks, look_from, mark_view
from entropy_explore_env.robots.motion import MoveEnd
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.localization import Localization
from entropy_explore_env.settings.scenarios import BOX
from entropy_explore_env.settings.sensor import RangeSensor
from entropy_explore_env.viewpoints.evaluation import line_is_free, new_scratch, robot_model
from entropy_explore_env.viewpoints.expected_scan import expected_bits
from tests.belief.paths.graphs import shortest_path
from tests.reference.scenes import drawn, free_box, put, random_belief, seeds, started

SIZE, MOST = (7, 11, 5), 6
ACTION = {"kind": "candidates", "candidates": MOST}
ONE_RAY = with_settings(
    BOX, {"sensor": RangeSensor((0.0, 0.0), 0.1, max_range_m=9.0, voxels_behind=0), "action": ACTION}
)
ALONG_X = np.array([0.5, 5.5, 2.5, 0.0, 0.0])
BACK = np.array([6.5, 5.5, 2.5, math.pi, 0.0])
PRIOR = 1.0 / 900.0
RADIUS = 1.5
"""Of the robot, voxel edges."""


def unknown_world():
    mean, precision = np.zeros(SIZE, np.float32), np.full(SIZE, PRIOR, np.float32)
    costs = belief_costs(mean, precision, PRIOR)
    experience = np.zeros(1, EXPERIENCE)[0]
    belief = Belief(mean.reshape(-1), precision.reshape(-1), SIZE)
    nobody = np.zeros(0, CONE), np.zeros(0, MATE)
    return precision, Situation(knowledge(ALONG_X, 0.0), belief, costs, *nobody, experience)


def test_one_ray_through_seven_unknown_voxels():
    """The wall is 3.5 m less half a voxel away; each unknown voxel lets 0.98 of the gain through."""
    precision, situation = unknown_world()
    proposer = new_proposers(ONE_RAY)[0]
    precision[:, 7, 2] = 100.0  # known: row 6 would be left one voxel thick
    assert look_from(proposer, situation, ALONG_X, 0, 0.9)
    view, sensor = proposer.scratch.views[0], ONE_RAY.sensor
    gain = (sensor.sigma_min + sensor.sigma_slope_per_m * 3.25) ** -2
    gains = [gain * 0.98**number for number in range(7)]
    bits = sum(0.5 * math.log2(1.0 + g / PRIOR) for g in gains)
    again = sum(0.5 * math.log2(1.0 + g / (PRIOR + g)) for g in gains)
    assert view["bits"] == view["all_bits"] == pytest.approx(bits, rel=1e-5)
    assert view["again_bits"] == pytest.approx(again, rel=1e-5)
    assert (view["seen"], view["unknown"]) == (7, 7)
    assert view["distance"] == pytest.approx(0 + 1 + 2 + 3 + 4 + 5 + 6)
    assert mark_view(proposer, situation.belief, 0, 0) == 7
    assert view["slivers"] == 7
    assert not look_from(proposer, situation, BACK, 1, 0.9)
    assert proposer.scratch.common[1, 0] == 7
    assert look_from(proposer, situation, BACK, 1, 2.0)
    assert mark_view(proposer, situation.belief, 1, 7) == 7
    clear_marks(proposer, 7)
    assert [proposer.scratch.views[k]["unique"] for k in range(2)] == pytest.approx([3.5, 3.5])
    assert not proposer.scratch.marks.any() and not proposer.scratch.scan.added.any()


def test_where_a_mission_ends_by_what_is_seen_known_voxels_bring_nothing():
    """Four of the seven voxels are known: the others count, as do far places' unknown voxels alone."""
    by_seen = with_settings(ONE_RAY, {"ending": {"seen_share": 1.0}, "track_truth": True})
    bits = {}
    for scenario in (ONE_RAY, by_seen):
        recipe = recipe_for(scenario.kinds[0])._replace(stop_probability=0.0, gap_probability=0.0)
        proposer = new_proposers(scenario, recipe)[0]
        precision, situation = unknown_world()
        precision[:4, 5, 2] = 100.0
        scan = proposer.exact
        sensor = scenario.sensor
        gain = (sensor.sigma_min + sensor.sigma_slope_per_m * 3.25) ** -2
        found = expected_bits(situation.belief, scan, ALONG_X, proposer.scratch.scan)
        bits[scenario.ending.by_seen] = found
        assert math.isinf(scan.wanted_precision) != scenario.ending.by_seen
    unknown, known = 0.5 * math.log2(1.0 + gain / PRIOR), 0.5 * math.log2(1.0 + gain / 100.0)
    assert bits[True] == pytest.approx(3 * unknown, rel=1e-5)
    assert bits[False] == pytest.approx(3 * unknown + 4 * known, rel=1e-5)


@pytest.mark.parametrize(("known", "failures"), [(False, 1), (True, 0)])
def test_there_a_scan_failed_if_what_it_was_to_show_is_still_unknown(known, failures):
    """However many bits it brought of what was known before."""
    by_seen = with_settings(ONE_RAY, {"ending": {"seen_share": 1.0}, "track_truth": True})
    proposer = new_proposers(by_seen)[0]
    precision, situation = unknown_world()
    candidates = np.zeros(MOST, CANDIDATE)
    for part in (False, True):
        last = knowledge(ALONG_X, 1e6 if part else 0.0)
        propose(proposer, situation._replace(knowledge=last), candidates, False)
        assert situation.experience["failures"] == (failures if part else 0)
        found = expected_bits(situation.belief, proposer.exact, ALONG_X, proposer.scratch.scan)
        candidates[0]["viewpoint"] = ALONG_X
        candidates[0]["kind"], candidates[0]["bits"] = Kind.SPOT, found
        if known:
            precision[:] = 100.0


def knowledge(target, came_bits, move_end=MoveEnd.ARRIVED, here=ALONG_X, uncertain=False, **others):
    """What a robot knows after a drive to a target; the rest is 0 unless given."""
    known = np.zeros(1, KNOWLEDGE)[0]
    known["target"], known["pose"], known["came_bits"] = target, here, came_bits
    known["move_end"], known["place_variance"] = move_end.code, 0.1 * uncertain
    for name, value in others.items():
        known[name] = value
    return known


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


def test_who_drives_on_judges_nothing_and_keeps_its_goal(proposed):
    candidates, experience = proposed
    learned(experience, candidates, ALONG_X, BACK, 0.0, under_way=True)
    assert experience["going"] and experience["failures"] == 0


def test_who_is_under_way_beyond_reach_keeps_its_goal_until_it_stops(proposed):
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
def test_who_drifts_is_where_it_meant_to_be_if_nothing_cut_its_drive_short(proposed, end):
    candidates, experience = proposed
    off = BACK + np.array([-0.3, 0.2, 0, 0.01, 0])
    learned(experience, candidates, off, BACK, 60.0, end, uncertain=True)
    assert experience["going"] and experience["failures"] == 0
    learned(experience, candidates, off, BACK, 4.0, end, uncertain=True)
    assert trust_in(experience, False, BACK) == pytest.approx(4.0 / 50.0)
    learned(experience, candidates, off, BACK, 60.0, MoveEnd.OBSTACLE, uncertain=True)
    assert not experience["going"] and trust_in(experience, False, BACK) == 0.0


def test_who_does_not_drift_is_judged_by_where_it_stands(proposed):
    candidates, experience = proposed
    learned(experience, candidates, BACK - np.array([0.3, 0, 0, 0, 0]), BACK, 60.0, MoveEnd.CORNERS)
    assert not experience["going"] and trust_in(experience, False, BACK) == 0.0


def far_kinds(most_bits):
    """Kinds of the candidates of a robot in a box of which it knows all but the far end."""
    robot = {"navigator": "planned", "reach_m": 1.0}
    sensor = RangeSensor((math.pi / 6, math.pi / 12), math.pi / 36, max_range_m=4.0)
    box = free_box(grid=Grid((31, 11, 5), 0.5), robots=1, robot=robot, sensor=sensor, action=ACTION)
    missions = started(box, seed=3)
    assert recipe_for(missions.scenario.kinds[0]) is NARROW_PLANNED
    put(missions, 0, [1.25, 2.75, 1.25, 0.0, 0.0])
    mean = missions.state.mean[0, 0].reshape(31, 11, 5)
    precision = missions.state.precision[0, 0].reshape(31, 11, 5)
    mean[:26], precision[:26] = 0.0, 1e6
    missions.state.experience[0, 0]["most_bits"] = most_bits
    missions.step(np.zeros((1, 1, 1)), np.zeros((1, 1), int))
    return missions.state.candidates[0, 0]["kind"].tolist()


@pytest.mark.parametrize("most_bits", [0.0, 1e4])
def test_far_places_are_proposed_however_many_bits_were_ever_expected(most_bits):
    """Of 1e4 bits, 25 are dregs: more than the one bit of which trust in a stop was asked."""
    assert Kind.FAR in far_kinds(most_bits)


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


@drawn(20)
@given(seeds)
def test_candidates_in_any_belief_can_be_reached_as_they_claim(seed):
    rng = np.random.default_rng(seed)
    planned = bool(rng.integers(2))
    robot = {"navigator": "planned" if planned else "straight", "reach_m": float(rng.uniform(0.3, 3.0))}
    missions = started(free_box(action=ACTION, robot=robot, observation={"panorama": False}), seed)
    mean, precision = random_belief(SIZE, seed)
    missions.state.mean[0], missions.state.precision[0] = mean.reshape(-1), precision.reshape(-1)
    place = rng.uniform(0.05, 0.95, 3) * SIZE
    put(missions, 0, [*(0.5 * place), rng.uniform(-3, 3), rng.uniform(-1, 1)])
    missions.step(np.zeros((1, 2, 1)), np.zeros((1, 2), int))  # a gaze from there, or a drive
    for number in np.flatnonzero(missions.state.robots[0]["deciding"]):
        own, candidates = missions.state.robots[0, number], missions.state.candidates[0, number]
        there = candidates[candidates["kind"] != Kind.NONE]
        here = own["goal"][:3] / 0.5
        rows = missions.layout.split(missions.observations[0, number])["candidates"]
        assert np.isfinite(rows).all() and np.abs(rows).max() <= 1.0
        belief = Belief(missions.state.mean[0, number], missions.state.precision[0, number], SIZE)
        model = robot_model(missions.scenario, missions.scenario.kinds[0])
        for k, candidate in enumerate(there):
            at = candidate["viewpoint"][:3] / 0.5
            assert (at >= 0.0).all() and (at <= SIZE).all()
            assert np.linalg.norm(at - here) <= robot["reach_m"] / 0.5 * (1 + 1e-9)
            if (
                candidate["kind"] != Kind.NEAR
                or rows[k, COLUMNS["score"]] == 0.0
                or rows[k, COLUMNS["seconds"]] == 1.0
            ):
                continue
            if planned:
                costs = belief_costs(belief.mean, belief.precision, PRIOR, 1.0)
                lattice = new_lattice(SIZE, missions.scenario.robot.body_radius_m / 0.5, None)
                ends = [int(np.ravel_multi_index(tuple(p.astype(int)), SIZE)) for p in (here, at)]
                assert math.isfinite(shortest_path(new_search(mean.size), lattice, costs, *ends)[0])
            else:
                radius = missions.scenario.robot.body_radius_m / 0.5
                assert line_is_free(belief, here, at, radius, new_scratch(BOX.grid, [model]))
