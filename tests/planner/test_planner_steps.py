"""The planner's steps one by one: nearby and far viewpoints, first stops, worth, ways out, and elsewhere."""

from __future__ import annotations

import math

import numpy as np
import pytest

from entropy_explore_env.belief.fields import Belief
from entropy_explore_env.belief.visibility import CONE
from entropy_explore_env.planner.far import _fill_far, first_stop, propose_far
from entropy_explore_env.planner.memory import trust_and_clearance, worth_bits
from entropy_explore_env.planner.model import Situation, new_proposers
from entropy_explore_env.planner.nearby import cost_of, evaluate, propose_nearby, search_within, start_paths
from entropy_explore_env.planner.propose import choose
from entropy_explore_env.planner.recipe import ALL_AROUND, NARROW_PLANNED, NARROW_STRAIGHT
from entropy_explore_env.planner.records import EXPERIENCE, KNOWLEDGE, MATE, Kind
from entropy_explore_env.planner.states import PlannerState
from entropy_explore_env.settings.changes import with_settings
from entropy_explore_env.settings.grid import Grid
from entropy_explore_env.settings.scenarios import BOX, OFFICE, OFFICE_3D
from entropy_explore_env.viewpoints.expected_scan import fill_bits
from entropy_explore_env.worlds.world import World
from tests.belief.paths.graphs import belief_costs

ACTION = {"kind": "candidates", "candidates": 1}
PLAN = with_settings(
    OFFICE,
    {
        "grid": Grid((50, 70, 1), 0.1),
        "robots": 1,
        "robot": {"body_radius_m": 0.0, "reach_m": 1.5},
        "action": ACTION,
    },
)
HALL = with_settings(
    OFFICE_3D,
    {
        "grid": Grid((170, 30, 20), 0.1),
        "robots": 1,
        "robot": {"navigator": "planned", "body_radius_m": 0.3, "reach_m": 4.2},
        "action": ACTION,
    },
)
HERE = np.array([10.5, 5.5, 0.5, 0.3, 0.0])
UNKNOWN = 1.0 / 900.0
EXPLORING = int(PlannerState.EXPLORING)


def situation_of(scenario, mean, precision, here=HERE, mates=(), most_bits=0.0):
    """What a robot's candidates depend on; it has experienced nothing."""
    experience = np.zeros(1, EXPERIENCE)[0]
    experience["candidates_rng"], experience["most_bits"] = 7, most_bits
    experience["exponent"] = ALL_AROUND.exponent
    heard = np.zeros(len(mates), MATE)
    for mate, (place, body_radius) in zip(heard, mates, strict=True):
        mate["place"], mate["body_radius"] = place, body_radius
    mean, precision = mean.reshape(-1).astype(np.float32), precision.reshape(-1).astype(np.float32)
    unknown_cost = scenario.robot.unknown_cost
    costs = belief_costs(mean, precision, scenario.sigma_prior**-2, unknown_cost, np.zeros(len(mean), bool))
    belief = Belief(mean, precision, scenario.grid.shape)
    knowledge = np.zeros(1, KNOWLEDGE)[0]
    knowledge["pose"] = here
    return Situation(knowledge, belief, costs, np.zeros(0, CONE), heard, experience)


def half_known_plan(**changes):
    """A plan whose part below y = 20 is known and free, with a wall at x = 25 up to there."""
    mean, precision = np.full(PLAN.grid.shape, 0.5), np.full(PLAN.grid.shape, UNKNOWN)
    mean[:, :20], precision[:, :20] = 0.0, 2000.0
    mean[25, :18] = 1.0
    return situation_of(PLAN, mean, precision, **changes)


def test_nearby_viewpoints_of_a_flying_robot_lie_within_reach_and_inside():
    box, shape = with_settings(BOX, {"action": ACTION}), BOX.grid.shape
    proposer, here = new_proposers(box)[0], np.array([3.2, 5.1, 2.4, 0.3, -0.2])
    situation = situation_of(box, np.full(shape, 0.5), np.full(shape, UNKNOWN), here)
    pool, size = proposer.scratch.pool, propose_nearby(proposer, situation)
    viewpoints = pool["viewpoint"][:size]
    apart = np.linalg.norm(viewpoints[:, :3] - here[:3], axis=1)
    assert 0.0 < apart.max() <= 2.0 * (1 + 1e-9) and (viewpoints[:, :3] > 0.0).all()
    assert (viewpoints[:, :3] < shape).all() and np.abs(viewpoints[:, 3]).max() <= math.pi
    assert (pool["kind"][:size] == np.where(apart == 0.0, Kind.SPOT, Kind.NEAR)).all()
    assert (pool["bits"][:size] > 0.0).any() and (pool["seconds"][:size] >= BOX.sensor.scan_time_s).all()


def test_refining_never_loses_the_best():
    best = []
    for refinements in (0, 1, 2, 3):
        recipe = ALL_AROUND._replace(refinements=refinements)
        proposer, situation = new_proposers(PLAN, recipe)[0], half_known_plan()
        situation.experience["exponent"] = 0.3
        start_paths(proposer, situation)
        propose_nearby(proposer, situation)
        best.append(proposer.scratch.pool["value"][proposer.scratch.order[0]])
    assert best == sorted(best) and best[-1] > best[0]


@pytest.mark.parametrize(("sensor", "least_s"), [({}, 0.0), ({"scan_every_m": 0.2}, 5.0)])
def test_where_scans_are_taken_under_way_standing_counts_with_the_time_to_stop_and_start(sensor, least_s):
    """0.5 m/s at 0.2 m/s²: 2.5 s to brake, 2.5 s to come to speed again."""
    robot = {"max_speed_m_s": 0.5, "acceleration_m_s2": 0.2}
    proposer, situation = (
        new_proposers(with_settings(PLAN, {"robot": robot, "sensor": sensor}))[0],
        half_known_plan(),
    )
    situation.experience["exponent"] = 0.7
    start_paths(proposer, situation)
    pool = proposer.scratch.pool[: propose_nearby(proposer, situation)]
    seconds = np.maximum(pool["seconds"], least_s)
    assert (pool["seconds"] < 5.0).any() and (pool["kind"] == Kind.SPOT).any()
    np.testing.assert_allclose(pool["value"], pool["bits"] / seconds**0.7)


@pytest.fixture
def far():
    """A proposer and a situation, after far places were proposed, the goal of the robot among them."""
    proposer, situation = new_proposers(PLAN)[0], half_known_plan(most_bits=1e9)
    experience = situation.experience
    experience["going"], experience["goal"] = True, (40.5, 30.5, 0.5, 0.3, 0.0)
    start_paths(proposer, situation)
    count, best = propose_far(proposer, situation, EXPLORING)
    return proposer, situation, count, best


def test_far_places_are_known_near_what_is_unknown_and_the_goal_is_last(far):
    proposer, situation, count, best = far
    places = proposer.scratch.far
    np.testing.assert_array_equal(places["viewpoint"][count - 1], situation.experience["goal"])
    assert 4 < count <= ALL_AROUND.far_places + 1 and best == places["value"][:count].max() > 0.0
    assert np.isfinite(places["seconds"][:count]).all() and (places["viewpoint"][:count, 3] == 0.3).all()
    frontier_block = places["viewpoint"][: count - 1, 1]  # unknown is what lies beyond y = 20
    assert (frontier_block > 10.0).all() and (frontier_block < 20.0).all()
    straight = np.linalg.norm(places["viewpoint"][:count, :3] - HERE[:3], axis=1) * 0.1
    assert (places["seconds"][:count] > straight / PLAN.robot.max_speed_m_s).all()


@pytest.mark.parametrize("most", [1, 2, 8])
def test_a_viewpoint_is_worth_the_number_of_scans_that_pays_most(most):
    """In a known plan, where further scans bring nearly as much as the first one."""
    proposer, shape = new_proposers(PLAN, predicted=True)[0], PLAN.grid.shape
    situation = situation_of(PLAN, np.zeros(shape), np.full(shape, 2000.0))
    scratch, drive = proposer.scratch, proposer.drive
    scratch.scan.scans[0] = most
    start_paths(proposer, situation)
    options = scratch.pool[:2]
    options["viewpoint"] = [(*HERE[:3], 0.0, 0.0), (18.5, 18.5, 0.5, 0.0, 0.0)]
    evaluate(proposer, situation, proposer.refined, options, False)
    values = {1: [], most: []}
    for option in options:
        fill_bits(situation.belief, proposer.refined, option["viewpoint"], scratch.scan)
        found = [
            scratch.scan.bits[n] / (option["seconds"] + (2**n - 1) * drive.scan_time_s) ** ALL_AROUND.exponent
            for n in range(1 + int(math.log2(most)))
        ]
        assert option["bits"] == pytest.approx(scratch.scan.bits[0])
        assert option["value"] == pytest.approx(max(found))
        values[1].append(found[0])
        values[most].append(max(found))
    assert (values[most][1] > values[1][1]) == (most > 1)


def test_a_depleted_planner_evaluates_other_places_each_time():
    """Two places promise most, and failed: an exploring planner has nothing but these."""
    proposer = new_proposers(PLAN, ALL_AROUND._replace(far_places=2))[0]
    situation, places = half_known_plan(most_bits=1e9), proposer.scratch.far
    start_paths(proposer, situation)
    assert propose_far(proposer, situation, EXPLORING)[1] > 0.0
    situation.experience["failed"][:2] = places["viewpoint"][:2]
    situation.experience["failures"] = 2
    assert propose_far(proposer, situation, EXPLORING) == (2, 0.0)
    depleted = [propose_far(proposer, situation, int(PlannerState.DEPLETED)) for _ in range(8)]
    assert max(best for _, best in depleted) > 0.0


@pytest.mark.parametrize("seed", range(8))
def test_between_cells_the_search_ends_where_no_place_beyond_could_promise_more(seed):
    """A search everywhere finds none that promises more, in a hall that is known but for gaps."""
    recipe = ALL_AROUND._replace(far_places=3)
    proposer, shape, rng = new_proposers(HALL, recipe)[0], HALL.grid.shape, np.random.default_rng(seed)
    precision = np.where(rng.random(shape) < 0.002, UNKNOWN, 2000.0)
    begin = 60 if seed < 4 else 140
    precision[begin : begin + rng.integers(10, 30), :8] = UNKNOWN
    here, far_end = (np.array([x, 15.5, 10.5, 0.3, 0.0]) for x in (6.5, 164.5))
    situation = situation_of(HALL, np.zeros(shape), precision, here, most_bits=1e9)
    scratch = proposer.scratch
    assert proposer.lattice.edge == 2
    start_paths(proposer, situation)
    assert propose_far(proposer, situation, EXPLORING)[0] == 3
    staged, whole = scratch.worth[:3].copy(), cost_of(proposer, situation, far_end) < math.inf
    assert whole == (seed >= 4)
    search_within(proposer, situation, math.inf)
    assert _fill_far(proposer, situation, EXPLORING, math.inf, scratch.far) == (3, False)
    assert (staged >= scratch.worth[:3] * (1.0 - 1e-9)).all()


@pytest.mark.parametrize(("state", "goes"), [(EXPLORING, True), (int(PlannerState.DEPLETED), False)])
def test_between_cells_the_search_goes_on_to_the_goal_or_everywhere_in_a_depleted_planner(state, goes):
    """All that is unknown is near, so that an exploring planner without a goal searches no farther."""
    proposer, shape = new_proposers(HALL, ALL_AROUND._replace(far_places=3))[0], HALL.grid.shape
    precision = np.full(shape, 2000.0)
    precision[60:80, :8] = UNKNOWN
    here, far_end = (np.array([x, 15.5, 10.5, 0.3, 0.0]) for x in (6.5, 164.5))
    situation = situation_of(HALL, np.zeros(shape), precision, here, most_bits=1e9)
    situation.experience["going"], situation.experience["goal"] = goes, far_end
    start_paths(proposer, situation)
    count, _ = propose_far(proposer, situation, state)
    assert count == 3 + goes and cost_of(proposer, situation, far_end) < math.inf
    if goes:
        assert proposer.scratch.far["seconds"][count - 1] < math.inf


def test_the_first_stop_on_the_way_is_within_reach_and_free(far):
    proposer, situation, _, _ = far
    stop = np.zeros(5)
    assert first_stop(proposer, situation, np.array([10.5, 30.5, 0.5, 0.3, 0.0]), stop)
    assert 10.0 < np.linalg.norm(stop[:3] - HERE[:3]) <= 15.0
    near = np.array([13.5, 5.5, 0.5, 1.0, 0.0])
    assert first_stop(proposer, situation, near, stop)
    np.testing.assert_array_equal(stop, near)
    behind = np.array([30.5, 3.5, 0.5, 0.0, 0.0])
    assert first_stop(proposer, situation, behind, stop) and stop[0] < 25.0
    assert not first_stop(proposer, situation, np.array([25.5, 3.5, 0.5, 0.0, 0.0]), stop)


def test_robots_that_drive_straight_stop_on_the_straight_part_of_the_path():
    straight = with_settings(PLAN, {"robot": {"navigator": "straight"}})
    proposer, situation = new_proposers(straight)[0], half_known_plan(most_bits=1e9)
    start_paths(proposer, situation)
    propose_far(proposer, situation, EXPLORING)
    stop = np.zeros(5)
    assert first_stop(proposer, situation, np.array([10.5, 40.5, 0.5, 0.0, 0.0]), stop)
    np.testing.assert_allclose(stop[:3], (10.5, 5.5 + 15.0, 0.5), rtol=1e-5)


def test_what_any_scan_brings_is_worth_next_to_nothing():
    """Of 1,000 bits at most, 0.25 % is what known ground brings: the first 2.5 of any scan."""
    dull = new_proposers(PLAN, NARROW_PLANNED._replace(known_ground_share=0.0025))[0]
    plain, situation = new_proposers(PLAN)[0], half_known_plan(most_bits=1000.0)
    worth = [worth_bits(dull, situation, HERE, bits) for bits in (2.0, 4.5, 502.5)]
    np.testing.assert_allclose(worth, [0.02, 2.0, 500.0])
    assert [worth_bits(plain, situation, HERE, bits) for bits in (2.0, 4.5)] == [2.0, 4.5]


def test_a_robot_that_a_teammate_blocked_keeps_clear_of_it():
    bodies = with_settings(PLAN, {"robot": {"body_radius_m": 0.15}})
    proposer = new_proposers(bodies)[0]
    situation = half_known_plan(mates=[((20.5, 5.5, 0.5), 1.5)])
    ahead, behind = (HERE + np.array([dx, 0.0, 0.0, 0.0, 0.0]) for dx in (8.0, -8.0))
    assert trust_and_clearance(proposer, situation, ahead) == 1.0
    situation.experience["blocked"] = 2
    worth = [trust_and_clearance(proposer, situation, at) for at in (ahead, behind, HERE)]
    assert worth == [0.0, 1.0, 1.0]


def test_a_robot_does_not_drive_again_to_where_the_ground_ended():
    """The body of 1.5 edges has half an edge to spare: drives that come nearer than 2 are refused."""
    bodies = with_settings(PLAN, {"robot": {"body_radius_m": 0.15}})
    proposer, situation = new_proposers(bodies)[0], half_known_plan()
    situation.experience["edge_at"][0] = HERE[:3] + np.array([2.5, 0.0, 0.0])
    steps = [(8.0, 0.0), (8.0, 6.0), (4.0, 8.0), (0.0, 6.0), (-4.0, 0.0), (0.0, 0.0)]
    places = [HERE + np.array([dx, dy, 0.0, 0.0, 0.0]) for dx, dy in steps]
    assert [trust_and_clearance(proposer, situation, at) for at in places] == [1.0] * 6
    situation.experience["edges"] = 1
    worth = [trust_and_clearance(proposer, situation, at) for at in places]
    assert worth == [0.0, 0.0, 1.0, 1.0, 1.0, 1.0]


def test_bodies_that_touch_may_part():
    bodies = with_settings(PLAN, {"robot": {"body_radius_m": 0.15}})
    proposer = new_proposers(bodies)[0]
    situation = half_known_plan(mates=[((11.5, 5.5, 0.5), 1.5)])
    situation.experience["blocked"] = 2
    steps = [(-2.0, 0.0), (3.0, 0.0), (0.0, 2.0), (0.0, 0.0), (0.5, 2.0)]
    places = [HERE + np.array([dx, dy, 0.0, 0.0, 0.0]) for dx, dy in steps]
    worth = [trust_and_clearance(proposer, situation, at) for at in places]
    assert worth == [1.0, 0.0, 1.0, 1.0, 0.0]


def choice_of(situation, seed=7):
    """The viewpoint that the planner chooses."""
    proposer = new_proposers(PLAN)[0]
    situation.experience["candidates_rng"] = seed
    start_paths(proposer, situation)
    size, number = choose(proposer, situation, EXPLORING, propose_nearby(proposer, situation), 1)
    assert number < size
    return proposer.scratch.pool["viewpoint"][number].copy()


def known_plan(shut):
    """A plan of which all is known: free, or covered next to the robot's own voxel and beyond."""
    mean = np.ones(PLAN.grid.shape) if shut else np.zeros(PLAN.grid.shape)
    x, y = HERE[:2].astype(int)
    mean[x - 1 : x + 2, y - 1 : y + 2] = 0.0
    return situation_of(PLAN, mean, np.full(PLAN.grid.shape, 1e15), most_bits=1000.0)


def test_where_nothing_is_left_it_goes_elsewhere():
    chosen = choice_of(known_plan(shut=False))
    assert 0.5 < np.linalg.norm(chosen[:3] - HERE[:3]) <= 15.0


def test_a_robot_that_its_belief_shuts_in_leaves_by_a_voxel_beside_it():
    chosen = {tuple((choice_of(known_plan(shut=True), seed)[:3] - HERE[:3]).tolist()) for seed in range(8)}
    assert len(chosen) > 2 and all(0.0 < max(map(abs, step)) <= 1.5 for step in chosen)


def test_each_kind_has_its_recipe():
    given = new_proposers(PLAN, NARROW_STRAIGHT)[0].recipe
    assert given.exponent == NARROW_STRAIGHT.exponent and given.turns == NARROW_STRAIGHT.turns
    assert new_proposers(PLAN)[0].recipe.exponent == ALL_AROUND.exponent


def drone_in_a_hall():
    """A drone at one end of a hall of 100 × 30 × 12 voxels, half of it known, with a wall but for a door."""
    drone = {"body_radius_m": 0.3, "reach_m": 8.0}
    grid, sensor = Grid((100, 30, 12), 0.1), {"field_of_view_rad": (2.0 * math.pi, 0.5)}
    hall = with_settings(OFFICE_3D, {"grid": grid, "robot": drone, "sensor": sensor, "action": ACTION})
    mean, precision = np.full(grid.shape, 0.5), np.full(grid.shape, UNKNOWN)
    mean[:60], precision[:60] = 0.0, 2000.0
    mean[30, :20] = 1.0
    here = np.array([8.5, 6.5, 5.5, 0.0, 0.0])
    return hall, situation_of(hall, mean, precision, here, most_bits=1e9)


def test_drones_in_fine_grids_search_paths_in_cells_and_stop_where_they_fit(monkeypatch):
    monkeypatch.setattr("entropy_explore_env.viewpoints.evaluation._CELLS_WITHIN", 8)
    hall, situation = drone_in_a_hall()
    proposer = new_proposers(hall)[0]
    assert proposer.lattice.edge == 3 and proposer.lattice.grid == hall.grid.shape
    start_paths(proposer, situation)
    count, best = propose_far(proposer, situation, EXPLORING)
    goals = proposer.scratch.far["viewpoint"][:count]
    assert count > 0 and best > 0.0 and (goals[:, 0] > 31.0).any()
    covered = situation.belief.mean.reshape(hall.grid.shape) > 0.5
    blocked = World(hall.grid, covered, "hall").collision_mask(0.3) > 0
    stop = np.zeros(5)
    for goal in goals:
        assert first_stop(proposer, situation, goal, stop)
        assert not blocked[tuple(stop[:3].astype(int))] and not blocked[tuple(goal[:3].astype(int))]
    behind = next(goal for goal in goals if goal[0] > 31.0)
    straight = np.linalg.norm(behind[:3] - situation.knowledge["pose"][:3])
    around = math.dist((8.5, 6.5), (30.5, 23.0)) + math.dist((30.5, 23.0), tuple(behind[:2]))
    assert cost_of(proposer, situation, behind) > max(straight, around) * 0.95
    assert math.isinf(cost_of(proposer, situation, np.array([30.5, 6.5, 5.5, 0.0, 0.0])))


def test_cells_are_voxels_where_reaches_are_short():
    hall, _ = drone_in_a_hall()
    assert new_proposers(hall)[0].lattice.edge == 1
